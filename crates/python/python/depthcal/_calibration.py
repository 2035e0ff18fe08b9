"""Calibrated cameras."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _depthcal
from ._arguments import is_path, type_of, whole
from ._depthcal import InputError
from ._effects import Effect, in_words
from ._tables import Matrix, Table, number


@dataclass(frozen=True)
class Parameter:
    """A parameter of a camera."""

    name: str
    """``piece.parameter``, such as ``pinhole.fx``."""
    value: float
    std_dev: float | None
    """Standard deviation by noise alone; None where it was held or the estimator gives none."""
    unit: str
    fixed: bool
    """Whether it was held."""


@dataclass(frozen=True)
class Pose:
    """The pose of the board in a fitted frame: it maps board to camera coordinates."""

    frame: str
    w: float
    x: float
    y: float
    z: float
    """Rotation, a unit quaternion (w, x, y, z)."""
    tx_mm: float
    ty_mm: float
    tz_mm: float
    reprojection_rms_px: float
    depth_rms_mm: float | None


@dataclass(frozen=True)
class Extrinsics:
    """A camera of a rig: it maps points of the reference's frame to its own."""

    camera: str
    w: float
    x: float
    y: float
    z: float
    """Rotation, a unit quaternion (w, x, y, z)."""
    tx_mm: float
    ty_mm: float
    tz_mm: float
    rx_std_rad: float | None
    """Standard deviations of the rotation about the axes of the rig; None for the reference, and where they are declared."""
    ry_std_rad: float | None
    rz_std_rad: float | None
    tx_std_mm: float | None
    """Standard deviations of the translation along the axes of the camera."""
    ty_std_mm: float | None
    tz_std_mm: float | None

    @property
    def matrix(self) -> np.ndarray:
        """The matrix (4, 4) that takes points of the reference's frame to the camera's, mm."""
        w, v = self.w, np.array([self.x, self.y, self.z])
        cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        placed = np.eye(4)
        placed[:3, :3] = (w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * cross
        placed[:3, 3] = [self.tx_mm, self.ty_mm, self.tz_mm]
        return placed


class Calibration:
    """A calibrated camera with its uncertainty: the contents of a ``calibration.json``. From a fit, by :meth:`load`, or by
    :meth:`from_intrinsics`."""

    def __init__(self, native: _depthcal.Calibration) -> None:
        self._native = native
        self._record: dict[str, Any] | None = None

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        size: tuple[int, int] | None = None,
        effects: Sequence[Effect] = (),
    ) -> Calibration:
        """Reads a ``calibration.json``, the folder that it is in, or a camera file of another program (docs/lenses.md; ``FILE#NAME`` for
        one of several cameras). ``size`` (width, height) is that of the images, px, where a camera file has none. ``effects`` are the
        functions of Python that a calibration names; formulas are in the file.

        Raises :class:`InputError` with the file and the field.
        """
        return cls(_depthcal.Calibration.read(os.fspath(path), in_words(effects)[1], size))

    @classmethod
    def from_intrinsics(
        cls,
        matrix: np.ndarray | Sequence[float],
        distortion: Sequence[float] | np.ndarray = (),
        *,
        size: tuple[int, int],
        fisheye: bool = False,
    ) -> Calibration:
        """A camera whose numbers are known: a matrix (3, 3), or fx, fy, cx, cy, in px, and OpenCV's ``distortion`` coefficients (4, 5, 8,
        12 or 14 of them; with ``fisheye`` the four of ``cv2.fisheye``). ``size`` is (width, height) of its images, px.

        It has no depth model: a :class:`Corrector` of it makes points of depth as it is. Raises :class:`InputError`.
        """
        pinhole = pinhole_of(matrix)
        coefficients = _depthcal.real_numbers("distortion", distortion).reshape(-1).tolist()
        width, height = (whole("size", side, 1) for side in size)
        return cls(_depthcal.Calibration.known((width, height), pinhole, coefficients, bool(fisheye)))

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickled as its record: workers of a cluster build what they need of it. Functions of Python do not travel with it, which is
        # said here instead of in the worker.
        text = self._native.json()
        _parse(text)
        return _parse, (text,)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes a ``calibration.json``. :meth:`Fit.save` writes it with the observations that were fitted."""
        self._native.write(os.fspath(path))
        return Path(path)

    @property
    def record(self) -> dict[str, Any]:
        """Everything that the file holds, as ``depthcal schema calibration`` describes it."""
        if self._record is None:
            self._record = json.loads(self._native.json())
        return self._record

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras of a rig, the reference first; none of one camera."""
        return self._native.cameras()

    def camera(self, name: str) -> Calibration:
        """One camera of a rig as a calibration of its own, for :class:`Corrector` and :meth:`export`, with its part of the covariance and
        the poses of the board in its frame. Raises :class:`InputError`."""
        return Calibration(self._native.camera(name))

    @property
    def extrinsics(self) -> Table[Extrinsics]:
        """The cameras of a rig in the frame of its reference, with standard deviations; none of one camera."""
        rows = []
        for camera in self.record.get("cameras", []):
            placed = camera["camera_from_rig"]
            std = placed.get("std_dev") or {}
            rows.append(
                Extrinsics(
                    camera["name"],
                    *placed["rotation"],
                    *placed["translation_mm"],
                    *(std.get("rotation_rad") or [None] * 3),
                    *(std.get("translation_mm") or [None] * 3),
                )
            )
        return Table(rows, "camera", Extrinsics)

    def transform(self, source: str, target: str) -> np.ndarray:
        """The extrinsics between two cameras of a rig: the matrix (4, 4) that takes points of ``source``'s frame to ``target``'s, mm.
        Extrinsics that drift are those at the reference of their drift. Raises :class:`InputError`."""
        placed = {row.camera: row.matrix for row in self.extrinsics}
        for name in (source, target):
            if name not in placed:
                raise InputError(
                    f"the calibration has no camera '{name}'; it has {', '.join(placed) or 'one without a name'}"
                )
        return placed[target] @ np.linalg.inv(placed[source])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its images, px."""
        return self._native.size

    @property
    def unit_mm(self) -> float | None:
        """Millimetres per unit of the depth images that it was fitted to."""
        return self.record.get("depth_unit_mm")

    @property
    def parameters(self) -> Table[Parameter]:
        """All parameters with standard deviations, in the order of the chain; of a rig those of all cameras, ``infrared/pinhole.fx``."""
        cameras = [(f"{camera['name']}/", camera) for camera in self.record.get("cameras", [])]
        rows = [
            Parameter(f"{prefix}{piece['name']}.{p['name']}", p["value"], p.get("std_dev"), p["unit"], p["fixed"])
            for prefix, camera in cameras or [("", self.record["camera"])]
            for piece in camera["pieces"]
            for p in piece["parameters"]
        ]
        return Table(rows, "name", Parameter)

    @property
    def poses(self) -> Table[Pose]:
        """The poses of the board in the fitted frames."""
        rows = []
        for f in self.record["frames"]:
            (w, x, y, z), (tx, ty, tz) = f["rotation"], f["translation_mm"]
            rows.append(Pose(f["name"], w, x, y, z, tx, ty, tz, f["reprojection_rms_px"], f.get("depth_rms_mm")))
        return Table(rows, "frame", Pose)

    @property
    def matrix(self) -> np.ndarray:
        """The matrix of the pinhole (3, 3), px, as OpenCV has it; of a rig that of its reference."""
        pinhole = next(piece for piece in self.record["camera"]["pieces"] if piece["name"] == "pinhole")
        p = {parameter["name"]: parameter["value"] for parameter in pinhole["parameters"]}
        skew = next((v for k, v in p.items() if k in ("skew", "s")), 0.0)
        return np.array([[p["fx"], skew, p["cx"]], [0.0, p["fy"], p["cy"]], [0.0, 0.0, 1.0]])

    def value(self, name: str) -> float:
        """The value of a parameter, such as ``value("projective.dw")``."""
        return self.parameters[name].value

    @property
    def covariance(self) -> Matrix | None:
        """Covariance of the free parameters by name, in products of their units; None where the estimator gives none."""
        given = self.record.get("covariance")
        return None if given is None else Matrix(given["parameters"], given["matrix"])

    @property
    def correlation(self) -> Matrix | None:
        """Correlations of the free parameters by name, between −1 and 1."""
        covariance = self.covariance
        if covariance is None:
            return None
        values = np.asarray(covariance)
        std = np.sqrt(np.diag(values))
        with np.errstate(invalid="ignore", divide="ignore"):
            return Matrix(covariance.names, values / np.outer(std, std))

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points (n, 3) in mm in the camera frame; NaN where a point has none. Raises :class:`InputError`."""
        return self._native.project(points)

    def rays(self, pixels: np.ndarray, depth_mm: float = 1000.0) -> np.ndarray:
        """Directions (X/Z, Y/Z), (n, 2), of pixels (n, 2); NaN where a pixel has none. The depth matters only to lenses that
        breathe. Raises :class:`InputError`."""
        return self._native.rays(pixels, depth_mm)

    def export(self, format: str, path: str | os.PathLike[str] | None = None) -> str:
        """The camera in the format of another program, by the names of ``depthcal export --format`` (``opencv``, ``ros``, ``colmap`` …); also
        written to ``path``.

        Warns (UserWarning) of everything that the format cannot hold, with the largest error in pixels.
        """
        import warnings

        text, lost = self._native.export(format)
        for warning in lost:
            warnings.warn(warning, stacklevel=2)
        if path is not None:
            path = Path(path)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        return text

    def plot(self, ax: Any = None) -> Any:
        """Correlations of the parameters. Returns matplotlib's axes."""
        from ._plots import correlations

        return correlations(self, ax)

    def plot_extrinsics(self, ax: Any = None) -> Any:
        """The cameras of a rig from above, with the directions in which they look. Returns matplotlib's axes."""
        from ._plots import extrinsics

        return extrinsics(self, ax)

    def __repr__(self) -> str:
        width, height = self.size
        fit = self.record["fit"]
        if not self.record["frames"]:
            return f"<depthcal.Calibration {width}×{height} px, {self.record['dataset']['path']}>"
        rms = fit.get("depth_rms_mm")
        depth = f", {number(rms)} mm rms of depth" if rms is not None else ""
        return f"<depthcal.Calibration {width}×{height} px, model {fit['model']}: {number(fit['reprojection_rms_px'])} px rms{depth}>"

    def _repr_html_(self) -> str:
        import html

        return f"<p>{html.escape(repr(self)[1:-1])}</p>{self.parameters._repr_html_()}"


def pinhole_of(matrix: Any) -> tuple[float, float, float, float, float]:
    """fx, fy, cx, cy and skew of a matrix (3, 3), or of these numbers."""
    k = _depthcal.real_numbers("intrinsics", matrix)
    numbers = [k[0, 0], k[1, 1], k[0, 2], k[1, 2], k[0, 1]] if k.shape == (3, 3) else [*k.reshape(-1), 0.0][:5]
    if len(numbers) < 5:
        raise InputError("intrinsics: give fx, fy, cx, cy in px, or a matrix (3, 3)")
    fx, fy, cx, cy, skew = (float(n) for n in numbers)
    return fx, fy, cx, cy, skew


def calibration_of(given: Any) -> Calibration:
    """The calibration itself, that of a fit or of a diagnosis, or the one in a file."""
    if isinstance(given, Calibration):
        return given
    if is_path(given):
        return Calibration.load(given)
    calibration = getattr(given, "calibration", None)
    if isinstance(calibration, Calibration):
        return calibration
    raise InputError(f"calibration is a {type_of(given)}: give a Calibration, a Fit, or the path of a calibration.json")


def _parse(text: str) -> Calibration:
    return Calibration(_depthcal.Calibration.parse(text, []))


def _corrector(text: str, threads: int | None) -> _depthcal.Corrector:
    """A pickled corrector."""
    return _depthcal.Corrector(_parse(text), threads)
