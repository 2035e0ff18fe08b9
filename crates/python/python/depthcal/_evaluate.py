"""Errors of calibrations."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from . import _depthcal, _progress
from ._calibration import calibration_of
from ._dataset import Dataset, datasets_of
from ._depthcal import InputError
from ._effects import EffectLike, in_words
from ._report import Reported
from ._tables import Table


@dataclass(frozen=True)
class DatasetErrors:
    """Errors on one dataset. Those of depth are None without depth; docs/model.md defines them."""

    dataset: str
    frames: int
    reprojection_px: float | None
    """Root mean square; None of a camera without images, whose board is where the other cameras see it."""
    dot_error_before_mm: float | None
    """Mean distance in space between a marker by its depth and the board's; before correction."""
    dot_error_mm: float | None
    """The same after correction."""
    plane_error_before_mm: float | None
    plane_error_mm: float | None
    depth_rms_before_mm: float | None
    """Root mean square of depth minus the board's depth, before correction."""
    depth_rms_mm: float | None
    """The same after correction."""
    left_out_share: float | None
    """Share of the board's pixels that are no measurements of it, and are in none of these errors."""


@dataclass(frozen=True)
class FrameErrors:
    """Errors on one frame, as :class:`DatasetErrors` has them."""

    dataset: str
    frame: str
    markers: int
    depth_pixels: int
    reprojection_px: float | None
    dot_error_before_mm: float | None
    dot_error_mm: float | None
    plane_error_before_mm: float | None
    plane_error_mm: float | None
    depth_rms_before_mm: float | None
    depth_rms_mm: float | None


def _reprojection(entry: dict[str, Any]) -> float | None:
    error = entry.get("reprojection_px")
    return error and error["rms"]


def _mean(entry: dict[str, Any], name: str, when: str) -> float | None:
    both = entry.get(name)
    if both is None:
        return None
    value = both[when]
    return value["mean"] if isinstance(value, dict) else value


def _depth_errors(entry: dict[str, Any]) -> dict[str, float | None]:
    return {
        f"{kind}{suffix}_mm": _mean(entry, f"{kind}_mm", when)
        for kind in ("dot_error", "plane_error", "depth_rms")
        for suffix, when in (("_before", "before"), ("", "after"))
    }


def dataset_errors(record: dict[str, Any]) -> Table[DatasetErrors]:
    """The rows of an evaluation's record."""
    rows = [
        DatasetErrors(
            dataset=d["name"],
            frames=d["frames"],
            reprojection_px=_reprojection(d),
            left_out_share=(d.get("outliers") or {}).get("share"),
            **_depth_errors(d),
        )
        for d in record["datasets"]
    ]
    return Table(rows, "dataset", DatasetErrors)


def frame_errors(record: dict[str, Any]) -> Table[FrameErrors]:
    """The rows of its frames."""
    rows = [
        FrameErrors(
            dataset=d["name"],
            frame=f["name"],
            markers=f["markers"],
            depth_pixels=f["depth_pixels"],
            reprojection_px=_reprojection(f),
            **_depth_errors(f),
        )
        for d in record["datasets"]
        for f in d.get("frames_detail", [])
    ]
    return Table(rows, None, FrameErrors)


@dataclass(frozen=True)
class TransferError:
    """Markers seen by one camera, taken through its corrected depth into another's image, against where that camera sees them."""

    dataset: str
    source: str
    target: str
    rms_px: float | None
    rms_mm: float | None


def transfer_errors(record: dict[str, Any]) -> Table[TransferError]:
    """The errors from camera to camera of an evaluation's record."""
    rows = [
        TransferError(t["dataset"], t["from"], t["to"], t.get("rms_px"), t.get("rms_mm"))
        for t in record.get("transfer", [])
    ]
    return Table(rows, None, TransferError)


class Judged(Reported):
    """A result with the errors of its last fit."""

    @property
    def evaluation(self) -> dict[str, Any]:
        """The contents of ``evaluation.json``: errors of the last fit."""
        return json.loads(self._native.evaluation())

    @property
    def errors(self) -> Table[DatasetErrors]:
        """Errors on the fitted frames and, in a second row, on frames that were held out or cross-validated."""
        return dataset_errors(self.evaluation)

    @property
    def frames(self) -> Table[FrameErrors]:
        """Errors of every frame."""
        return frame_errors(self.evaluation)

    @property
    def transfers(self) -> Table[TransferError]:
        """Errors from camera to camera of a rig, on fitted and on held-out frames; none of one camera."""
        return transfer_errors(self.evaluation)


class Evaluation(Reported):
    """Errors of a calibration on datasets, before and after correction."""

    def __init__(self, native: _depthcal.Evaluation) -> None:
        self._native = native

    @property
    def record(self) -> dict[str, Any]:
        """The contents of ``evaluation.json``."""
        return json.loads(self._native.json())

    @property
    def datasets(self) -> Table[DatasetErrors]:
        """Errors of every dataset, of a rig of every camera with images on it."""
        return dataset_errors(self.record)

    @property
    def frames(self) -> Table[FrameErrors]:
        """Errors of every frame."""
        return frame_errors(self.record)

    @property
    def transfers(self) -> Table[TransferError]:
        """Errors from camera to camera of a rig; none of one camera."""
        return transfer_errors(self.record)

    @property
    def dropped(self) -> list[tuple[str, str, str]]:
        """(dataset, frame, reason) of every frame that could not be evaluated."""
        return self._native.dropped()

    def plot(self, ax: Any = None) -> Any:
        """Depth errors of every frame before and after correction, of several cameras in a figure for each. Returns matplotlib's axes,
        of several cameras a list of them, as ``ax`` is then."""
        from ._plots import errors_of_frames

        return errors_of_frames(self.frames, ax)

    def _summary(self) -> list[Any]:
        return [self.datasets]

    def __repr__(self) -> str:
        return self._native.table()


def evaluate(
    calibration: Any,
    datasets: Dataset | str | os.PathLike[str] | Sequence[Dataset | str | os.PathLike[str]],
    *,
    effects: Sequence[EffectLike] = (),
    progress: _progress.Progress = None,
) -> Evaluation:
    """Measures a calibration's errors on datasets, before and after correction. ``calibration`` is a :class:`Calibration`, a fit, a diagnosis,
    or the path of a ``calibration.json``; datasets may be their folders.

    Poses are estimated from the images alone, with camera and lens of the calibration fixed. The cameras of a rig are found by their names,
    and errors from camera to camera are measured too. ``effects`` are files of formulas with
    values, which the camera is given in addition.
    Raises :class:`InputError` where images have another size than the calibration's, or a dataset has none of its cameras.
    """
    calibration = calibration_of(calibration)
    listed = datasets_of(datasets, "datasets")
    if not listed:
        raise InputError("datasets is empty: give at least one")
    texts = [os.fspath(text) if not isinstance(text, str) else text for text in in_words(effects)[0]]
    names = ", ".join(dataset.name for dataset in listed)
    call = f"depthcal.evaluate(calibration, [{names}])"
    natives = [dataset._native for dataset in listed]
    show = _progress.show(progress)
    return Evaluation(_depthcal.evaluate(calibration._native, natives, texts, "a calibration", call, show))
