"""Search for what a model lacks."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from . import _depthcal, _progress
from ._calibration import Calibration
from ._dataset import Dataset, dataset_of
from ._depthcal import InputError
from ._effects import Effect, EffectLike, in_words, model_in_words
from ._evaluate import Judged
from ._fit import Fixed, fixed_in_words, parts_of
from ._tables import Table


@dataclass(frozen=True)
class Step:
    """An effect that was missing and was added."""

    effect: str
    with_: str
    """The effect as :func:`calibrate` takes it in ``effects``."""
    size_mm: float
    """Root mean square over the observations of what other parameters do not compensate of the effect."""
    p_value: float
    depth_rms_before_mm: float | None
    """On frames that the fit did not use."""
    depth_rms_after_mm: float | None
    gain_percent: float | None
    gain_low_percent: float | None
    gain_high_percent: float | None
    indistinguishable: str
    """Effects that these captures cannot tell from it."""


@dataclass(frozen=True)
class Candidate:
    """An effect that was tested in a round."""

    round: int
    effect: str
    p_value: float
    expected_size_mm: float | None
    minimal_detectable_mm: float | None
    """Smallest such size that these captures would have shown."""
    held_out_gain_percent: float


class Diagnosis(Judged):
    """What the models of a dataset's cameras lack: what ``depthcal diagnose`` writes. Of a rig, :attr:`cameras` has the diagnosis of each
    camera, with :attr:`steps` and :attr:`candidates`."""

    def __init__(self, native: _depthcal.Diagnosis) -> None:
        self._native = native

    @property
    def record(self) -> dict[str, Any]:
        """The contents of ``diagnosis.json``."""
        return json.loads(self._native.json())

    def _camera_record(self) -> dict[str, Any]:
        """The record of one camera."""
        record = self.record
        if "cameras" in record:
            raise InputError(
                f"the diagnosis is of several cameras: take one of .cameras, {', '.join(self._native.cameras())}"
            )
        return record

    @property
    def verdict(self) -> str:
        """``adequate``, ``effect`` or ``unexplained`` (docs/diagnose.md); of a rig the worst of its cameras."""
        return self.record["verdict"]

    @property
    def sentence(self) -> str:
        """The verdict in a sentence."""
        return self._native.sentence()

    @property
    def cameras(self) -> dict[str, Diagnosis]:
        """The diagnosis of every camera with depth, by its name."""
        return {name: Diagnosis(self._native.camera(name)) for name in self._native.cameras()}

    @property
    def steps(self) -> Table[Step]:
        """The effects that were added, in order."""
        rows = []
        for s in self._camera_record()["steps"]:
            gain = s.get("depth_gain_percent") or {}
            rows.append(
                Step(
                    s["effects"][0],
                    s["with"],
                    s["size_mm"],
                    s["p_value"],
                    s["before"].get("depth_rms_mm"),
                    s["after"].get("depth_rms_mm"),
                    gain.get("value"),
                    gain.get("low"),
                    gain.get("high"),
                    ", ".join(s["indistinguishable"]),
                )
            )
        return Table(rows, "effect", Step)

    @property
    def candidates(self) -> Table[Candidate]:
        """The tests of every round."""
        rows = [
            Candidate(
                number + 1,
                c["effect"],
                c["p_value"],
                c.get("expected_size_mm"),
                c.get("minimal_detectable_mm"),
                c["held_out_gain_percent"],
            )
            for number, found in enumerate(self._camera_record()["rounds"])
            for c in found["effects"]
        ]
        return Table(rows, None, Candidate)

    @property
    def calibration(self) -> Calibration:
        """The calibration with everything that was added."""
        return Calibration(self._native.calibration())

    @property
    def formulas(self) -> list[Effect]:
        """Formulas that were found, for ``effects`` of further calls."""
        return [Effect(native) for native in self._native.formulas()]

    def scores(self) -> dict[str, Any] | None:
        """The contents of ``scores.json`` of one camera's last model, see :meth:`Fit.scores`."""
        text = self._native.scores()
        return None if text is None else json.loads(text)

    def plot(self, ax: Any = None) -> Any:
        """Held-out depth error before and after every step. Returns matplotlib's axes."""
        from ._plots import steps

        return steps(self, ax)

    def _summary(self) -> list[Any]:
        return [self.errors]

    def __repr__(self) -> str:
        return self._native.text()


def diagnose(
    dataset: Dataset | str | os.PathLike[str],
    *,
    verify: Dataset | str | os.PathLike[str] | None = None,
    model: EffectLike | Sequence[EffectLike] = "projective",
    effects: Sequence[EffectLike] = (),
    candidates: Sequence[Effect] = (),
    fixed: Fixed = (),
    lens: str | None = None,
    folds: int = 5,
    discovery: bool = True,
    progress: _progress.Progress = None,
) -> Diagnosis:
    """Finds effects that a camera's model lacks: fits it, tests the residuals for every known effect, adds the one that explains them, and
    so on; errors before and after are those of frames that the fits did not use. Of a dataset of several cameras, each with depth is
    examined, extrinsics that drift are tested, and all cameras are adjusted jointly again.

    ``model``, ``effects`` and ``fixed`` are what it starts from, as in :func:`calibrate`. ``candidates`` are effects of your own that are tested like
    those of the catalogue. ``verify`` is another dataset of the same camera, on which errors are reported. ``discovery=False`` searches no
    formulas for what the known effects leave.
    Raises :class:`InputError` and :class:`UntrustedFitError`.
    """
    dataset = dataset_of(dataset)
    verify = None if verify is None else dataset_of(verify, "verify")
    model_text, natives = model_in_words(model)
    texts, more = in_words(effects)
    texts += fixed_in_words(fixed)
    call = f"depthcal.diagnose(depthcal.load({dataset._native.path!r}), model={model_text!r})"
    every = natives + more + in_words(candidates)[1]
    native = _depthcal.diagnose(
        dataset._native,
        None if verify is None else verify._native,
        {"model": model_text, "with": texts, "effects": every, "lens": lens},
        {"folds": parts_of("folds", folds, dataset), "discovery": discovery},
        call,
        _progress.show(progress),
    )
    return Diagnosis(native)
