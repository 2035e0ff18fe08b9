"""Calibrated cameras."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _depthcal
from ._effects import Effect, in_words
from ._tables import Table, number

if TYPE_CHECKING:
    import pandas


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


class Calibration:
    """A calibrated camera with its uncertainty: the contents of a ``calibration.json``. From a fit, or by :meth:`load`."""

    def __init__(self, native: _depthcal.Calibration) -> None:
        self._native = native
        self._record: dict[str, Any] | None = None

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, effects: Sequence[Effect] = ()) -> Calibration:
        """Reads a ``calibration.json``. ``effects`` are the functions of Python that it names; formulas are in the file.

        Raises :class:`InputError` with the file and the field.
        """
        return cls(_depthcal.Calibration.read(os.fspath(path), in_words(effects)[1]))

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickled as its record: workers of a cluster build what they need of it. Functions of Python do not travel with it.
        return _parse, (self._native.json(),)

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
        """One camera of a rig as a calibration of its own, for :class:`Corrector` and :meth:`export`. Raises :class:`InputError`."""
        return Calibration(self._native.camera(name))

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
        """All parameters with standard deviations, in the order of the chain."""
        rows = [
            Parameter(f"{piece['name']}.{p['name']}", p["value"], p.get("std_dev"), p["unit"], p["fixed"])
            for piece in self.record["camera"]["pieces"]
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
        """The matrix of the pinhole (3, 3), px, as OpenCV has it."""
        p = {row.name: row.value for row in self.parameters if row.name.startswith("pinhole.")}
        fx, fy, cx, cy = (p[f"pinhole.{name}"] for name in ("fx", "fy", "cx", "cy"))
        skew = next((v for k, v in p.items() if k.split(".")[1] in ("skew", "s")), 0.0)
        return np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def value(self, name: str) -> float:
        """The value of a parameter, such as ``value("projective.dw")``."""
        for row in self.parameters:
            if row.name == name:
                return row.value
        raise KeyError(f"the camera has no parameter '{name}'; it has {', '.join(row.name for row in self.parameters)}")

    @property
    def covariance(self) -> pandas.DataFrame | None:
        """Covariance of the free parameters as a data frame, in products of their units; None where the estimator gives none."""
        import pandas

        found = self.record.get("covariance")
        if found is None:
            return None
        return pandas.DataFrame(found["matrix"], index=found["parameters"], columns=found["parameters"])

    @property
    def correlation(self) -> pandas.DataFrame | None:
        """The same as correlations, between −1 and 1."""
        import pandas

        covariance = self.covariance
        if covariance is None:
            return None
        values = covariance.to_numpy()
        std = np.sqrt(np.diag(values))
        with np.errstate(invalid="ignore", divide="ignore"):
            return pandas.DataFrame(values / np.outer(std, std), index=covariance.index, columns=covariance.columns)

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

    def __repr__(self) -> str:
        width, height = self.size
        fit = self.record["fit"]
        rms = fit.get("depth_rms_mm")
        depth = f", {number(rms)} mm rms of depth" if rms is not None else ""
        return f"<depthcal.Calibration {width}×{height} px, model {fit['model']}: {number(fit['reprojection_rms_px'])} px rms{depth}>"

    def _repr_html_(self) -> str:
        import html

        return f"<p>{html.escape(repr(self)[1:-1])}</p>{self.parameters._repr_html_()}"


def _parse(text: str) -> Calibration:
    return Calibration(_depthcal.Calibration.parse(text, []))
