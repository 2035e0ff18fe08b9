"""Comparison of depth models."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from . import _depthcal, _progress
from ._arguments import whole
from ._dataset import Dataset, dataset_of, datasets_of
from ._effects import EffectLike, in_words, model_in_words
from ._report import Reported
from ._tables import Table


@dataclass(frozen=True)
class ComparedModel:
    """A model of a comparison; errors on frames that its fit did not use, with 95 % intervals."""

    model: str
    parameters: int
    dot_error_mm: float | None
    dot_error_low_mm: float | None
    dot_error_high_mm: float | None
    plane_error_mm: float | None
    depth_rms_mm: float | None
    depth_rms_low_mm: float | None
    depth_rms_high_mm: float | None
    really_worse: bool
    """Whether it is worse than the best by more than chance, corrected for the number of models."""
    aic: float | None
    bic: float | None
    failed: str | None
    """Why it could not be fitted."""


def _interval(errors: dict[str, Any], name: str) -> tuple[float | None, float | None, float | None]:
    found = errors.get(name)
    return (None, None, None) if found is None else (found["mean"], found["low"], found["high"])


def _models(models: list[dict[str, Any]]) -> Table[ComparedModel]:
    rows = []
    for m in models:
        held_out = m["held_out"]
        plane = _interval(held_out, "plane_error_mm")[0]
        rows.append(
            ComparedModel(
                m["model"],
                m["parameters"],
                *_interval(held_out, "dot_error_mm"),
                plane,
                *_interval(held_out, "depth_rms_mm"),
                m.get("really_worse", False),
                m.get("aic"),
                m.get("bic"),
                m.get("failed"),
            )
        )
    return Table(rows, "model", ComparedModel)


class Comparison(Reported):
    """Depth models on data that their fits did not use: what ``depthcal compare`` writes. Of a rig, :attr:`cameras` has the comparison on
    each camera with depth."""

    def __init__(self, native: _depthcal.Comparison) -> None:
        self._native = native

    @property
    def record(self) -> dict[str, Any]:
        """The contents of ``comparison.json``."""
        return json.loads(self._native.json())

    @property
    def cameras(self) -> dict[str, Comparison]:
        """The comparison on every camera with depth, by its name."""
        return {name: Comparison(self._native.camera(name)) for name in self._native.cameras()}

    @property
    def models(self) -> Table[ComparedModel]:
        """The models, best first."""
        return _models(self.record["models"])

    @property
    def variants(self) -> Table[ComparedModel]:
        """Further fits of the thesis' tables: subsets of D, with and without lens, and estimators."""
        return _models(self.record.get("variants", []))

    @property
    def verdict(self) -> list[str]:
        """The conclusions in sentences."""
        return self.record["verdict"]

    def plot(self, ax: Any = None) -> Any:
        """Errors of every model with their intervals. Returns matplotlib's axes."""
        from ._plots import models

        return models(self.models, ax)

    def _summary(self) -> list[Any]:
        return [self.models] if self._native.is_of_one() else []

    def __repr__(self) -> str:
        if not self._native.is_of_one():
            return "\n\n".join(f"[{name}]\n{camera!r}" for name, camera in self.cameras.items())
        tables = "\n\n".join(f"{title}\n{text}" for title, text in self._native.tables())
        return tables + "\n" + "\n".join(self.verdict)


def compare(
    train: Dataset | str | os.PathLike[str],
    *,
    models: Sequence[EffectLike | Sequence[EffectLike]] = ("none", "projective:xw", "projective"),
    verify: Dataset | str | os.PathLike[str] | Sequence[Dataset | str | os.PathLike[str]] = (),
    effects: Sequence[EffectLike] = (),
    lens: str | None = None,
    folds: int = 6,
    thesis: bool = False,
    learning: int = 0,
    progress: _progress.Progress = None,
) -> Comparison:
    """Fits depth models to ``train``, of a rig to each of its cameras with depth, and compares their errors on ``verify`` or, without it, by cross-validation in ``folds`` parts.

    ``models`` are as :func:`calibrate` takes them, ``effects`` are part of every model. ``thesis`` adds the tables of Sjöholm 2017,
    ``learning`` fits per number of frames of the learning curve; the command line makes both unless told otherwise.
    Raises :class:`InputError`, and :class:`UntrustedFitError` where no model can be fitted.
    """
    train = dataset_of(train, "train")
    texts, natives = in_words(effects)
    words = []
    for model in [models] if isinstance(models, str) else models:
        text, more = model_in_words(model)
        words.append(text)
        natives += more
    unique = list({native.name: native for native in natives}.values())
    others = datasets_of(verify, "verify")
    call = f"depthcal.compare(depthcal.load({train._native.path!r}), models={words!r})"
    native = _depthcal.compare(
        train._native,
        [dataset._native for dataset in others],
        {"model": "projective", "with": texts, "effects": unique, "lens": lens},
        {
            "models": words,
            "folds": whole("folds", folds, 2),
            "thesis": thesis,
            "learning": whole("learning", learning, 0),
        },
        call,
        _progress.show(progress),
    )
    return Comparison(native)
