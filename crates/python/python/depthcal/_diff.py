"""Two calibrations compared with each other."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Union

from . import _depthcal, _progress
from ._calibration import Calibration
from ._fit import Fit
from ._report import Reported
from ._tables import Table


@dataclass(frozen=True)
class DifferenceAt:
    """A difference over the image of one camera, at one distance."""

    camera: str
    quantity: str
    """``depth`` (corrected depth, mm) or ``projection`` (px, with the best rotation of the rays removed)."""
    distance_mm: float | None
    """None where it holds at all distances."""
    rms: float
    expected_rms: float | None
    """What both uncertainties alone give on average; None where neither calibration has a covariance."""
    p_value: float | None
    differs: bool
    """Whether it is more than the uncertainties allow, at a level of 0.1 %."""


class Difference(Reported):
    """What ``depthcal diff`` writes: differences of projection and of corrected depth against the uncertainties of both."""

    def __init__(self, native: _depthcal.Difference) -> None:
        self._native = native

    @property
    def record(self) -> dict[str, Any]:
        """The contents of ``diff.json``, as ``depthcal schema diff`` describes it, with maps over the image."""
        return json.loads(self._native.json())

    @property
    def verdict(self) -> list[str]:
        """Whether and where the calibrations differ by more than their uncertainties, one sentence per quantity and camera."""
        return self._native.sentences()

    @property
    def differences(self) -> Table[DifferenceAt]:
        """Every quantity at every distance."""
        rows = []
        for camera in self.record["cameras"]:
            for quantity in ("depth", "projection"):
                for at in camera[quantity]:
                    size = at["size"]
                    rows.append(
                        DifferenceAt(
                            camera["name"],
                            quantity,
                            at.get("distance_mm"),
                            size["rms"],
                            size.get("expected_rms"),
                            size.get("p_value"),
                            size["differs"],
                        )
                    )
        return Table(rows, None, DifferenceAt)

    @property
    def differs(self) -> bool:
        """Whether anything differs by more than the uncertainties."""
        return any(row.differs for row in self.differences)

    def __repr__(self) -> str:
        return self._native.text()


Given = Union[Calibration, Fit, str, "os.PathLike[str]"]


def _native(given: Given) -> tuple[Any, str]:
    """What the native function takes, and its name."""
    if isinstance(given, Fit):
        given = given.calibration
    if isinstance(given, Calibration):
        return given._native, given.record["dataset"]["path"]
    return os.fspath(given), os.fspath(given)


def diff(
    first: Given,
    second: Given,
    *,
    size: tuple[int, int] | None = None,
    progress: _progress.Progress = None,
) -> Difference:
    """Compares two calibrations of a camera, or of a rig, with each other: yesterday's, the maker's file, another model's.

    Differences are second minus first. Either is a :class:`Calibration`, a :class:`Fit`, or a path: of a ``calibration.json``, of the folder
    that it is in, or of a camera file of another program, which is taken as exact. ``size`` (width, height) is that of the
    images, px, where neither says so. Differences of projection have the best rotation of the rays removed.
    Raises :class:`InputError` where images differ in size, or no camera is in both.
    """
    (a, name_a), (b, name_b) = _native(first), _native(second)
    call = f"depthcal.diff({name_a!r}, {name_b!r})"
    return Difference(_depthcal.diff(a, b, [name_a, name_b], size, call, _progress.show(progress)))
