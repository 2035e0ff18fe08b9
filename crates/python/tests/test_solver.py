"""The solver on residual functions: against closed forms, the truth of simulations, and scipy."""

import os
import subprocess
import sys
import textwrap
import warnings

import numpy as np
import pytest

import depthcal
from depthcal import solver


def line(p, x, y):
    return p[:, 0] + p[:, 1] * x - y


def points_on_a_line(seed=1, n=40):
    random = np.random.default_rng(seed)
    x = np.linspace(-1, 3, n)
    return x, 1 + 2 * x + random.normal(0, 0.1, n)


def test_a_line_is_that_of_the_normal_equations():
    x, y = points_on_a_line()
    problem = solver.Problem()
    p = problem.vectors([[0.0, 0.0]], name="line")
    problem.add(line, p, data=(x, y), sigma=0.1)
    solution = problem.solve()
    a = np.stack([np.ones_like(x), x], axis=1)
    expected = np.linalg.lstsq(a, y, rcond=None)[0]
    np.testing.assert_allclose(solution[p][0], expected, atol=1e-8)
    covariance = 0.01 * np.linalg.inv(a.T @ a)
    # Derivatives by differences are exact to some 1e-9 for a linear function.
    np.testing.assert_allclose(solution.covariance(p), covariance, rtol=1e-6)
    np.testing.assert_allclose(solution.standard_deviations(p)[0], np.sqrt(np.diag(covariance)), rtol=1e-6)
    assert solution.converged and solution.cost == pytest.approx(
        0.5 * np.sum(((a @ expected - y) / 0.1) ** 2), rel=1e-9
    )
    assert "converged" in repr(solution) and solution.iterations < 10


def test_a_given_jacobian_is_used():
    x, y = points_on_a_line()
    calls = []

    def counted(p, x, y):
        calls.append(len(x))
        return line(p, x, y)

    def jacobian(p, x, y):
        return np.stack([np.ones_like(x), x], axis=1)[:, None, :]

    results = []
    for derivative in (None, jacobian):
        calls.clear()
        problem = solver.Problem()
        p = problem.vectors([[0.0, 0.0]])
        problem.add(counted, p, data=(x, y), jacobian=derivative, sigma=np.linspace(0.1, 0.2, len(x))[:, None])
        results.append((problem.solve()[p], len(calls)))
    np.testing.assert_allclose(results[0][0], results[1][0], atol=1e-8)
    assert results[1][1] < results[0][1] / 2

    def wrong(p, x, y):
        return np.ones((len(x), 1, 3))

    problem.add(line, p, data=(x, y), jacobian=wrong)
    with pytest.raises(depthcal.InputError, match=r"jacobian by 'vectors 0' has the shape \(40, 1, 3\)"):
        problem.solve()


def test_the_function_is_called_for_all_residuals_at_once():
    x, y = points_on_a_line(n=1000)
    calls = []

    def counted(p, offset, x, y):
        calls.append(len(x))
        return line(p, x, y) + offset[:, 0]

    problem = solver.Problem()
    p = problem.vectors([[0.0, 0.0]])
    offsets = problem.vectors(np.zeros((250, 1)))
    problem.add(counted, [p, offsets], indices=[np.zeros(1000, int), np.arange(1000) // 4], data=(x, y))
    problem.add(lambda offset: offset, offsets, sigma=0.01)
    solution = problem.solve()
    # Twice for each of the three components of a linearisation, once for its value, and once per trial.
    assert set(calls) == {1000} and len(calls) <= 8 * (solution.iterations + 2)


@pytest.mark.parametrize(
    "loss",
    [solver.Huber(1.0), solver.Cauchy(1.0), solver.Tukey(6.0), solver.GemanMcClure(2.0), solver.Barron(0.0, 1.0)],
)
def test_losses_withstand_outliers(loss):
    x, y = points_on_a_line(n=200)
    spoilt = y.copy()
    spoilt[::10] += 3.0
    fits = {}
    for name, chosen, values in (("clean", None, y), ("spoilt", None, spoilt), ("robust", loss, spoilt)):
        problem = solver.Problem()
        p = problem.vectors([[1.0, 2.0]])
        problem.add(line, p, data=(x, values), sigma=0.1, loss=chosen)
        fits[name] = problem.solve()[p][0]
    error = {name: np.abs(fit - fits["clean"]).max() for name, fit in fits.items()}
    assert error["spoilt"] > 0.2 and error["robust"] < 0.2 * error["spoilt"], error


def test_losses_are_scipy_s():
    least_squares = pytest.importorskip("scipy.optimize", reason="SKIPPED: scipy is not installed").least_squares
    x, y = points_on_a_line(n=60)
    y[::7] += 1.0
    problem = solver.Problem()
    p = problem.vectors([[0.0, 0.0]])
    problem.add(line, p, data=(x, y), sigma=0.1, loss=solver.Huber(1.5))
    solution = problem.solve()
    other = least_squares(
        lambda q: (q[0] + q[1] * x - y) / 0.1, [0.0, 0.0], loss="huber", f_scale=1.5, xtol=1e-14, ftol=1e-14, gtol=1e-14
    )
    np.testing.assert_allclose(solution[p][0], other.x, atol=1e-6)
    assert solution.cost == pytest.approx(other.cost, rel=1e-9)


def turned(q, x):
    w, v = q[:, :1], q[:, 1:4]
    return x + 2 * np.cross(v, np.cross(v, x) + w * x)


def test_a_pose_from_points():
    """The pose of a body from points that are seen in both frames: the truth, with the standard deviations of the noise."""
    random = np.random.default_rng(3)
    q = np.array([0.9, 0.2, -0.3, 0.1])
    q /= np.linalg.norm(q)
    t = np.array([0.5, -1.0, 2.0])
    body = random.normal(0, 1, (60, 3))
    sigma = 0.01
    errors = []
    for _ in range(20):
        seen = turned(np.tile(q, (60, 1)), body) + t + random.normal(0, sigma, body.shape)
        problem = solver.Problem()
        pose = problem.poses([[1.0, 0, 0, 0, 0, 0, 0]], name="pose")
        problem.add(lambda p, x, y: turned(p[:, :4], x) + p[:, 4:] - y, pose, data=(body, seen), sigma=sigma)
        solution = problem.solve()
        found = solution[pose][0]
        assert abs(np.linalg.norm(found[:4]) - 1) < 1e-12
        sign = np.sign(found[:4] @ q)
        stds = solution.standard_deviations(pose)[0]
        # ω of found = q Exp(ω), for small ω.
        inverse = q * [1, -1, -1, -1]
        omega = 2 * (inverse[0] * found[1:4] + found[0] * inverse[1:] + np.cross(inverse[1:], found[1:4])) * sign
        errors.append(np.concatenate([omega, found[4:] - t]) / stds)
    # Of 120 normalised errors the root mean square is 1 within 5 standard deviations of its own, √(1/240).
    rms = np.sqrt(np.mean(np.array(errors) ** 2))
    assert abs(rms - 1) < 5 / np.sqrt(240), rms


def test_rotations_and_directions():
    random = np.random.default_rng(5)
    axis = random.normal(0, 1, 3)
    axis /= np.linalg.norm(axis)
    seen = axis + random.normal(0, 0.05, (100, 3))
    problem = solver.Problem()
    direction = problem.directions([[0.0, 0.0, 1.0]], name="axis")
    problem.add(lambda n, y: n - y, direction, data=seen, sigma=0.05)
    solution = problem.solve()
    mean = seen.mean(axis=0)
    # The direction nearest to all is that of their mean.
    np.testing.assert_allclose(solution[direction][0], mean / np.linalg.norm(mean), atol=1e-7)
    assert solution.covariance(direction).shape == (2, 2)

    # Rotations that differ from their neighbours by a known turn, the first one held.
    half = np.deg2rad(15)
    step = np.array([np.cos(half), 0, 0, np.sin(half)])
    problem = solver.Problem()
    rotations = problem.rotations(np.tile([1.0, 0, 0, 0], (5, 1)))

    def product(a, b):
        w = a[:, 0] * b[:, 0] - np.einsum("ij,ij->i", a[:, 1:], b[:, 1:])
        v = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
        return np.concatenate([w[:, None], v], axis=1)

    def between(a, b):
        inverse = a * [1, -1, -1, -1]
        return product(np.tile(step * [1, -1, -1, -1], (len(a), 1)), product(inverse, b))[:, 1:]

    problem.add(between, [rotations, rotations], indices=[np.arange(4), np.arange(1, 5)], sigma=0.01)
    problem.fix(rotations, 0)
    found = problem.solve()[rotations]
    angles = 2 * np.rad2deg(np.arctan2(found[:, 3], found[:, 0]))
    np.testing.assert_allclose(angles, 30.0 * np.arange(5), atol=1e-5)


def test_bundle_adjustment():
    """Cameras and points from what the cameras see: the truth, up to the frame and the scale that are held."""
    random = np.random.default_rng(7)
    points = random.uniform([-1, -1, 4], [1, 1, 6], (80, 3))
    poses = np.zeros((6, 7))
    poses[:, 0] = 1
    poses[:, 4:] = random.uniform(-0.5, 0.5, (6, 3))
    poses[0, 4:] = 0
    cameras, seen_points = np.divmod(np.arange(480), 80)

    def reprojection(pose, point, seen):
        x = turned(pose[:, :4], point) + pose[:, 4:]
        return x[:, :2] / x[:, 2:] - seen

    exact = reprojection(poses[cameras], points[seen_points], np.zeros((480, 2)))
    problem = solver.Problem()
    start = poses.copy()
    start[1:, 4:] += random.normal(0, 0.02, (5, 3))
    start[1, 4] = poses[1, 4]
    some = problem.poses(start, name="cameras")
    them = problem.vectors(points + random.normal(0, 0.05, points.shape), name="points")
    problem.add(reprojection, [some, them], indices=[cameras, seen_points], data=exact, sigma=1e-3)
    problem.fix(some, 0)
    problem.fix(some, 1, components=[3])
    solution = problem.solve()
    assert solution.converged and solution.cost < 1e-12
    np.testing.assert_allclose(solution[some], poses, atol=1e-7)
    np.testing.assert_allclose(solution[them], points, atol=1e-6)
    stds = solution.standard_deviations(some)
    assert (stds[0] == 0).all() and stds[1, 3] == 0 and (stds[2:] > 0).all()
    joint = solution.covariance((some, 2), (them, 5))
    assert joint.shape == (9, 9) and np.allclose(np.sqrt(np.diag(joint))[:6], stds[2], rtol=1e-6)


def test_bounds_and_fixed_components():
    x, y = points_on_a_line()
    problem = solver.Problem()
    p = problem.vectors([[0.0, 0.5]])
    problem.add(line, p, data=(x, y))
    problem.bound(p, 1, high=1.5)
    assert problem.solve()[p][0, 1] == pytest.approx(1.5)
    problem = solver.Problem()
    p = problem.vectors([[0.7, 0.0]])
    problem.add(line, p, data=(x, y))
    problem.fix(p, components=[0])
    solution = problem.solve()
    assert solution[p][0, 0] == 0.7 and solution[p][0, 1] == pytest.approx(np.sum(x * (y - 0.7)) / np.sum(x * x))


def test_covariances_of_several_numbers():
    random = np.random.default_rng(2)
    matrix = np.array([[0.04, 0.01], [0.01, 0.09]])
    seen = random.multivariate_normal([1, 2], matrix, 50)
    problem = solver.Problem()
    p = problem.vectors([[0.0, 0.0]])
    problem.add(lambda p, y: p - y, p, data=seen, covariance=matrix)
    solution = problem.solve()
    np.testing.assert_allclose(solution[p][0], seen.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(solution.covariance(p), matrix / 50, rtol=1e-6)


def test_what_is_undetermined_is_named():
    problem = solver.Problem()
    p = problem.vectors([[1.0, 1.0]], name="product")
    problem.add(lambda p, y: p[:, 0] * p[:, 1] - y, p, data=np.full(5, 6.0))
    solution = problem.solve()
    assert np.prod(solution[p]) == pytest.approx(6.0)
    for ask in (lambda: solution.covariance(p), lambda: solution.standard_deviations(p)):
        with pytest.raises(depthcal.UntrustedFitError, match=r"product\[0\]"):
            ask()


def test_a_minimum_that_was_not_reached_is_said():
    x, y = points_on_a_line()
    problem = solver.Problem()
    p = problem.vectors([[3.0, 3.0]])
    problem.add(lambda p, x, y: np.exp(p[:, 0]) + p[:, 1] ** 2 * x - y, p, data=(x, y))
    with pytest.warns(depthcal.DepthcalWarning, match="maximum number of iterations") as told:
        solution = problem.solve(max_iterations=1)
    assert not solution.converged and told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert problem.solve().converged


def test_exceptions_and_faults_of_functions():
    x, y = points_on_a_line()
    problem = solver.Problem()
    p = problem.vectors([[0.0, 0.0]])
    calls = []

    def fails(p, x, y):
        calls.append(1)
        if len(calls) > 3:
            raise ZeroDivisionError("own message")
        return line(p, x, y)

    problem.add(fails, p, data=(x, y))
    with pytest.raises(ZeroDivisionError, match="own message"):
        problem.solve()

    for function, words in [
        (lambda p, x, y: np.zeros(3), "a row of numbers for each of the 40"),
        (lambda p, x, y: line(p, x, y) + 0j, "real numbers"),
        (lambda p, x, y: None, "real numbers"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            problem.add(function, p, data=(x, y))
    nothing = solver.Problem()
    q = nothing.vectors([[0.0, 0.0]])
    nothing.add(lambda p, x, y: np.full(40, np.nan), q, data=(x, y))
    with pytest.raises(depthcal.InputError, match="not finite"):
        nothing.solve()


def test_arguments_are_checked():
    x, y = points_on_a_line()
    problem = solver.Problem()
    p = problem.vectors([[0.0, 0.0]], name="line")
    several = problem.vectors(np.zeros((3, 2)), name="several")
    for call, words in [
        (lambda: problem.vectors([["a"]]), "real numbers"),
        (lambda: problem.poses([[1.0, 0, 0]]), "7"),
        (lambda: problem.vectors([[0.0]], scale=0.0), "scale"),
        (lambda: problem.add(line, several, data=(x, y)), "40 residuals of 3 variables 'several': give indices"),
        (lambda: problem.add(line, several, data=(x, y), indices=np.full(40, 3)), "from 0 to 2"),
        (lambda: problem.add(line, several, data=(x, y), indices=np.full(40, 0.5)), "whole numbers"),
        (lambda: problem.add(lambda a, b: a - b, [several, several], indices=[[0, 1], [1, 1]]), "twice"),
        (lambda: problem.add(line, solver.Problem().vectors([[0.0, 0.0]]), data=(x, y)), "of this problem"),
        (lambda: problem.add(line, p, data=(x, y), sigma=0.0), "above 0"),
        (lambda: problem.add(line, p, data=(x, y), sigma=[1.0, 2.0, 3.0]), "shape"),
        (lambda: problem.add(line, p, data=(x, y), sigma=1.0, covariance=[[1.0]]), "exclude"),
        (lambda: problem.add(line, p, data=(x, y), covariance=[[-1.0]]), "positive definite"),
        (lambda: problem.add(line, p, data=(x, y), loss="huber"), "loss is a str"),
        (lambda: problem.fix(p, 1), "counted from 0"),
        (lambda: problem.fix(p, components=[2]), "components 0 to 1"),
        (lambda: problem.bound(problem.rotations([[1.0, 0, 0, 0]]), 0), "for vectors"),
        (lambda: problem.solve(), "no residuals"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            call()
    problem.add(line, p, data=(x, y))
    for options, words in [
        (dict(method="newton"), "levenberg-marquardt"),
        (dict(linear_solver="lu"), "sparse-cholesky"),
        (dict(max_iterations=-1), "max_iterations"),
        (dict(cost_tolerance=-1.0), "cost_tolerance"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            problem.solve(**options)
    solution = problem.solve()
    with pytest.raises(depthcal.InputError, match="of the problem that was solved"):
        solution[solver.Problem().vectors([[0.0]])]


def test_all_solvers_agree():
    x, y = points_on_a_line(n=200)
    found = []
    for options in [
        dict(linear_solver=name) for name in ("dense", "sparse-cholesky", "dense-schur", "sparse-schur", "sparse-qr")
    ] + [dict(method=name) for name in ("dog-leg", "gauss-newton")]:
        problem = solver.Problem()
        p = problem.vectors([[0.0, 0.0]])
        offsets = problem.vectors(np.zeros((50, 1)))
        problem.add(
            lambda p, o, x, y: line(p, x, y) + o[:, 0],
            [p, offsets],
            indices=[np.zeros(200, int), np.arange(200) // 4],
            data=(x, y),
        )
        problem.add(lambda offset: offset, offsets, sigma=0.1)
        found.append(problem.solve(**options)[p])
    assert np.ptp(np.array(found), axis=0).max() < 1e-7


def test_ctrl_c_ends_a_solution():
    program = textwrap.dedent("""
        import os, signal, time
        import numpy as np
        from depthcal import solver
        signal.signal(signal.SIGINT, signal.default_int_handler)
        calls = []
        def slow(p):
            calls.append(1)
            if len(calls) == 5:
                os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.02)
            return np.stack([np.sin(9 * p[:, 0]) + p[:, 0] ** 2 + np.sin(3 * p[:, 1]), np.cos(7 * p[:, 1]) + 2], axis=1)
        problem = solver.Problem()
        p = problem.vectors([[3.0, 2.0]])
        problem.add(slow, p)
        calls.clear()
        try:
            problem.solve(max_iterations=100000, cost_tolerance=0, parameter_tolerance=0, gradient_tolerance=0)
            print("finished")
        except KeyboardInterrupt:
            print("interrupted", len(calls) < 60)
    """)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, env=os.environ)
    assert done.stdout.split() == ["interrupted", "True"], done.stdout + done.stderr
