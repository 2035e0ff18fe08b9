"""Figures of results, with matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._depthcal import InputError

if TYPE_CHECKING:
    from ._calibration import Calibration
    from ._compare import ComparedModel
    from ._dataset import Dataset
    from ._diagnose import Diagnosis
    from ._evaluate import FrameErrors
    from ._tables import Table


def _axes(ax: Any, size: tuple[float, float]) -> Any:
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(figsize=size, layout="constrained")[1]


def _several(ax: Any, count: int, size: tuple[float, float]) -> list[Any]:
    """Axes for as many figures."""
    if ax is None:
        from matplotlib import pyplot

        rows = pyplot.subplots(count, 1, figsize=(size[0], size[1] * count), layout="constrained", squeeze=False)[1]
        return list(rows[:, 0])
    given = list(np.asarray(ax, dtype=object).reshape(-1))
    if len(given) != count:
        raise InputError(f"ax has {len(given)} axes: give {count}, one for each camera")
    return given


def coverage(dataset: Dataset, ax: Any = None) -> Any:
    """Markers of all frames in the image."""
    if len(dataset.cameras) > 1:
        with_images = [name for name in dataset.cameras if any(f.markers for f in dataset.camera(name).frames)]
        axes = _several(ax, len(with_images), (6, 4.5))
        return [coverage(dataset.camera(name), part) for name, part in zip(with_images, axes)]
    ax = _axes(ax, (6, 4.5))
    for frame in dataset.frames:
        _, pixels = dataset.markers(frame.name)
        ax.plot(pixels[:, 0], pixels[:, 1], ".", markersize=3)
    width, height = dataset.size
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal", xlabel="u (px)", ylabel="v (px)")
    ax.set_title(f"{dataset.name}: markers of {len(dataset)} frames")
    return ax


def errors_of_frames(frames: Table[FrameErrors], ax: Any = None) -> Any:
    """Depth errors of every frame before and after correction; reprojection errors where there is no depth. Of the datasets of several
    cameras those that are judged alike, fitted or held out, as the last."""
    datasets = list(dict.fromkeys(row.dataset for row in frames))
    judged = [name for name in datasets if name.partition(" (")[2] == datasets[-1].partition(" (")[2]]
    if len(judged) > 1:
        axes = _several(ax, len(judged), (8, 4))
        return [_errors([row for row in frames if row.dataset == name], name, part) for name, part in zip(judged, axes)]
    last = datasets[-1] if datasets else ""
    return _errors([row for row in frames if row.dataset == last], last, _axes(ax, (8, 4)))


def _errors(rows: list[FrameErrors], title: str, ax: Any) -> Any:
    places = np.arange(len(rows))
    if any(row.depth_rms_mm is not None for row in rows):
        value = lambda v: np.nan if v is None else v  # noqa: E731
        ax.bar(places - 0.2, [value(row.depth_rms_before_mm) for row in rows], 0.4, label="as measured", color="0.75")
        ax.bar(places + 0.2, [value(row.depth_rms_mm) for row in rows], 0.4, label="corrected", color="C0")
        ax.set_ylabel("depth error, rms (mm)")
        ax.legend()
    else:
        ax.bar(places, [row.reprojection_px for row in rows], 0.6, color="C0")
        ax.set_ylabel("reprojection error, rms (px)")
    ax.set_xticks(places, [row.frame for row in rows], rotation=90, fontsize=7)
    ax.set_title(title)
    return ax


def extrinsics(calibration: Calibration, ax: Any = None) -> Any:
    """The cameras of a rig in the reference's plane of x and z, with their optical axes."""
    rows = calibration.extrinsics
    if not len(rows):
        raise InputError("the calibration is of one camera, which has no extrinsics")
    ax = _axes(ax, (6, 4.5))
    placed = [np.linalg.inv(row.matrix) for row in rows]
    centres = np.array([matrix[:3, 3] for matrix in placed])
    length = max(0.5 * float(np.ptp(centres, axis=0).max()), 1.0)
    for row, matrix, centre in zip(rows, placed, centres):
        axis = centre + length * matrix[:3, 2]
        ax.annotate("", (axis[0], axis[2]), (centre[0], centre[2]), arrowprops={"arrowstyle": "->", "color": "C0"})
        ax.plot(centre[0], centre[2], "o", color="C3")
        ax.annotate(row.camera, (centre[0], centre[2]), xytext=(4, -12), textcoords="offset points")
    ax.set(xlabel="x of the reference (mm)", ylabel="z of the reference (mm)", aspect="equal")
    ax.margins(0.2)
    return ax


def correlations(calibration: Calibration, ax: Any = None) -> Any:
    """Correlations of the free parameters."""
    ax = _axes(ax, (6.5, 5.5))
    found = calibration.correlation
    if found is None:
        ax.text(0.5, 0.5, "this estimator gives no covariance", ha="center", va="center", transform=ax.transAxes)
        return ax
    image = ax.imshow(np.asarray(found), vmin=-1, vmax=1, cmap="RdBu_r")
    places = range(len(found))
    ax.set_xticks(places, found.names, rotation=90, fontsize=7)
    ax.set_yticks(places, found.names, fontsize=7)
    ax.figure.colorbar(image, ax=ax, label="correlation")
    return ax


def models(table: Table[ComparedModel], ax: Any = None) -> Any:
    """Held-out errors of models with 95 % intervals."""
    ax = _axes(ax, (7, 0.6 + 0.45 * max(len(table), 2)))
    rows = [row for row in table if row.depth_rms_mm is not None][::-1]
    for place, row in enumerate(rows):
        low, high = row.depth_rms_low_mm, row.depth_rms_high_mm
        ax.plot([low, high], [place, place], "-", color="0.4")
        ax.plot(row.depth_rms_mm, place, "o", color="C3" if row.really_worse else "C0")
    ax.set_yticks(range(len(rows)), [row.model for row in rows])
    ax.set_xlabel("held-out depth error, rms (mm), with 95 % interval")
    return ax


def steps(diagnosis: Diagnosis, ax: Any = None) -> Any:
    """Held-out depth error before the first and after every step."""
    ax = _axes(ax, (7, 4))
    rows = list(diagnosis.steps)
    declared = diagnosis.record["held_out"]["before"].get("depth_rms_mm")
    values = [declared] + [row.depth_rms_after_mm for row in rows]
    names = ["declared model"] + [f"+ {row.effect}" for row in rows]
    ax.plot(range(len(values)), [np.nan if v is None else v for v in values], "o-")
    ax.set_xticks(range(len(values)), names, rotation=20, ha="right")
    ax.set_ylim(bottom=0)
    ax.set_ylabel("held-out depth error, rms (mm)")
    ax.set_title(diagnosis.sentence, fontsize="small", wrap=True)
    return ax
