"""Rigs: several cameras on one body."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _depthcal, _progress
from ._calibration import Calibration
from ._diagnose import Diagnosis
from ._effects import Effect, EffectLike, in_words, model_in_words
from ._evaluate import DatasetErrors, Evaluation, dataset_errors
from ._fit import Fitted, arguments_in_words
from ._tables import Table


@dataclass(frozen=True)
class RigFrame:
    """A frame of one camera of a rig. Frames of several cameras with one name were taken together."""

    camera: str
    frame: str
    markers: int
    has_depth: bool


@dataclass(frozen=True)
class TransferError:
    """Markers seen by one camera, taken through its corrected depth into another's image, against where that camera sees them."""

    dataset: str
    source: str
    target: str
    rms_px: float | None
    rms_mm: float | None


class Rig:
    """A dataset of several cameras with its markers. From :func:`load_rig`."""

    def __init__(self, native: _depthcal.Rig) -> None:
        self._native = native

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self._native.name

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras; the first is the reference, whose frame is the rig's."""
        return self._native.cameras()

    @property
    def frames(self) -> Table[RigFrame]:
        """The frames of every camera that are used."""
        return Table([RigFrame(*row) for row in self._native.frames()], None, RigFrame)

    @property
    def dropped(self) -> list[tuple[str, str, str]]:
        """(camera, frame, reason) of every frame that is not used."""
        return self._native.dropped()

    def __repr__(self) -> str:
        frames = {row.frame for row in self.frames}
        return f"<depthcal.Rig {self.name}: {len(frames)} frames of {', '.join(self.cameras)}>"


def _transfers(record: dict[str, Any]) -> Table[TransferError]:
    rows = [
        TransferError(t["dataset"], t["from"], t["to"], t.get("rms_px"), t.get("rms_mm"))
        for t in record.get("transfer", [])
    ]
    return Table(rows, None, TransferError)


class RigFit(Fitted):
    """A rig, fitted and judged: what ``depthcal calibrate`` writes of a dataset of several cameras."""

    @property
    def transfers(self) -> Table[TransferError]:
        """Errors from camera to camera, on fitted and on held-out frames."""
        return _transfers(self.evaluation)

    def __repr__(self) -> str:
        return self._native.table()


class RigEvaluation(Evaluation):
    """Errors of a rig on datasets: of every camera, and from camera to camera."""

    _native: Any

    def __init__(self, native: _depthcal.RigEvaluation) -> None:
        self._native = native

    @property
    def datasets(self) -> Table[DatasetErrors]:
        """Errors of every camera with images on every dataset."""
        return dataset_errors(self.record)

    @property
    def transfers(self) -> Table[TransferError]:
        """Errors from camera to camera."""
        return _transfers(self.record)


class RigDiagnosis(Fitted):
    """What the models of a rig's cameras lack: what ``depthcal diagnose`` writes of a dataset of several cameras."""

    @property
    def record(self) -> dict[str, Any]:
        """The contents of ``diagnosis.json``."""
        return json.loads(self._native.json())

    @property
    def verdict(self) -> str:
        """The worst of the cameras' verdicts: ``adequate``, ``effect`` or ``unexplained``."""
        return self.record["verdict"]

    @property
    def cameras(self) -> dict[str, Diagnosis]:
        """The own diagnosis of every camera with depth, by its name."""
        return {name: Diagnosis(native) for name, native in self._native.own()}

    @property
    def transfers(self) -> Table[TransferError]:
        """Errors from camera to camera with what was added, on fitted and on held-out frames."""
        return _transfers(self.evaluation)

    def __repr__(self) -> str:
        told = [f"[{name}] {diagnosis.sentence}" for name, diagnosis in self.cameras.items()]
        return "\n".join([*told, "held-out frames, with what was added:", self._native.table()])


def load_rig(
    path: str | os.PathLike[str],
    *,
    cache: bool = True,
    refresh: bool = False,
    image_memory_mib: int = 1024,
    progress: _progress.Progress = None,
) -> Rig:
    """Reads a dataset of several cameras: a folder whose ``dataset.toml`` has sections ``[cameras.NAME]`` (docs/rigs.md).

    Arguments are those of :func:`load`. Raises :class:`InputError` with the camera, the file, what is wrong and the remedy.
    """
    return Rig(_depthcal.load_rig(os.fspath(path), cache, refresh, image_memory_mib, _progress.show(progress)))


def calibrate_rig(
    rig: Rig,
    *,
    model: EffectLike | Sequence[EffectLike] = "projective",
    effects: Sequence[EffectLike] = (),
    lens: str | None = None,
    hold_out: int | tuple[int, int] | None = None,
    progress: _progress.Progress = None,
) -> RigFit:
    """Fits all cameras of a rig and their places in one joint adjustment.

    Arguments are those of :func:`calibrate`; effects and held parameters of one camera begin with its name and a colon,
    ``"infrared:cyclic_depth"`` or ``"fixed:colour:brown_conrady.k3"``. The result is that of the command line, to the byte.
    Raises :class:`InputError` and :class:`UntrustedFitError`.
    """
    model_text, natives = model_in_words(model)
    texts, more = in_words(effects)
    held = (hold_out, 1) if isinstance(hold_out, int) else hold_out
    words = arguments_in_words(
        model=model_text if model_text != "projective" else None,
        effects=texts or None,
        lens=lens,
        hold_out=hold_out,
    )
    call = f"depthcal.calibrate_rig(depthcal.load_rig({rig._native.path!r}){words})"
    show = _progress.show(progress)
    return RigFit(_depthcal.calibrate_rig(rig._native, model_text, texts, natives + more, lens, held, call, show))


def evaluate_rig(
    calibration: Calibration, rigs: Rig | Sequence[Rig], *, progress: _progress.Progress = None
) -> RigEvaluation:
    """Measures a rig's errors on datasets: of every camera before and after correction, and from camera to camera.

    Cameras are found by their names. Raises :class:`InputError` where a dataset has none of them, or images of another size.
    """
    listed = [rigs] if isinstance(rigs, Rig) else list(rigs)
    call = f"depthcal.evaluate_rig(calibration, [{', '.join(rig.name for rig in listed)}])"
    natives = [rig._native for rig in listed]
    show = _progress.show(progress)
    return RigEvaluation(_depthcal.evaluate_rigs(calibration._native, natives, "a calibration", call, show))


def diagnose_rig(
    rig: Rig,
    *,
    verify: Rig | None = None,
    model: EffectLike | Sequence[EffectLike] = "projective",
    effects: Sequence[EffectLike] = (),
    candidates: Sequence[Effect] = (),
    lens: str | None = None,
    folds: int = 5,
    discovery: bool = True,
    progress: _progress.Progress = None,
) -> RigDiagnosis:
    """Finds what the models of a rig's cameras lack: the search of :func:`diagnose` on every camera with depth, tests of places that drift,
    and the joint adjustment of all cameras with what was added.

    Arguments are those of :func:`diagnose`; effects and held parameters of one camera begin with its name and a colon. The result is
    that of the command line, to the byte. Raises :class:`InputError` and :class:`UntrustedFitError`.
    """
    model_text, natives = model_in_words(model)
    texts, more = in_words(effects)
    words = arguments_in_words(
        model=model_text if model_text != "projective" else None, effects=texts or None, lens=lens
    )
    native = _depthcal.diagnose_rigs(
        rig._native,
        None if verify is None else verify._native,
        model_text,
        texts,
        natives + more + in_words(candidates)[1],
        lens,
        folds,
        discovery,
        f"depthcal.diagnose_rig(depthcal.load_rig({rig._native.path!r}){words})",
        _progress.show(progress),
    )
    return RigDiagnosis(native)


@dataclass(frozen=True)
class Registered:
    """A frame of depth in another camera's image."""

    depth: np.ndarray
    """Corrected depth (height, width) of the other camera's image, of the type and unit of the given depth; 0 where there is
    none."""
    colours: np.ndarray | None
    """Colours (height, width, 3) of the pixels of depth, uint8; black where there is none, or where another surface hides the point."""
    holes: int
    """Number of pixels of :attr:`depth` without depth."""


class Registration:
    """Takes the corrected depth of one camera of a rig into the image of another, as ``depthcal apply --register`` does.

    >>> onto_colour = depthcal.Registration(fit.calibration, "infrared", "colour")
    >>> registered = onto_colour(depth, unit_mm=1.0, image=rgb)
    """

    def __init__(self, calibration: Calibration, source: str, target: str) -> None:
        self._native = _depthcal.Registration(calibration._native, source, target)
        self.source = source
        """The camera with depth."""
        self.target = target
        """The camera in whose image depth is resampled, and whose colours the pixels of depth get."""

    def __call__(
        self,
        depth: np.ndarray,
        unit_mm: float = 1.0,
        *,
        image: np.ndarray | None = None,
        amplitude: np.ndarray | None = None,
        time_s: float | None = None,
        temperature_c: float | None = None,
        timestamp_s: float | None = None,
    ) -> Registered:
        """Registers a frame. ``depth`` (height, width) is as measured, uint16 or float32 in units of ``unit_mm`` millimetres, as
        :meth:`Corrector.correct` takes it; so is the result. ``image`` is the target's image (height, width, 3), RGB, uint8.
        ``time_s`` is since the start of the recording, for effects; ``timestamp_s`` as in the dataset, for a place that changes
        with time. Raises :class:`InputError`."""
        return Registered(*self._native.register(depth, unit_mm, image, amplitude, time_s, temperature_c, timestamp_s))
