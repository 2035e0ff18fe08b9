"""Datasets: folders of captures, or arrays in memory."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np

from . import _depthcal, _progress
from ._arguments import is_path, type_of
from ._calibration import pinhole_of
from ._depthcal import InputError
from ._tables import Table

Corners = Union[np.ndarray, "tuple[np.ndarray, np.ndarray]", "tuple[np.ndarray, np.ndarray, np.ndarray]", None]
"""Markers of one frame; see :class:`Frame`."""


@dataclass(frozen=True)
class Board:
    """A printed board. Lengths in mm.

    Marker ``i`` lies in row ``i // columns`` and column ``i % columns``, as OpenCV's functions return markers.
    """

    kind: str
    """``asymmetric-circles``, ``symmetric-circles``, ``chessboard``, ``charuco`` or ``aprilgrid``."""
    columns: int
    """Markers in a row; squares for ChArUco, tags for an AprilGrid."""
    rows: int
    """Rows of them."""
    spacing_mm: float
    """Spacing of the grid; for asymmetric circles the distance of neighbouring rows."""
    circle_diameter_mm: float = 0.0
    """Diameter of a dot; 0 where it is not known."""
    marker_mm: float = 0.0
    """Side of an ArUco marker or tag."""
    dictionary: str = ""
    """OpenCV's name of the ArUco dictionary."""

    @classmethod
    def chessboard(cls, columns: int, rows: int, spacing_mm: float) -> Board:
        """A chessboard of ``columns`` × ``rows`` inner corners, as ``cv2.findChessboardCorners`` counts."""
        return cls("chessboard", columns, rows, spacing_mm)

    @classmethod
    def asymmetric_circles(cls, columns: int, rows: int, spacing_mm: float, diameter_mm: float = 0.0) -> Board:
        """Dots whose odd rows are shifted, as ``cv2.findCirclesGrid`` with CALIB_CB_ASYMMETRIC_GRID finds them."""
        return cls("asymmetric-circles", columns, rows, spacing_mm, circle_diameter_mm=diameter_mm)

    @classmethod
    def symmetric_circles(cls, columns: int, rows: int, spacing_mm: float, diameter_mm: float = 0.0) -> Board:
        """Dots on a square grid."""
        return cls("symmetric-circles", columns, rows, spacing_mm, circle_diameter_mm=diameter_mm)

    @classmethod
    def charuco(cls, columns: int, rows: int, spacing_mm: float, marker_mm: float, dictionary: str) -> Board:
        """A ChArUco board of ``columns`` × ``rows`` squares. Markers are its inner corners with OpenCV's ids."""
        return cls("charuco", columns, rows, spacing_mm, marker_mm=marker_mm, dictionary=dictionary)

    @classmethod
    def aprilgrid(cls, columns: int, rows: int, spacing_mm: float, marker_mm: float) -> Board:
        """An AprilGrid of ``columns`` × ``rows`` tags of ``marker_mm``, at distances of ``spacing_mm``."""
        return cls("aprilgrid", columns, rows, spacing_mm, marker_mm=marker_mm)

    def save(self, path: str | os.PathLike[str], *, paper: str | None = None) -> list[Path]:
        """Writes the board to print, to scale and with a ruler, as ``depthcal board`` does: a file .pdf or .svg, and the section
        ``[board]`` of a dataset.toml beside it. ``paper`` is a0 … a5, letter, legal, tabloid, or width x height in mm; without it the
        smallest of A4 … A0 that holds the board. Returns the paths. Raises :class:`InputError`."""
        return [Path(written) for written in _depthcal.write_board(self._json(), os.fspath(path), paper)[3]]

    def _json(self) -> str:
        fields: dict[str, Any] = {
            "kind": self.kind,
            "columns": self.columns,
            "rows": self.rows,
            "spacing_mm": self.spacing_mm,
        }
        if self.circle_diameter_mm:
            fields["circle_diameter_mm"] = self.circle_diameter_mm
        if self.kind in ("charuco", "aprilgrid"):
            fields["marker_mm"] = self.marker_mm
        if self.kind == "charuco":
            fields["dictionary"] = self.dictionary
        return json.dumps(fields)

    @classmethod
    def _of(cls, fields: Mapping[str, Any]) -> Board:
        return cls(**fields)


@dataclass
class Frame:
    """One capture in memory."""

    corners: Corners
    """Markers that were found: an array (n, 2) or, as OpenCV has it, (n, 1, 2), of (u, v) in px, all markers of the board in its
    order; or (ids, array) where only some were found; or (ids, array, standard deviations in px). Real numbers of any type, ids
    whole ones. None where the board was not found."""
    depth: Optional[np.ndarray] = None
    """Depth image (height, width) in units of the dataset's ``unit_mm`` millimetres: uint16 in whole steps, 0 and 65535 where
    nothing was measured, or float32, 0, NaN and infinity where nothing was."""
    image: Optional[np.ndarray] = None
    """Infrared or grey image (height, width) on the same pixel grid: uint8 or uint16. Effects of the amplitude need it."""
    name: Optional[str] = None
    """Its name; its number where there is none."""
    timestamp_s: Optional[float] = None
    """Time of the capture, s."""
    temperature_c: Optional[float] = None
    """Temperature of the camera, °C."""


@dataclass(frozen=True)
class FrameInfo:
    """What is known of a frame that is used."""

    name: str
    markers: int
    has_depth: bool
    time_s: float
    """Time since the first frame, s."""
    temperature_c: float
    """°C; NaN where unknown."""
    camera: str
    """The camera; ``camera`` where the dataset names none. Frames of several cameras with one name were taken together."""

    @property
    def frame(self) -> str:
        """Its name."""
        return self.name


@dataclass(frozen=True)
class DroppedFrame:
    """A frame that is not used."""

    name: str
    reason: str
    camera: str


def _arrays(frame: str, corners: Corners) -> _depthcal.Markers:
    """Numbers, positions and standard deviations of markers, as they are given."""
    if not isinstance(corners, tuple):
        return None if corners is None else (None, corners, None)
    if len(corners) not in (2, 3):
        raise InputError(
            f"frame '{frame}': corners have {len(corners)} parts: give (ids, array) or (ids, array, deviations)"
        )
    parts: tuple[Any, ...] = corners
    ids, pixels, *deviations = parts
    return ids, pixels, deviations[0] if deviations else None


class Dataset:
    """Captures of a board by one camera, or by several on one body, with the markers of every frame. Made by :func:`load` or
    :meth:`from_arrays`. Of several cameras, :meth:`camera` is one, and has size, unit, markers and images."""

    def __init__(self, native: _depthcal.Dataset) -> None:
        self._native = native

    @classmethod
    def from_arrays(
        cls,
        board: Board,
        frames: Iterable[Frame],
        *,
        unit_mm: float | None = None,
        size: tuple[int, int] | None = None,
        intrinsics: tuple[float, ...] | np.ndarray | None = None,
        distortion: Sequence[float] | np.ndarray = (),
        lens: str | None = None,
        fixed: bool = False,
        name: str = "arrays",
    ) -> Dataset:
        """A dataset from arrays and markers, for example those of OpenCV.

        >>> found, corners = cv2.findChessboardCorners(gray, (9, 6))
        >>> frames.append(depthcal.Frame(corners if found else None, depth, gray))
        >>> dataset = depthcal.Dataset.from_arrays(depthcal.Board.chessboard(9, 6, 25.0), frames, unit_mm=1.0)

        ``unit_mm`` is the millimetres per unit of depth: per step of uint16, per unit of float32 (1000 for metres); it is
        required where there is depth, never guessed. Arrays may have any strides and byte order. ``size`` is (width, height)
        where there is no image. ``intrinsics`` are fx, fy, cx, cy (px) or a matrix (3, 3) to start from, or to keep where
        ``fixed``; ``distortion`` as OpenCV has it. Markers may lie the other way round in other frames (OpenCV's chessboards
        do); effects of the board's shape then find nothing. Raises :class:`InputError` with the frame, what is wrong and the
        remedy.
        """
        listed = []
        for number, frame in enumerate(frames):
            named = frame.name if frame.name is not None else f"{number:04d}"
            markers = _arrays(named, frame.corners)
            listed.append((named, frame.image, frame.depth, markers, frame.timestamp_s, frame.temperature_c))
            for array in (frame.image, frame.depth):
                shape = getattr(array, "shape", ())
                if size is None and len(shape) == 2:
                    size = (int(shape[1]), int(shape[0]))
        if size is None:
            raise InputError("the size of the images is unknown: give size=(width, height), an image or a depth image")
        given = None
        if intrinsics is not None:
            coefficients = _depthcal.real_numbers("distortion", distortion).reshape(-1).tolist()
            given = (*pinhole_of(intrinsics), coefficients)
        camera = {"size": size, "unit_mm": unit_mm, "intrinsics": given, "lens": lens, "fixed": fixed}
        return cls(_depthcal.from_memory(name, board._json(), camera, listed))

    @classmethod
    def from_cameras(
        cls,
        cameras: Mapping[str, Dataset],
        *,
        extrinsics: Mapping[str, np.ndarray] | None = None,
        name: str = "arrays",
    ) -> Dataset:
        """A dataset of several cameras on one body from a dataset of each, the first of which is the reference. Frames with one name
        were taken together.

        >>> rig = depthcal.Dataset.from_cameras({"infrared": infrared, "colour": colour})

        ``extrinsics`` are those that are known, which no fit changes: a matrix (4, 4) or (3, 4) by the name of a camera, which takes points
        of the reference's frame to the camera's, mm. Raises :class:`InputError`.
        """
        known = dict(extrinsics or {})
        listed = []
        for camera, dataset in cameras.items():
            if not isinstance(dataset, Dataset):
                raise InputError(f"camera '{camera}' is a {type_of(dataset)}: give a Dataset of each camera")
            listed.append((camera, dataset._native, _rows(camera, known.pop(camera, None))))
        if known:
            raise InputError(f"extrinsics are given for {', '.join(known)}, but the cameras are {', '.join(cameras)}")
        return cls(_depthcal.from_cameras(name, listed))

    def __reduce__(self) -> tuple[Any, ...]:
        # All that a fit reads travels with it, images included: the folder that it came from may not be where it goes.
        return _of_state, self._native.state()

    @property
    def name(self) -> str:
        """Name of its folder, or as it was given."""
        return self._native.name

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras; the first is the reference, whose frame is the rig's. One camera without a name is ``camera``."""
        return self._native.cameras()

    def camera(self, name: str) -> Dataset:
        """One camera as a dataset of its own. Raises :class:`InputError` where there is none of that name."""
        return Dataset(self._native.camera(name))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its images, px."""
        return self._native.size

    @property
    def unit_mm(self) -> float | None:
        """Millimetres per unit of its depth images; None without depth."""
        return self._native.unit_mm

    @property
    def digest(self) -> str:
        """Digest of its contents (BLAKE3), the same wherever the folder lies."""
        return self._native.digest

    @property
    def from_cache(self) -> bool:
        """Whether its markers came from the cache of detections."""
        return self._native.from_cache

    @property
    def board(self) -> Board:
        """Its board."""
        return Board._of(json.loads(self._native.board))

    @property
    def frames(self) -> Table[FrameInfo]:
        """The frames that are used: with a board, or with depth of a camera without images."""
        return Table([FrameInfo(*row) for row in self._native.frames()], "name", FrameInfo)

    @property
    def dropped(self) -> Table[DroppedFrame]:
        """The frames that are not used, with reasons."""
        return Table([DroppedFrame(*row) for row in self._native.dropped()], "name", DroppedFrame)

    def markers(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (n,) and positions (n, 2) in px of a frame's markers."""
        return self._native.markers(frame)

    def image(self, frame: str) -> np.ndarray | None:
        """A frame's image (height, width), uint16."""
        return self._native.image(frame)

    def depth(self, frame: str) -> np.ndarray | None:
        """A frame's depth image (height, width), in units of ``unit_mm`` millimetres: uint16 or float32, as it was given."""
        return self._native.depth(frame)

    def write_observations(self, path: str | os.PathLike[str]) -> None:
        """Writes ``observations.json``: the markers of every frame."""
        self._native.write_observations(os.fspath(path))

    def __len__(self) -> int:
        return len(self._native.frames())

    def __repr__(self) -> str:
        if len(self.cameras) > 1:
            frames = {row.name for row in self.frames}
            return f"<depthcal.Dataset {self.name}: {len(frames)} frames of {', '.join(self.cameras)}>"
        width, height = self.size
        dropped = len(self._native.dropped())
        return (
            f"<depthcal.Dataset {self.name}: {len(self)} frames with a board, {dropped} without, {width}×{height} px>"
        )

    def plot(self, ax: Any = None) -> Any:
        """Where the markers of all frames lie in the image, of several cameras in a figure for each. Returns matplotlib's axes, of
        several cameras a list of them, as ``ax`` is then."""
        from ._plots import coverage

        return coverage(self, ax)


def _of_state(text: str, arrays: list[np.ndarray]) -> Dataset:
    """A pickled dataset."""
    return Dataset(_depthcal.Dataset.of_state(text, arrays))


def _rows(camera: str, given: Any) -> list[float] | None:
    """The rows of (R | t) of extrinsics."""
    if given is None:
        return None
    matrix = _depthcal.real_numbers(f"extrinsics of '{camera}'", given)
    if matrix.shape not in ((3, 4), (4, 4)):
        raise InputError(f"extrinsics of '{camera}' have the shape {matrix.shape}: give a matrix (4, 4) or (3, 4)")
    r = matrix[:3, :3]
    if not np.allclose(r @ r.T, np.eye(3), atol=1e-3) or np.linalg.det(r) < 0:
        raise InputError(f"extrinsics of '{camera}': the first three columns are no rotation")
    return matrix[:3].reshape(-1).tolist()


def dataset_of(given: Any, name: str = "dataset") -> Dataset:
    """The dataset itself, or the one in a folder."""
    if isinstance(given, Dataset):
        return given
    if is_path(given):
        return load(given)
    raise InputError(
        f"{name} is a {type_of(given)}: give a Dataset, as depthcal.load and Dataset.from_arrays make it, or the folder of one"
    )


def datasets_of(given: Any, name: str) -> list[Dataset]:
    """A dataset or a folder, or several of them."""
    return [dataset_of(one, name) for one in ([given] if isinstance(given, Dataset) or is_path(given) else given)]


def load(
    path: str | os.PathLike[str],
    *,
    corners: Mapping[str, Corners] | None = None,
    cache: bool = True,
    refresh: bool = False,
    image_memory_mib: int = 1024,
    progress: _progress.Progress = None,
) -> Dataset:
    """Reads the dataset in a folder with a ``dataset.toml`` (docs/formats.md), of one camera or of several (docs/rigs.md).

    ``corners`` are markers that another program found in the images of one camera, by the names of frames, as :class:`Frame` has them. Without them the board is looked
    for (without OpenCV; ``depthcal.has_detection`` tells whether this package was built with detection), or its markers are taken from the
    cache of an earlier call or of ``depthcal detect``. ``image_memory_mib`` limits the images that stay in memory.
    Raises :class:`InputError` with the file, of several cameras with the camera, what is wrong and the remedy.
    """
    given = None if corners is None else [(name, _arrays(name, found)) for name, found in corners.items()]
    native = _depthcal.load(os.fspath(path), given, cache, refresh, image_memory_mib, _progress.show(progress))
    return Dataset(native)
