"""Fleets: what the calibrations of many cameras of one type say together."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _depthcal, _progress
from ._arguments import is_path, type_of
from ._calibration import Calibration
from ._depthcal import InputError
from ._effects import EffectLike, in_words
from ._report import Reported
from ._tables import Table


@dataclass(frozen=True)
class FleetParameter:
    """A parameter over all units."""

    name: str
    mean: float
    """What the units share."""
    mean_std_dev: float
    between_units: float
    """Standard deviation between units."""
    of_noise: float
    """Standard deviation that noise alone makes between them."""
    shared_p_value: float | None
    """Of the mean being nominal; None without a nominal value. Corrected for the number of parameters, as the next."""
    differs_p_value: float
    """Of the units being alike."""
    unit: str


@dataclass(frozen=True)
class FleetEffect:
    """An effect over all units."""

    effect: str
    shared: bool
    """Whether the type of camera has it, beyond what the effects do that were found before it."""
    size_mm: float | None
    """Root mean square over the observations of what other parameters do not compensate of the shared effect."""
    of_detectable: float | None
    """The same as a multiple of what one unit alone shows with 80 % power."""
    shared_p_value: float
    differs_p_value: float
    explained_by: str | None
    """An effect that was found before it and explains what speaks for it."""


@dataclass(frozen=True)
class FleetOutlier:
    """A unit that is unlike the others."""

    unit: str
    within: str
    """``model`` for the parameters that all units have, else an effect."""
    p_value: float
    parameters: str
    """The parameters that carry it, the most important first."""


class Fleet(Reported):
    """What ``depthcal fleet`` writes: shared effects, scatter between units, outliers, and a prior for the next unit."""

    def __init__(self, native: _depthcal.Fleet) -> None:
        self._native = native

    @property
    def record(self) -> dict[str, Any]:
        """The contents of ``fleet.json``, as ``depthcal schema fleet`` describes it."""
        return json.loads(self._native.json())

    @property
    def prior(self) -> dict[str, Any]:
        """The contents of ``prior.json``; ``calibrate(…, prior=fleet)`` takes it."""
        return json.loads(self._native.prior())

    @property
    def units(self) -> list[str]:
        """Names of the units that were joined."""
        return [unit["name"] for unit in self.record["units"]]

    @property
    def left_out(self) -> list[tuple[str, str]]:
        """(calibration, reason) of every calibration that could not be joined with the others."""
        return [(left["calibration"], left["reason"]) for left in self.record.get("left_out", [])]

    @property
    def parameters(self) -> Table[FleetParameter]:
        """The parameters that all units have."""
        rows = [
            FleetParameter(
                p["name"],
                p["mean"],
                p["mean_std_dev"],
                p["between_units"],
                p["of_noise"],
                p.get("shared_p_value"),
                p["differs_p_value"],
                p["unit"],
            )
            for p in self.record["parameters"]
        ]
        return Table(rows, "name", FleetParameter)

    @property
    def effects(self) -> Table[FleetEffect]:
        """Effects that the units lack or have, the shared ones first."""
        rows = [
            FleetEffect(
                e["effect"],
                e["shared"],
                e.get("size_mm"),
                e.get("of_detectable"),
                e["shared_p_value"],
                e["differs_p_value"],
                e.get("explained_by"),
            )
            for e in self.record["effects"]
        ]
        return Table(rows, "effect", FleetEffect)

    @property
    def outliers(self) -> Table[FleetOutlier]:
        """Units that are unlike the others, the most certain first."""
        rows = [
            FleetOutlier(o["name"], o["within"], o["p_value"], ", ".join(part["parameter"] for part in o["parts"]))
            for o in self.record["outliers"]
        ]
        return Table(rows, "unit", FleetOutlier)

    def _summary(self) -> list[Any]:
        return [self.parameters, self.outliers]

    def __repr__(self) -> str:
        return self._native.text()


#: A unit in memory, or the path of a calibration, of a folder of results, or of a folder of such folders.
Unit = Any


def _unit(name: str, given: Unit) -> tuple[str, str, str | None]:
    """Name of a unit, JSON of its calibration and of its scores."""
    calibration = given if isinstance(given, Calibration) else getattr(given, "calibration", None)
    if not isinstance(calibration, Calibration):
        raise InputError(
            f"calibrations: {name} is a {type_of(given)}: give a Fit, a Diagnosis, a Calibration or a path"
        )
    if calibration.cameras:
        raise InputError(f"calibrations: {name} is of several cameras: save it, and give the folders of one of them")
    scores = getattr(given, "scores", None)
    found = scores() if callable(scores) else None
    return name, calibration._native.json(), None if found is None else json.dumps(found)


def _units(given: Any) -> tuple[list[str], list[tuple[str, str, str | None]]]:
    """Paths, and units in memory by names that differ."""
    if isinstance(given, Mapping):
        return [], [_unit(str(name), unit) for name, unit in given.items()]
    listed = [given] if is_path(given) or not isinstance(given, Iterable) else list(given)
    paths = [os.fspath(unit) for unit in listed if is_path(unit)]
    units: list[tuple[str, str, str | None]] = []
    for unit in listed:
        if is_path(unit):
            continue
        name, calibration, scores = _unit("a unit", unit)
        name = Path(json.loads(calibration)["dataset"]["path"]).name or name
        same = sum(other.rpartition(" #")[0] == name or other == name for other, _, _ in units)
        units.append((f"{name} #{same + 1}" if same else name, calibration, scores))
    return paths, units


def fleet(
    calibrations: Unit | Sequence[Unit] | Mapping[str, Unit],
    *,
    level: float = 0.01,
    effects: Sequence[EffectLike] = (),
    progress: _progress.Progress = None,
) -> Fleet:
    """Joins the calibrations of many cameras of one type (docs/fleets.md): fits, diagnoses and calibrations in memory, by their names where a
    dictionary is given; files, folders of results, or folders of such folders.

    Effects are found that no unit alone shows, where units are fits or diagnoses, or where ``scores.json`` lies next to a calibration, as
    :meth:`Fit.save` and :meth:`Diagnosis.save` write it. ``level`` is the chance of any false finding in each family of tests; ``effects``
    are the functions of Python that models have. Of files the result is that of the command line, to the byte.
    Raises :class:`InputError`, and :class:`UntrustedFitError` where a covariance is not positive definite.
    """
    paths, units = _units(calibrations)
    words = f", level={level!r}" if level != 0.01 else ""
    named = [*paths, *(name for name, _, _ in units)]
    call = f"depthcal.fleet({(named[0] if len(named) == 1 else named)!r}{words})"
    return Fleet(_depthcal.fleet(paths, units, level, in_words(effects)[1], call, _progress.show(progress)))
