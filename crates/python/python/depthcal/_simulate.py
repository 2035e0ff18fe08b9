"""Simulated captures, for examples and tests."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import _depthcal
from ._dataset import Dataset


def simulate(
    out: str | os.PathLike[str],
    *,
    camera: int | str = 1,
    kind: str = "general1",
    effects: Sequence[str] = (),
    seed: int = 1,
    unit: int = 0,
    frames: int | None = None,
    board: str = "asymmetric-circles",
    truth: str | os.PathLike[str] | None = None,
) -> Path:
    """Renders a dataset of a camera whose errors are known, as ``depthcal simulate`` does, into a new or empty folder; returns it.

    ``effects`` are names with sizes such as ``"cyclic_depth=4"`` (``depthcal simulate --help`` lists them). ``board`` is
    ``"asymmetric-circles"`` (4 × 11, 17 mm) or ``"chessboard"`` (9 × 6 inner corners, 25 mm). ``unit`` numbers cameras of one type, whose
    effects have other phases and shapes. The same arguments give the same bytes.
    """
    native_truth = None if truth is None else os.fspath(truth)
    given = _arguments(camera, kind, effects, seed, unit, frames)
    _depthcal.simulate(os.fspath(out), {**given, "board": board}, native_truth)
    return Path(out)


def simulate_points(
    *,
    camera: int | str = 1,
    kind: str = "general1",
    effects: Sequence[str] = (),
    seed: int = 1,
    unit: int = 0,
    frames: int | None = None,
    samples: int = 500,
) -> Dataset:
    """A dataset of simulated markers and ``samples`` depth pixels per frame, without images: fast, for studies and examples."""
    given = _arguments(camera, kind, effects, seed, unit, frames)
    return Dataset(_depthcal.simulate_points({**given, "board": None}, samples))


def _arguments(
    camera: int | str, kind: str, effects: Sequence[str], seed: int, unit: int, frames: int | None
) -> dict[str, Any]:
    """A simulation as the native module takes it, without its board."""
    return {
        "camera": str(camera),
        "kind": kind,
        "effects": list(effects),
        "seed": seed,
        "unit": unit,
        "frames": frames,
    }
