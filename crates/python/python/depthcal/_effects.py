"""Effects of your own: a line of mathematics, or a numpy function."""

from __future__ import annotations

import functools
import inspect
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np

from . import _depthcal
from ._depthcal import InputError
from ._warnings import DepthcalWarning, warn

#: Usual ranges of the covariates, at which functions are checked: images of 640×480, a field of view of 65°, 0.4 m to 4 m.
_RANGES = {
    "x": (-0.64, 0.64),
    "y": (-0.48, 0.48),
    "u": (0.0, 639.0),
    "v": (0.0, 479.0),
    "z": (400.0, 4000.0),
    "incidence": (0.0, 1.0),
    "amplitude": (50.0, 5000.0),
    "surroundings": (50.0, 5000.0),
    "timestamp_s": (0.0, 2000.0),
    "temperature_c": (15.0, 45.0),
}
#: Covariates that a function may take, in the order of docs/formulas.md.
COVARIATES = (
    "x", "y", "r", "u", "v", "z", "rho", "range", "incidence", "amplitude", "surroundings", "timestamp_s", "temperature_c",
)  # fmt: skip
_PROBES = 200
_STEP = 6e-6
_SECOND_STEP = 1e-3
#: Relative difference of two derivatives that is still agreement, for the median probe.
_AGREEMENT = 1e-2
#: The same of a step that is a little longer: it has the same curvature, but less rounding. Double precision stays below a millionth.
_LONGER_STEP = 4 * _STEP
_ROUNDING = 1e-3
#: Jump of a slope, relative to its root mean square along a line, that is a kink; lines on which kinks are sought for each variable; places
#: of a line that are looked at closely, and how often: intervals of 1e-7 of the line are the smallest, far above rounding.
_KINK = 0.02
_LINES = 3
_PLACES = 8
_CLOSER = 4
#: Size of an effect whose parameters have their typical deviation: about a millimetre at a metre.
_TYPICAL = {"depth": 1.0, "inverse_depth": 1e-6, "factor": 1e-3}


class EffectWarning(DepthcalWarning):
    """Something about an effect that may be meant, but is unusual."""


@dataclass(frozen=True)
class EffectCost:
    """What a function has cost so far."""

    calls: int
    """Calls of the function."""
    points: int
    """Points of all calls."""
    seconds: float
    """Seconds within the function and its conversion, over all threads."""


class Effect:
    """An effect of depth, pixel, lens or board that the camera model may lack.

    Made by :meth:`formula`, :func:`effect` (a numpy function) or :func:`read_effects`. It is given to :func:`calibrate`,
    :func:`compare`, :func:`diagnose` in ``effects``, or as a part of the depth model (``model=["projective", my_effect]``).
    """

    def __init__(self, native: _depthcal.Effect, function: Callable[..., Any] | None = None) -> None:
        self._native = native
        self._function = function

    @classmethod
    def formula(
        cls,
        formula: str | Sequence[str],
        *,
        name: str,
        parameters: Mapping[str, str | Mapping[str, Any]],
        constants: Mapping[str, float | Mapping[str, Any]] | None = None,
        hook: str = "depth",
        adds_to: str | None = None,
        of: str = "true",
        summary: str = "",
        source: str = "",
    ) -> Effect:
        """An effect given as a line of mathematics, as in a file of formulas (docs/formulas.md).

        Differentiated exactly, checked for units, kept whole in ``calibration.json``, and as fast as a piece in Rust.

        >>> row_gain = depthcal.Effect.formula(
        ...     "a * y * log(rho / rho0)", name="row_gain", adds_to="inverse_depth",
        ...     parameters={"a": "1/mm"}, constants={"rho0": 0.00125})

        ``parameters`` are units by name, or tables with ``unit``, ``nominal``, ``scale``, ``value``, ``meaning``.
        Raises :class:`InputError` with the place in the formula.
        """
        definition: dict[str, Any] = {
            "name": name,
            "hook": hook,
            "formula": formula if isinstance(formula, str) else list(formula),
            "parameters": {key: value if isinstance(value, str) else dict(value) for key, value in parameters.items()},
            "of": of,
            "summary": summary,
            "source": source,
        }
        if constants:
            definition["constants"] = {k: dict(v) if isinstance(v, Mapping) else float(v) for k, v in constants.items()}
        if adds_to is not None:
            definition["adds_to"] = adds_to
        return cls(_depthcal.Effect.formula(json.dumps(definition)))

    @property
    def name(self) -> str:
        """Its name in models, files and reports."""
        return self._native.name

    @property
    def spec(self) -> str:
        """How models name it: its name, with its place where that is not its own."""
        return self._native.spec

    @property
    def is_formula(self) -> bool:
        """Whether it is a formula. ``calibration.json`` holds formulas whole; of a function it holds the name and the parameters."""
        return self._native.is_formula

    @property
    def equation(self) -> str:
        """The equation of a formula, as text."""
        return self._native.equation

    @property
    def parameters(self) -> dict[str, str]:
        """Units of the parameters by name."""
        return {name: unit for name, unit, _, _ in self._native.parameters}

    @property
    def scales(self) -> dict[str, float]:
        """Typical deviations of the parameters from their nominal values, in their units."""
        return {name: scale for name, _, _, scale in self._native.parameters}

    @property
    def cost(self) -> EffectCost:
        """What the function has cost so far; zeros for a formula."""
        return EffectCost(*self._native.cost)

    def to_toml(self) -> str:
        """A file of formulas with this effect, for ``--with FILE.toml``. Raises :class:`InputError` for a function."""
        return self._native.toml()

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """The function itself."""
        if self._function is None:
            raise TypeError(f"effect '{self.name}' is a formula: {self.equation}")
        return self._function(*arguments, **named)

    def __repr__(self) -> str:
        what = self.equation if self.is_formula else "a function of Python"
        parameters = ", ".join(f"{name} in {unit}" for name, unit in self.parameters.items())
        return f"<depthcal.Effect {self.spec}: {what}; {parameters}>"

    def _repr_latex_(self) -> str | None:
        return f"${self._native.latex}$" if self.is_formula else None


EffectLike = Union[str, "os.PathLike[str]", Effect]


def effect(
    *,
    parameters: Mapping[str, str | tuple[str, float]],
    adds_to: str = "depth",
    of: str = "true",
    name: str | None = None,
    nominal: Mapping[str, float] | None = None,
    source: str = "a function of Python",
) -> Callable[[Callable[..., Any]], Effect]:
    """Makes an effect of depth of a numpy function.

    Arguments of the function that are named like covariates are arrays (n,) of float64: ``x, y, r`` (direction of the ray), ``u, v``
    (px), ``z, range`` (mm), ``rho`` (1/mm), ``incidence`` (1/cos − 1), ``amplitude, surroundings`` (steps), ``timestamp_s`` (s),
    ``temperature_c`` (°C). The others are its parameters, floats; ``parameters`` has the unit of each, or (unit, typical deviation).
    The function returns an array (n,): mm for ``adds_to="depth"``, 1/mm for ``"inverse_depth"``, a share for ``"factor"``.
    At the nominal values of its parameters (0, or as in ``nominal``) it must be zero. Each value must depend on its own
    point alone. ``of`` is the depth from which covariates are taken, ``"true"`` or ``"measured"``.

    >>> @depthcal.effect(parameters={"a": "mm", "b": "mm"}, adds_to="depth")
    ... def signal_delay(u, v, z, range, a, b):
    ...     return (a * (u - 320) / 640 + b * (v - 240) / 480) * z / range

    The function is differentiated by central differences, which are checked here against those of another step. It is called in batches
    of some dozens of points, by one thread at a time, 1 + 2 · (parameters) times for every linearisation. :attr:`Effect.cost` counts calls and seconds. Write a formula where the effect is one (:meth:`Effect.formula`).

    Raises :class:`InputError` where the function is not zero at nominal parameters, gives something else than finite numbers, lets points
    depend on each other, or is too rough to be differentiated (single precision, tables without interpolation). Warns of kinks, :class:`EffectWarning`.
    """

    def make(function: Callable[..., Any]) -> Effect:
        own = name or function.__name__
        arguments = list(inspect.signature(function).parameters)
        covariates = [argument for argument in arguments if argument in COVARIATES]
        names = [argument for argument in arguments if argument not in COVARIATES]
        if set(names) != set(parameters):
            raise InputError(
                f"effect '{own}': its parameters are {', '.join(names) or 'none'}, but units are given for "
                f"{', '.join(parameters) or 'none'}; arguments must be covariates ({', '.join(COVARIATES)}) or have a unit"
            )
        if not covariates or not names:
            raise InputError(f"effect '{own}': a function needs at least one covariate and one parameter")
        if adds_to not in _TYPICAL:
            raise InputError(f"effect '{own}': adds_to is '{adds_to}': give depth, inverse_depth or factor")

        def call(theta: Sequence[float], columns: Sequence[np.ndarray]) -> np.ndarray:
            values = function(**dict(zip(covariates, columns)), **dict(zip(names, theta)))
            values = _depthcal.real_numbers(f"effect '{own}': the function's result", values)
            shape = columns[0].shape
            if values.shape != shape:
                values = np.broadcast_to(values, shape)
            return np.ascontiguousarray(values)

        start = np.array([(nominal or {}).get(argument, 0.0) for argument in names])
        given = [None if isinstance(parameters[n], str) else float(parameters[n][1]) for n in names]
        scales = _checked(own, call, covariates, names, start, given, adds_to)
        units = [parameters[n] if isinstance(parameters[n], str) else parameters[n][0] for n in names]
        table = [(n, str(unit), float(zero), scale, "") for n, unit, zero, scale in zip(names, units, start, scales)]
        summary = (inspect.getdoc(function) or f"{own}, a function of Python").splitlines()[0].rstrip(".")
        native = _depthcal.Effect.function(own, call, covariates, table, adds_to, of, summary, source)
        return Effect(native, function)

    return make


def read_effects(path: str | os.PathLike[str]) -> list[Effect]:
    """The effects of a file of formulas (docs/formulas.md). Raises :class:`InputError` with line and column."""
    return [Effect(native) for native in _depthcal.Effect.read(os.fspath(path))]


def _columns(covariates: Sequence[str], states: dict[str, np.ndarray]) -> list[np.ndarray]:
    slant = np.hypot(np.hypot(states["x"], states["y"]), 1.0)
    derived = {
        "r": np.hypot(states["x"], states["y"]),
        "rho": 1.0 / states["z"],
        "range": slant * states["z"],
    }
    return [np.ascontiguousarray(derived[c] if c in derived else states[c]) for c in covariates]


def _checked(
    name: str,
    call: Callable[[Sequence[float], Sequence[np.ndarray]], np.ndarray],
    covariates: Sequence[str],
    names: Sequence[str],
    start: np.ndarray,
    given: Sequence[float | None],
    adds_to: str,
) -> list[float]:
    """Checks a function at usual points; returns the typical deviations of its parameters."""
    random = np.random.default_rng(1)
    states = {key: random.uniform(low, high, _PROBES) for key, (low, high) in _RANGES.items()}
    states["z"] = 1.0 / random.uniform(1.0 / 4000.0, 1.0 / 400.0, _PROBES)

    def at(theta: np.ndarray, states: dict[str, np.ndarray] = states) -> np.ndarray:
        values = call(tuple(float(t) for t in theta), _columns(covariates, states))
        bad = ~np.isfinite(values)
        if bad.any():
            i = int(np.argmax(bad))
            place = ", ".join(f"{c} = {v[i]:.4g}" for c, v in zip(covariates, _columns(covariates, states)))
            parameters = ", ".join(f"{n} = {t:.4g}" for n, t in zip(names, theta))
            raise InputError(
                f"effect '{name}': the function gives {values[i]} at {place} with {parameters}: give finite numbers"
            )
        return values

    scales = []
    for k, scale in enumerate(given):
        if scale is not None:
            if not (np.isfinite(scale) and scale > 0):
                raise InputError(
                    f"effect '{name}': the typical deviation of '{names[k]}' is {scale}: give a positive number"
                )
            scales.append(scale)
            continue
        size, deviation = _TYPICAL[adds_to], _TYPICAL[adds_to]
        for _ in range(40):
            moved = start.copy()
            moved[k] += deviation
            with np.errstate(all="ignore"):
                rms = float(np.sqrt(np.mean(at(moved) ** 2)))
            if rms == 0.0 or not np.isfinite(rms):
                raise InputError(
                    f"effect '{name}': '{names[k]}' alone changes nothing: give its typical deviation, "
                    f"parameters={{'{names[k]}': (unit, deviation)}}"
                )
            if 0.5 < rms / size < 2.0:
                break
            deviation *= size / rms
        scales.append(float(deviation))
    largest = float(np.max(np.abs(at(start))))
    if largest > 1e-9 * _TYPICAL[adds_to]:
        raise InputError(
            f"effect '{name}': the function is {largest:.3g} where its parameters are nominal; it must be zero there, so that a camera "
            "without the effect is a case of the model"
        )
    theta = start + np.array(scales) * random.uniform(0.5, 1.5, len(scales)) * random.choice([-1.0, 1.0], len(scales))
    values = at(theta)
    some = {key: value[3:10] for key, value in states.items()}
    if not np.allclose(at(theta, some), values[3:10], rtol=1e-9, atol=1e-12 * _TYPICAL[adds_to]):
        raise InputError(
            f"effect '{name}': a value depends on the other points of a call: compute each from its own covariates"
        )
    _check_derivatives(name, at, states, theta, scales, covariates, names)
    return scales


def _check_derivatives(
    name: str,
    at: Callable[..., np.ndarray],
    states: dict[str, np.ndarray],
    theta: np.ndarray,
    scales: Sequence[float],
    covariates: Sequence[str],
    names: Sequence[str],
) -> None:
    """Compares the differences that fits use with those of a larger step."""
    varied = [
        c for c in ("x", "y", "z", "incidence") if c in covariates or (c in ("x", "y", "z") and _uses(covariates, c))
    ]

    def by_state(key: str, step: float) -> np.ndarray:
        size = states["z"] if key == "z" else np.ones(_PROBES)
        up = {**states, key: states[key] + step * size}
        down = {**states, key: states[key] - step * size}
        return (at(theta, up) - at(theta, down)) / (2 * step)

    def by_parameter(k: int, step: float) -> np.ndarray:
        move = np.zeros(len(theta))
        move[k] = step * max(scales[k], abs(theta[k]))
        return (at(theta + move) - at(theta - move)) / (2 * step)

    checks = [(key, lambda step, key=key: by_state(key, step)) for key in varied]
    checks += [(names[k], lambda step, k=k: by_parameter(k, step)) for k in range(len(names))]
    for what, derivative in checks:
        fine, longer, coarse = (derivative(step) for step in (_STEP, _LONGER_STEP, _SECOND_STEP))
        # Derivatives of a millionth of the values themselves are rounding.
        typical = 1e-6 * float(np.sqrt(np.mean(at(theta) ** 2)))
        size = max(float(np.sqrt(np.mean(coarse**2))), float(np.sqrt(np.mean(fine**2))), typical)
        if size == 0.0:
            continue
        for step, other, limit in ((_LONGER_STEP, longer, _ROUNDING), (_SECOND_STEP, coarse, _AGREEMENT)):
            apart = np.abs(fine - other) / size
            if np.median(apart) > limit:
                i = int(np.argsort(apart)[len(apart) // 2])
                raise InputError(
                    f"effect '{name}': its derivative by '{what}' is {fine[i]:.6g} over a step of {_STEP:g} and {other[i]:.6g} over one of "
                    f"{step:g}: the function is too rough to be differentiated; compute in float64, and interpolate tables smoothly"
                )
        if np.mean(apart > _AGREEMENT) > 0.05:
            _warn(
                f"effect '{name}': its derivative by '{what}' depends on the step at {np.mean(apart > _AGREEMENT):.0%} of usual points: "
                "a kink or a fast wave; standard deviations may be wrong"
            )
            continue
        for line in _lines(what, at, states, theta, scales, names):
            kink = _kink(*line)
            if kink is not None:
                place, before, after = kink
                _warn(
                    f"effect '{name}': its derivative by '{what}' jumps from {before:.3g} to {after:.3g} at {what} = {place:.6g}: a kink; "
                    "standard deviations may be wrong"
                )
                break


def _warn(text: str) -> None:
    warn(text, EffectWarning)


#: Values of a function at places along a line, and the ends of the line.
_Line = tuple[Callable[[np.ndarray], np.ndarray], float, float]


def _lines(
    what: str,
    at: Callable[..., np.ndarray],
    states: dict[str, np.ndarray],
    theta: np.ndarray,
    scales: Sequence[float],
    names: Sequence[str],
) -> list[_Line]:
    """Lines along one number of the state, or along a parameter, with all else as at some of the usual points."""
    if what in names:
        k = names.index(what)

        def by_parameter(values: np.ndarray) -> np.ndarray:
            moved = theta.copy()
            answers = []
            for value in values:
                moved[k] = value
                answers.append(at(moved)[0])
            return np.array(answers)

        reach = 2 * scales[k]
        return [(by_parameter, theta[k] - reach, theta[k] + reach)]

    def by_state(probe: int, values: np.ndarray) -> np.ndarray:
        line = {key: np.full(len(values), column[probe]) for key, column in states.items()}
        return at(theta, {**line, what: values})

    low, high = _RANGES[what]
    return [(functools.partial(by_state, probe), low, high) for probe in range(_LINES)]


def _kink(along: Callable[[np.ndarray], np.ndarray], low: float, high: float) -> tuple[float, float, float] | None:
    """Where a function of one number has a kink, with the slopes before and after it: where its slope still jumps over intervals so
    short that those of a smooth function do not."""
    places = np.linspace(low, high, _PROBES)[None, :]
    size = None
    for _ in range(1 + _CLOSER):
        values = along(places.ravel()).reshape(places.shape)
        slopes = np.diff(values, axis=1) / np.diff(places, axis=1)
        if size is None:
            size = max(float(np.sqrt(np.mean(slopes**2))), 1e-9 * float(np.max(np.abs(values))) / (high - low))
        jumps = np.abs(np.diff(slopes, axis=1))
        if size == 0.0 or jumps.max() <= _KINK * size:
            return None
        if places.shape[0] == 1:
            found = [(0, i) for i in np.argsort(jumps[0])[::-1][:_PLACES]]
        else:
            found = list(enumerate(np.argmax(jumps, axis=1)))
        row, i = max(found, key=lambda at: jumps[at])
        answer = (float(places[row, i + 1]), float(slopes[row, i]), float(slopes[row, i + 1]))
        places = np.stack([np.linspace(places[r, k], places[r, k + 2], _PROBES // _PLACES) for r, k in found])
    return answer


def _uses(covariates: Sequence[str], key: str) -> bool:
    derived = {"x": ("r", "range"), "y": ("r", "range"), "z": ("rho", "range")}
    return any(c in covariates for c in derived[key])


def in_words(effects: Sequence[EffectLike]) -> tuple[list[str], list[_depthcal.Effect]]:
    """Texts of a list of effects, and the effects that these texts name."""
    if isinstance(effects, (str, os.PathLike, Effect)):
        effects = [effects]
    texts, natives = [], []
    for item in effects:
        if isinstance(item, Effect):
            texts.append(item.spec)
            natives.append(item._native)
        else:
            texts.append(os.fspath(item))
    return texts, natives


def model_in_words(model: EffectLike | Sequence[EffectLike]) -> tuple[str, list[_depthcal.Effect]]:
    """Text of a depth model, and the effects that it names."""
    texts, natives = in_words([model] if isinstance(model, (str, os.PathLike, Effect)) else model)
    return "+".join(texts), natives
