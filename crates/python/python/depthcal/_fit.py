"""Calibration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import _depthcal, _progress
from ._calibration import Calibration
from ._dataset import Dataset
from ._effects import EffectLike, in_words, model_in_words
from ._evaluate import Judged


class Fit(Judged):
    """A dataset, fitted and judged: what ``depthcal calibrate`` writes."""

    def __init__(self, native: _depthcal.Fit) -> None:
        self._native = native
        self._calibration: Calibration | None = None

    @property
    def calibration(self) -> Calibration:
        """The calibrated camera."""
        if self._calibration is None:
            self._calibration = Calibration(self._native.calibration())
        return self._calibration

    def plot(self, ax: Any = None) -> Any:
        """Depth errors of every frame before and after correction. Returns matplotlib's axes."""
        from ._plots import errors_of_frames

        return errors_of_frames(self.frames, ax)

    def __repr__(self) -> str:
        return f"{self.calibration!r}\n{self._native.table()}"


def calibrate(
    dataset: Dataset,
    *,
    model: EffectLike | Sequence[EffectLike] = "projective",
    effects: Sequence[EffectLike] = (),
    lens: str | None = None,
    estimator: str = "joint",
    hold_out: int | tuple[int, int] | None = None,
    cross_validate: int | None = None,
    blocks: bool = False,
    progress: _progress.Progress = None,
) -> Fit:
    """Fits a depth camera to captures of a board: intrinsics, lens, depth distortion and poses, in one joint adjustment.

    ``model`` is the depth model: ``"none"``, ``"projective"``, ``"projective:xw"`` (only dx and dw free), a stack such as
    ``"projective+cyclic_depth"``, or a list with effects of your own. ``effects`` are further effects: names with constants
    (``"cyclic_depth@period_mm=300"``), paths of files of formulas, :class:`Effect`; ``"fixed:brown_conrady.k3"`` holds a parameter.
    ``lens`` is as ``--lens`` takes it: brown-conrady, opencv8, kannala-brandt, auto, …
    ``hold_out=4`` holds out every fourth frame, ``(4, 2)`` beginning with the second; ``cross_validate=3`` judges every frame by
    a fit that did not use it, in ``blocks`` of consecutive frames where asked for.
    ``progress``: True shows bars of tqdm, a function receives the events; None shows them where somebody watches.

    The result is that of the command line, to the byte. Ctrl-C ends the fit.
    Raises :class:`InputError` and :class:`UntrustedFitError`.
    """
    model_text, natives = model_in_words(model)
    texts, more = in_words(effects)
    held = (hold_out, 1) if isinstance(hold_out, int) else hold_out
    given = {
        "model": model_text if model_text != "projective" else None,
        "effects": texts or None,
        "lens": lens,
        "estimator": estimator if estimator != "joint" else None,
        "hold_out": hold_out,
        "cross_validate": cross_validate,
        "blocks": blocks or None,
    }
    words = "".join(f", {name}={value!r}" for name, value in given.items() if value is not None)
    call = f"depthcal.calibrate(depthcal.load({dataset._native.path!r}){words})"
    native = _depthcal.calibrate(
        dataset._native,
        model_text,
        texts,
        natives + more,
        lens,
        estimator,
        held,
        cross_validate,
        blocks,
        call,
        _progress.show(progress),
    )
    return Fit(native)
