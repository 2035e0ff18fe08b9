"""Calibration."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Optional, Union

from . import _depthcal, _progress
from ._arguments import whole
from ._calibration import Calibration
from ._dataset import Dataset, dataset_of
from ._depthcal import InputError
from ._effects import EffectLike, in_words, model_in_words
from ._evaluate import Judged
from ._fleet import Fleet
from ._pickled import PickledFit

Prior = Union[Fleet, str, "os.PathLike[str]", Mapping[str, Any], None]
"""What other units say of a camera: a fleet, the path of a ``prior.json``, or its contents. Of a rig a dictionary of these, by the names
of its cameras."""


Fixed = Union[str, Sequence[str], Mapping[str, Optional[float]]]
"""Parameters that are held: names, ``"brown_conrady.k3"``, of one camera of several ``"colour:brown_conrady.k3"``; or values by name, None for
the declared or nominal one."""


class Fitted(Judged):
    """What a fit gives."""

    def __init__(self, native: Any) -> None:
        self._native = native
        self._calibration: Calibration | None = None

    @property
    def calibration(self) -> Calibration:
        """The calibrated camera; of a rig all cameras, of which ``calibration.camera(name)`` is one."""
        if self._calibration is None:
            self._calibration = Calibration(self._native.calibration())
        return self._calibration


def arguments_in_words(**given: Any) -> str:
    """Arguments of a call as they are written, those that are None left out."""
    return "".join(f", {name}={value!r}" for name, value in given.items() if value is not None)


class Fit(Fitted):
    """A dataset, fitted and judged: what ``depthcal calibrate`` writes."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _of_state, PickledFit.of(self._native).state()

    @property
    def prior_use(self) -> list[str]:
        """What the prior of a fleet did to the fit, in sentences; none without a prior."""
        return self._native.prior_sentences()

    def next_captures(
        self,
        goal: str = "",
        *,
        range_mm: tuple[float, float] | None = None,
        within: float | None = None,
        frames: int = 3,
        camera: str | None = None,
    ) -> dict[str, Any]:
        """Which captures to add: the poses of the board that lower an uncertainty most, and how many such frames are enough, as
        ``depthcal next --json`` gives them (docs/next.md).

        ``goal`` is ``"depth"``, ``"projection"`` or a parameter, ``"pinhole.fx"``; by default that of corrected depth over the
        distances that were seen, or over ``range_mm``. ``within`` is the error that is small enough, mm, px or in the parameter's unit.
        ``frames_needed`` of the result is None where more frames do not get there; poses in ``capture_next`` have a quaternion (w, x, y,
        z) and mm, and map the board to the camera, of a rig to its reference.
        Raises :class:`InputError`.
        """
        return json.loads(self._native.next_captures(goal, range_mm, within, frames, camera))

    def scores(self, camera: str | None = None) -> dict[str, Any] | None:
        """The contents of ``scores.json``: scores of every effect that the model lacks, from which :func:`fleet` finds what no unit alone
        shows. None where no effect can be scored: without depth, with fields. ``camera`` is one of a rig's."""
        text = self._native.scores(camera)
        return None if text is None else json.loads(text)

    def plot(self, ax: Any = None) -> Any:
        """Depth errors of every frame before and after correction, of several cameras in a figure for each. Returns matplotlib's axes,
        of several cameras a list of them, as ``ax`` is then."""
        from ._plots import errors_of_frames

        return errors_of_frames(self.frames, ax)

    def _summary(self) -> list[Any]:
        return [self.calibration.parameters]

    def __repr__(self) -> str:
        return f"{self.calibration!r}\n{self._native.table()}"


def _of_state(*state: Any) -> Fit:
    """A pickled fit."""
    return Fit(PickledFit(*state))


def fixed_in_words(fixed: Fixed) -> list[str]:
    """Parameters that are held, as effects name them."""
    if isinstance(fixed, str):
        fixed = [fixed]
    if isinstance(fixed, Mapping):
        return [f"fixed:{name}" + ("" if value is None else f"={float(value)!r}") for name, value in fixed.items()]
    return [f"fixed:{name}" for name in fixed]


def parts_of(name: str, given: Any, dataset: Dataset) -> int:
    """A number of parts that a dataset's frames can be divided into."""
    parts, frames = whole(name, given, 2), len({row.name for row in dataset.frames})
    if parts > frames:
        raise InputError(f"{name} is {parts}, but {dataset.name} has {frames} frames: give at most as many parts")
    return parts


def _held_out(given: Any) -> tuple[int, int] | None:
    """Period and first of the frames that are held out."""
    if given is None:
        return None
    if isinstance(given, (tuple, list)) and len(given) == 2:
        return whole("hold_out", given[0], 2), whole("hold_out", given[1], 1)
    return whole("hold_out", given, 2), 1


def calibrate(
    dataset: Dataset | str | os.PathLike[str],
    *,
    model: EffectLike | Sequence[EffectLike] = "projective",
    effects: Sequence[EffectLike] = (),
    fixed: Fixed = (),
    lens: str | None = None,
    estimator: str = "joint",
    hold_out: int | tuple[int, int] | None = None,
    cross_validate: int | None = None,
    blocks: bool = False,
    prior: Prior = None,
    progress: _progress.Progress = None,
) -> Fit:
    """Fits a depth camera to captures of a board: intrinsics, lens, depth distortion and poses, in one joint adjustment; of a dataset of
    several cameras all of them, with their extrinsics. ``dataset`` may be the folder of one.

    ``model`` is the depth model: ``"none"``, ``"projective"``, ``"projective:xw"`` (only dx and dw free), a stack such as
    ``"projective+cyclic_depth"``, or a list with effects of your own. ``effects`` are further effects: names with constants
    (``"cyclic_depth@period_mm=300"``), paths of files of formulas, :class:`Effect`. ``fixed`` are parameters that are held:
    ``fixed=["brown_conrady.k3"]`` at their declared or nominal values, ``fixed={"pinhole.fx": 580.0}`` at given ones. Effects and fixed
    parameters of one camera of several begin with its name and a colon, ``"infrared:cyclic_depth"`` or ``"colour:brown_conrady.k3"``.
    ``lens`` is as ``--lens`` takes it: brown-conrady, opencv8, kannala-brandt, auto, …
    ``hold_out=4`` holds out every fourth frame, ``(4, 2)`` beginning with the second; ``cross_validate=3`` judges every frame by
    a fit that did not use it, in ``blocks`` of consecutive frames where asked for.
    ``prior`` is what a fleet says of its next unit (:func:`fleet`, docs/fleets.md); of a rig ``{"infrared": …}``, by camera.
    ``progress``: True shows bars of tqdm, a function receives the events; None shows them where somebody watches.

    The result is that of the command line, to the byte. Ctrl-C ends the fit.
    Raises :class:`InputError` and :class:`UntrustedFitError`.
    """
    dataset = dataset_of(dataset)
    model_text, natives = model_in_words(model)
    texts, more = in_words(effects)
    texts += fixed_in_words(fixed)
    held = _held_out(hold_out)
    cross_validate = None if cross_validate is None else parts_of("cross_validate", cross_validate, dataset)
    words = arguments_in_words(
        model=model_text if model_text != "projective" else None,
        effects=texts or None,
        lens=lens,
        estimator=estimator if estimator != "joint" else None,
        hold_out=held,
        cross_validate=cross_validate,
        blocks=blocks or None,
        prior=None if prior is None else os.fspath(prior) if isinstance(prior, (str, os.PathLike)) else "…",
    )
    call = f"depthcal.calibrate(depthcal.load({dataset._native.path!r}){words})"
    native = _depthcal.calibrate(
        dataset._native,
        {"model": model_text, "with": texts, "effects": natives + more, "lens": lens},
        {
            "estimator": estimator,
            "hold_out": held,
            "cross_validate": cross_validate,
            "blocks": blocks,
            "priors": _priors_in_words(prior),
        },
        call,
        _progress.show(progress),
    )
    return Fit(native)


def _priors_in_words(prior: Prior) -> list[tuple[str | None, str, str]]:
    """Camera, name and JSON of every prior."""
    if prior is None:
        return []
    if isinstance(prior, Mapping) and "covariance" not in prior:
        return [(camera, *_prior_in_words(of_camera)) for camera, of_camera in prior.items()]
    return [(None, *_prior_in_words(prior))]


def _prior_in_words(prior: Fleet | str | os.PathLike[str] | Mapping[str, Any]) -> tuple[str, str]:
    """Name and JSON of a prior."""
    if isinstance(prior, Fleet):
        return "prior", prior._native.prior()
    if isinstance(prior, (str, os.PathLike)):
        path = os.fspath(prior)
        try:
            return path, Path(path).read_text(encoding="utf-8")
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    return "prior", json.dumps(prior)
