"""Nonlinear least squares with residual functions on numpy arrays.

Minimises ½ Σ ρ(‖r(x)‖²) over variables on manifolds: vectors, rotations, poses and directions. A residual function is called once for all
residuals of its kind, with arrays that have a row for each, and so costs what numpy costs, not what a Python call per residual would.
Normal equations, elimination, sparse factorisation and damping are those of depthcal's solver, in Rust.

>>> from depthcal import solver
>>> problem = solver.Problem()
>>> line = problem.vectors([[0.0, 0.0]], name="line")
>>> problem.add(lambda line, x, y: line[:, 0] + line[:, 1] * x - y, line, data=(x, y), sigma=0.1, loss=solver.Huber(3.0))
>>> solution = problem.solve()
>>> solution[line], solution.standard_deviations(line)
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _depthcal
from ._arguments import type_of, whole
from ._depthcal import InputError
from ._warnings import warn

__all__ = ["Barron", "Cauchy", "GemanMcClure", "Huber", "Problem", "Solution", "Tukey", "Variables"]

#: Step of central differences relative to the size of a number: the cube root of the rounding error.
_STEP = 6e-6

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Huber:
    """Quadratic up to ``delta``, linear beyond it. Deltas and scales are in standard deviations."""

    delta: float = 1.0


@dataclass(frozen=True)
class Cauchy:
    """Grows with the logarithm of the residual."""

    scale: float = 1.0


@dataclass(frozen=True)
class Tukey:
    """Constant beyond ``scale``: residuals that far away have no influence."""

    scale: float = 1.0


@dataclass(frozen=True)
class GemanMcClure:
    """Bounded; its influence falls with the fourth power."""

    scale: float = 1.0


@dataclass(frozen=True)
class Barron:
    """Barron's general loss: quadratic for ``alpha`` 2, Cauchy's for 0, Geman–McClure's for −2."""

    alpha: float = 1.0
    scale: float = 1.0


Loss = Union[Huber, Cauchy, Tukey, GemanMcClure, Barron, None]


def _loss(loss: Loss) -> tuple[str, float, float]:
    """Name, scale and shape of a loss."""
    if loss is None:
        return "trivial", 1.0, 0.0
    if isinstance(loss, Huber):
        return "huber", float(loss.delta), 0.0
    if isinstance(loss, Barron):
        return "barron", float(loss.scale), float(loss.alpha)
    names: dict[type, str] = {Cauchy: "cauchy", Tukey: "tukey", GemanMcClure: "geman-mcclure"}
    if type(loss) not in names:
        raise InputError(f"loss is a {type_of(loss)}: give Huber, Cauchy, Tukey, GemanMcClure, Barron or None")
    return names[type(loss)], float(loss.scale), 0.0


class Variables:
    """Variables of one kind: rows of an array. Made by :meth:`Problem.vectors` and its sisters; refers to them in residuals and results."""

    def __init__(self, number: int, name: str, kind: str, start: Array, scale: Array) -> None:
        self._number, self._kind, self._scale = number, kind, scale
        self.name = name
        """How messages call them."""
        self.start = start
        """Their start values, a row for each."""

    @property
    def dim(self) -> int:
        """Number of components of a step: of the tangent space."""
        return {"vector": self.start.shape[1], "rotation": 3, "pose": 6, "direction": 2}[self._kind]

    def __len__(self) -> int:
        return len(self.start)

    def __repr__(self) -> str:
        return f"<{len(self)} variables '{self.name}', {self._kind}s of {self.start.shape[1]} numbers>"


def _rotated(q: Array, omega: Array) -> Array:
    """Quaternions (n, 4), w first, times Exp(ω)."""
    angle = np.linalg.norm(omega, axis=1, keepdims=True)
    v = omega * (0.5 * np.sinc(angle / (2 * np.pi)))
    w = np.cos(0.5 * angle)[:, 0]
    qw, qv = q[:, 0], q[:, 1:]
    rotated = np.empty_like(q)
    rotated[:, 0] = qw * w - np.einsum("ij,ij->i", qv, v)
    rotated[:, 1:] = qw[:, None] * v + w[:, None] * qv + np.cross(qv, v)
    return rotated


def _tangents(n: Array) -> tuple[Array, Array]:
    """An orthonormal basis (n, 3), (n, 3) of the tangent planes of directions, that of the solver (Duff and others 2017)."""
    x, y, z = n.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    return first, np.stack([b, sign + y * y * a, -y], axis=1)


def _retracted(kind: str, states: Array, component: int, step: Array) -> Array:
    """States moved by a step along a component of their tangent spaces."""
    if kind == "vector":
        moved = states.copy()
        moved[:, component] += step
        return moved
    if kind == "direction":
        tangent = _tangents(states)[component]
        return states * np.cos(step)[:, None] + tangent * np.sin(step)[:, None]
    moved = states.copy()
    if component >= 3:
        moved[:, 4 + component - 3] += step
        return moved
    omega = np.zeros((len(states), 3))
    omega[:, component] = step
    moved[:, :4] = _rotated(states[:, :4], omega)
    return moved


class _Residuals:
    """Residuals of one kind, as the native module calls them: with all variables of every family, and whether derivatives are wanted."""

    def __init__(
        self,
        name: str,
        function: Callable[..., Any],
        jacobian: Callable[..., Any] | None,
        variables: Sequence[Variables],
        indices: npt.NDArray[np.int64],
        data: Sequence[Any],
    ) -> None:
        self.name, self.function, self.jacobian = name, function, jacobian
        self.variables, self.indices, self.data = variables, indices, data
        self.whiten: Callable[[Array], Array] = lambda values: values
        self.rows = 1

    def __call__(self, states: Sequence[Array], with_jacobian: bool) -> tuple[Array, Array | None]:
        gathered = [array[self.indices[:, i]] for i, array in enumerate(states)]
        residuals = self.whiten(self.values(gathered))
        return residuals, self.derivatives(gathered) if with_jacobian else None

    def values(self, gathered: Sequence[Array]) -> Array:
        """Residuals (n, rows) before whitening."""
        given = _depthcal.real_numbers(f"residuals '{self.name}': the result", self.function(*gathered, *self.data))
        count = len(self.indices)
        values = given.reshape(count, -1) if given.ndim == 1 and given.size == count else given
        if values.ndim != 2 or len(values) != count or values.shape[1] == 0:
            raise InputError(
                f"residuals '{self.name}': the function gives an array of the shape {given.shape}: give a row of numbers for each of the "
                f"{count} residuals"
            )
        return values

    def derivatives(self, gathered: Sequence[Array]) -> Array:
        """Whitened derivatives (n, rows, tangent components of all variables)."""
        if self.jacobian is not None:
            given = self.jacobian(*gathered, *self.data)
            parts = [given] if len(self.variables) == 1 and not isinstance(given, (tuple, list)) else list(given)
            if len(parts) != len(self.variables):
                raise InputError(
                    f"residuals '{self.name}': the jacobian gives {len(parts)} arrays: give one for each kind of variables"
                )
            columns = []
            for variables, part in zip(self.variables, parts):
                array = _depthcal.real_numbers(f"residuals '{self.name}': the jacobian", part)
                shape = (len(self.indices), self.rows, variables.dim)
                if array.size != np.prod(shape):
                    raise InputError(
                        f"residuals '{self.name}': the jacobian by '{variables.name}' has the shape {array.shape}, not {shape}"
                    )
                columns.append(array.reshape(shape))
            whitened = [[self.whiten(part[:, :, k]) for k in range(part.shape[2])] for part in columns]
            return np.stack([column for part in whitened for column in part], axis=2)
        columns = []
        for place, variables in enumerate(self.variables):
            states = gathered[place]
            for component in range(variables.dim):
                if variables._kind == "vector":
                    size = np.maximum(np.abs(states[:, component]), variables._scale[component])
                elif variables._kind == "pose" and component >= 3:
                    size = np.maximum(np.abs(states[:, 4 + component - 3]), variables._scale[component])
                else:
                    size = np.ones(len(states))
                step = _STEP * size
                ends = []
                for sign in (1.0, -1.0):
                    moved = list(gathered)
                    moved[place] = _retracted(variables._kind, states, component, sign * step)
                    ends.append(self.values(moved))
                columns.append(self.whiten((ends[0] - ends[1]) / (2 * step)[:, None]))
        return np.stack(columns, axis=2)


class Problem:
    """Variables, and residuals about them."""

    def __init__(self) -> None:
        self._families: list[Variables] = []
        self._batches: list[tuple[_Residuals, Loss]] = []
        self._fixed: list[tuple[tuple[int, int], list[bool] | None]] = []
        self._bounds: list[tuple[tuple[int, int], int, float, float]] = []

    def _add(self, kind: str, start: Any, size: int | None, name: str | None, scale: Any) -> Variables:
        number = len(self._families)
        called = name or f"{kind}s {number}"
        array = np.atleast_2d(_depthcal.real_numbers(f"variables '{called}'", start))
        if array.ndim != 2 or not len(array) or (size is not None and array.shape[1] != size):
            columns = "components" if size is None else size
            raise InputError(
                f"variables '{called}' have the shape {np.shape(start)}: give an array (variables, {columns})"
            )
        dim = array.shape[1] if kind == "vector" else 6
        scales = np.broadcast_to(_depthcal.real_numbers("scale", scale), (dim,))
        if not (np.isfinite(scales).all() and (scales > 0).all()):
            raise InputError("scale: give numbers above 0, the sizes of deviations that matter")
        variables = Variables(number, called, kind, array.copy(), scales)
        self._families.append(variables)
        return variables

    def vectors(self, start: npt.ArrayLike, *, name: str | None = None, scale: npt.ArrayLike = 1.0) -> Variables:
        """Vectors, rows of an array (n, components). ``scale`` is the size of numbers near zero, one or one per component: numerical
        derivatives step by a share of the number or of ``scale``, whichever is larger."""
        return self._add("vector", start, None, name, scale)

    def rotations(self, start: npt.ArrayLike, *, name: str | None = None) -> Variables:
        """Rotations, unit quaternions (n, 4), w first. A step ω turns them to q · Exp(ω)."""
        return self._add("rotation", start, 4, name, 1.0)

    def poses(self, start: npt.ArrayLike, *, name: str | None = None, scale: float = 1.0) -> Variables:
        """Poses (n, 7): a unit quaternion, w first, and a translation. A step (ω, τ) takes them to (q · Exp(ω), t + τ); ``scale`` is that
        of translations."""
        return self._add("pose", start, 7, name, scale)

    def directions(self, start: npt.ArrayLike, *, name: str | None = None) -> Variables:
        """Unit vectors (n, 3)."""
        return self._add("direction", start, 3, name, 1.0)

    def add(
        self,
        function: Callable[..., Any],
        variables: Variables | Sequence[Variables],
        *,
        indices: Any = None,
        data: Any = (),
        sigma: npt.ArrayLike | None = None,
        covariance: npt.ArrayLike | None = None,
        loss: Loss = None,
        jacobian: Callable[..., Any] | None = None,
        name: str | None = None,
    ) -> None:
        """Adds n residuals of one kind.

        ``function(*states, *data)`` gets for each of ``variables`` an array with n rows, the numbers of the variable of every residual, and
        the arrays of ``data``; it returns (n,) or (n, rows). Row i must depend on row i of the states alone. ``indices`` says of which
        variable a residual is: (n,) for one kind, (n, kinds) or a list of arrays for several; without it variables of one row are those of
        all residuals, others are taken one by one.

        ``sigma`` is the standard deviation of the residuals: a number, one per row of a residual, or (n, rows); ``covariance`` a matrix
        (rows, rows) or (n, rows, rows). ``loss`` acts on the whitened residual as a whole. ``jacobian(*states, *data)`` returns an array
        (n, rows, components) for each kind of variables, by the components of a step; without it derivatives are central differences, two
        calls of the function for each component.

        An exception of the function is raised by :meth:`solve`. Raises :class:`InputError`.
        """
        members = [variables] if isinstance(variables, Variables) else list(variables)
        called = name or str(getattr(function, "__name__", "function"))
        for member in members:
            if not isinstance(member, Variables) or member not in self._families:
                raise InputError(
                    f"residuals '{called}': variables are of this problem, made by vectors, poses, rotations or directions"
                )
        _loss(loss)
        parts = tuple(data) if isinstance(data, (tuple, list)) else (data,)
        places = _indices(called, members, indices, parts)
        residuals = _Residuals(called, function, jacobian, members, places, parts)
        start = residuals.values([member.start[places[:, i]] for i, member in enumerate(members)])
        residuals.rows = start.shape[1]
        residuals.whiten = _whitening(called, start.shape, sigma, covariance)
        self._batches.append((residuals, loss))

    def fix(self, variables: Variables, places: Any = None, *, components: Sequence[int] | None = None) -> None:
        """Holds variables, all of them or those at ``places``, wholly or some ``components`` of their steps."""
        mask = None
        if components is not None:
            mask = [component in list(components) for component in range(variables.dim)]
            if any(not 0 <= component < variables.dim for component in components):
                raise InputError(f"components: '{variables.name}' has components 0 to {variables.dim - 1}")
        for place in range(len(variables)) if places is None else np.atleast_1d(places):
            self._fixed.append(((variables._number, self._place(variables, place)), mask))

    def bound(
        self, variables: Variables, component: int, low: float = -np.inf, high: float = np.inf, places: Any = None
    ) -> None:
        """Keeps a component of vectors within bounds."""
        if variables._kind != "vector":
            raise InputError(f"bounds are for vectors, '{variables.name}' has {variables._kind}s")
        if not 0 <= component < variables.dim:
            raise InputError(f"component: '{variables.name}' has components 0 to {variables.dim - 1}")
        for place in range(len(variables)) if places is None else np.atleast_1d(places):
            self._bounds.append(
                ((variables._number, self._place(variables, place)), component, float(low), float(high))
            )

    @staticmethod
    def _place(variables: Variables, place: Any) -> int:
        place = whole("places", place, 0)
        if place >= len(variables):
            raise InputError(f"places: '{variables.name}' has {len(variables)} variables, counted from 0")
        return place

    def solve(
        self,
        *,
        max_iterations: int = 100,
        gradient_tolerance: float = 1e-10,
        cost_tolerance: float = 1e-9,
        parameter_tolerance: float = 1e-9,
        method: str = "levenberg-marquardt",
        linear_solver: str = "auto",
    ) -> Solution:
        """Minimises from the start values. ``method`` is levenberg-marquardt, dog-leg or gauss-newton (damped where a step fails);
        ``linear_solver`` is auto (by estimated work), dense, sparse-cholesky, dense-schur, sparse-schur or sparse-qr.

        Ctrl-C ends it. Warns where it has not converged, with the reason. Raises :class:`InputError`, and the exceptions of residual
        functions.
        """
        if not self._batches:
            raise InputError("the problem has no residuals: add some")
        families = [(family.name, family._kind, family.start) for family in self._families]
        batches = [
            {
                "name": residuals.name,
                "rows": residuals.rows,
                "families": [member._number for member in residuals.variables],
                "indices": residuals.indices,
                "loss": _loss(loss),
                "function": residuals,
            }
            for residuals, loss in self._batches
        ]
        options = {
            "max_iterations": whole("max_iterations", max_iterations, 0),
            "gradient_tolerance": float(gradient_tolerance),
            "cost_tolerance": float(cost_tolerance),
            "parameter_tolerance": float(parameter_tolerance),
            "method": method,
            "linear_solver": linear_solver,
        }
        solution = Solution(_depthcal.solve(families, batches, self._fixed, self._bounds, options), self._families)
        if not solution.converged:
            warn(solution.message)
        return solution


def _indices(name: str, members: Sequence[Variables], given: Any, data: Sequence[Any]) -> npt.NDArray[np.int64]:
    """The place of every residual's variables, (n, kinds)."""
    if given is None:
        columns: list[Any] = [None] * len(members)
    elif isinstance(given, (list, tuple)) and len(members) > 1:
        columns = list(given)
    else:
        array = np.asarray(given)
        columns = [array] if array.ndim == 1 else list(array.T)
    if len(columns) != len(members):
        raise InputError(
            f"residuals '{name}': indices has {len(columns)} columns: give one for each kind of variables, {len(members)}"
        )
    lengths = [len(column) for column in columns if column is not None]
    lengths += [len(part) for part in data if np.ndim(part) > 0]
    count = lengths[0] if lengths else max(len(member) for member in members)
    places = np.empty((count, len(members)), np.int64)
    for i, (member, column) in enumerate(zip(members, columns)):
        if column is None:
            if len(member) not in (1, count):
                raise InputError(
                    f"residuals '{name}': {count} residuals of {len(member)} variables '{member.name}': give indices"
                )
            places[:, i] = np.arange(count) if len(member) == count else 0
            continue
        whole_numbers = np.asarray(column)
        if whole_numbers.dtype.kind not in "iu" or whole_numbers.shape != (count,):
            raise InputError(
                f"residuals '{name}': indices of '{member.name}' are {whole_numbers.dtype} of the shape {whole_numbers.shape}: give whole "
                f"numbers ({count},)"
            )
        if ((whole_numbers < 0) | (whole_numbers >= len(member))).any():
            raise InputError(f"residuals '{name}': indices of '{member.name}' are from 0 to {len(member) - 1}")
        places[:, i] = whole_numbers
    for i, first in enumerate(members):
        for k, second in enumerate(members[:i]):
            if first is second and (places[:, i] == places[:, k]).any():
                raise InputError(f"residuals '{name}': a residual has the same variable of '{first.name}' twice")
    return places


def _whitening(
    name: str, shape: tuple[int, int], sigma: npt.ArrayLike | None, covariance: npt.ArrayLike | None
) -> Callable[[Array], Array]:
    """What divides residuals (n, rows) by their standard deviations."""
    if sigma is not None and covariance is not None:
        raise InputError(f"residuals '{name}': sigma and covariance exclude each other: give one of them")
    if covariance is not None:
        matrix = _depthcal.real_numbers("covariance", covariance)
        if matrix.shape[-2:] != (shape[1], shape[1]) or matrix.ndim not in (2, 3):
            raise InputError(
                f"residuals '{name}': covariance has the shape {matrix.shape}: give ({shape[1]}, {shape[1]}), or one per residual"
            )
        try:
            lower = np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError:
            raise InputError(f"residuals '{name}': covariance is not positive definite") from None
        root = np.broadcast_to(np.linalg.inv(lower), (shape[0], shape[1], shape[1]))
        return lambda values: np.einsum("nij,nj->ni", root, values)
    if sigma is None:
        return lambda values: values
    deviations = _depthcal.real_numbers("sigma", sigma)
    try:
        fits = np.broadcast_shapes(deviations.shape, shape) == shape
    except ValueError:
        fits = False
    if not fits:
        raise InputError(
            f"residuals '{name}': sigma has the shape {deviations.shape}, residuals {shape}: give numbers that fit"
        )
    if not (np.isfinite(deviations).all() and (deviations > 0).all()):
        raise InputError(f"residuals '{name}': sigma is not above 0 everywhere")
    return lambda values: values / deviations


class Solution:
    """Values at the minimum. ``solution[variables]`` has those of one kind, a row for each."""

    def __init__(self, native: Any, families: Sequence[Variables]) -> None:
        self._native, self._families = native, list(families)
        text, self.message, self._text = native.report()
        self.report: dict[str, Any] = json.loads(text)
        """Costs, iterations, times, the linear solver."""

    @property
    def converged(self) -> bool:
        """Whether a tolerance was met."""
        return self.report["converged"]

    @property
    def cost(self) -> float:
        """½ Σ ρ(‖r‖²) at the solution."""
        return self.report["cost"]

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return self.report["iterations"]

    def __getitem__(self, variables: Variables) -> Array:
        return self._native.values(self._number(variables))

    def _number(self, variables: Variables) -> int:
        if not any(variables is family for family in self._families):
            raise InputError("give variables of the problem that was solved")
        return variables._number

    def covariance(self, *variables: Variables | tuple[Variables, int]) -> Array:
        """Joint covariance of variables: all of a kind, or (kind, place). Rows and columns are the components of their steps, one variable
        after the other; those of fixed ones are zero.

        Raises :class:`UntrustedFitError` where residuals leave a combination of variables undetermined, and names it.
        """
        listed = []
        for part in variables:
            if isinstance(part, tuple):
                listed.append((self._number(part[0]), Problem._place(part[0], part[1])))
            else:
                listed += [(self._number(part), place) for place in range(len(part))]
        return self._native.covariance(listed)

    def standard_deviations(self, variables: Variables) -> Array:
        """Standard deviations of the steps of all variables of a kind, (n, components). Raises :class:`UntrustedFitError` as
        :meth:`covariance` does."""
        return self._native.standard_deviations(self._number(variables))

    def __repr__(self) -> str:
        return self._text
