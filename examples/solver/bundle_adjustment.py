"""Bundle adjustment of simulated views by depthcal.solver, and by scipy, pyceres and gtsam where they are installed.

    python bundle_adjustment.py [CAMERAS POINTS]

Poses of the cameras and points in space from noisy pixels, the first camera held, and one component of the second for the scale. All
programs start from the same values, have the same noise, and stop at a relative decrease of the cost of 1e-9. Residuals are Python: numpy
for depthcal and scipy, a cost function in Python per observation for pyceres; gtsam has its own factor in C++.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from depthcal import solver

FOCAL, SIGMA = 600.0, 0.5


def simulate(cameras: int, points: int, seed: int = 1):
    """Poses (n, 7), points (m, 3), indices of cameras and points, pixels, and start values of poses and points."""
    random = np.random.default_rng(seed)
    xyz = random.uniform([-2, -2, 4], [2, 2, 8], (points, 3))
    poses = np.zeros((cameras, 7))
    poses[:, 0] = 1
    poses[:, 1:4] = random.normal(0, 0.02, (cameras, 3))
    poses[:, :4] /= np.linalg.norm(poses[:, :4], axis=1, keepdims=True)
    poses[:, 4:] = random.uniform(-0.5, 0.5, (cameras, 3))
    poses[0] = [1, 0, 0, 0, 0, 0, 0]
    camera, point = (index.ravel() for index in np.indices((cameras, points)))
    seen = project(poses[camera], xyz[point]) + random.normal(0, SIGMA, (len(camera), 2))
    start = poses.copy()
    start[1:, 4:] += random.normal(0, 0.03, (cameras - 1, 3))
    start[1, 4] = poses[1, 4]
    return poses, xyz, camera, point, seen, start, xyz + random.normal(0, 0.1, xyz.shape)


def project(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Pixels (n, 2) of points (n, 3) seen from poses (n, 7)."""
    w, v = pose[:, :1], pose[:, 1:4]
    x = point + 2 * np.cross(v, np.cross(v, point) + w * point) + pose[:, 4:]
    return FOCAL * x[:, :2] / x[:, 2:]


def by_depthcal(camera, point, seen, start, xyz, **options):
    problem = solver.Problem()
    poses, points = problem.poses(start, name="camera"), problem.vectors(xyz, name="point")
    problem.add(
        lambda pose, point, seen: project(pose, point) - seen,
        [poses, points],
        indices=[camera, point],
        data=seen,
        sigma=SIGMA,
        **options,
    )
    problem.fix(poses, 0)
    problem.fix(poses, 1, components=[3])
    solution = problem.solve()
    return solution[poses], solution[points], solution.cost


def jacobian(pose: np.ndarray, point: np.ndarray, seen: np.ndarray):
    """Derivatives of the pixels by a step of the pose, (ω, τ), and by the point."""
    w, v = pose[:, :1], pose[:, 1:4]
    x = point + 2 * np.cross(v, np.cross(v, point) + w * point) + pose[:, 4:]
    by_x = np.zeros((len(x), 2, 3))
    by_x[:, 0, 0] = by_x[:, 1, 1] = FOCAL / x[:, 2]
    by_x[:, :, 2] = -FOCAL * x[:, :2] / x[:, 2:] ** 2
    eye = np.eye(3)
    rotation = np.stack([e + 2 * np.cross(v, np.cross(v, e) + w * e) for e in eye], axis=2)
    cross = np.stack([np.cross(e, point) for e in eye], axis=2)
    return np.concatenate([by_x @ rotation @ cross, by_x], axis=2), by_x @ rotation


def by_scipy(camera, point, seen, start, xyz):
    from scipy.optimize import least_squares
    from scipy.sparse import lil_matrix

    n, m = len(start), len(xyz)

    def unpacked(theta):
        # Rotation vectors: scipy has no manifolds.
        omega, poses = theta[: 3 * n].reshape(n, 3), np.zeros((n, 7))
        angle = np.linalg.norm(omega, axis=1, keepdims=True)
        poses[:, :1], poses[:, 1:4] = np.cos(angle / 2), omega * np.sinc(angle / 2 / np.pi) / 2
        poses[:, 4:] = theta[3 * n : 6 * n].reshape(n, 3)
        return poses, theta[6 * n :].reshape(m, 3)

    omega = (
        2
        * start[:, 1:4]
        * np.arccos(start[:, :1])
        / np.maximum(np.linalg.norm(start[:, 1:4], axis=1, keepdims=True), 1e-12)
    )
    full = np.concatenate([omega.ravel(), start[:, 4:].ravel(), xyz.ravel()])
    free = np.ones(len(full), bool)
    free[[0, 1, 2, 3 * n, 3 * n + 1, 3 * n + 2, 3 * n + 3]] = False

    def residuals(some):
        theta = full.copy()
        theta[free] = some
        poses, points = unpacked(theta)
        return ((project(poses[camera], points[point]) - seen) / SIGMA).ravel()

    pattern = lil_matrix((2 * len(camera), len(full)), dtype=np.int8)
    rows = np.arange(len(camera))
    for row in (2 * rows, 2 * rows + 1):
        for k in range(3):
            pattern[row, 3 * camera + k] = 1
            pattern[row, 3 * n + 3 * camera + k] = 1
            pattern[row, 6 * n + 3 * point + k] = 1
    result = least_squares(
        residuals, full[free], jac_sparsity=pattern.tocsr()[:, free], x_scale="jac", ftol=1e-9, xtol=1e-9, gtol=1e-10
    )
    theta = full.copy()
    theta[free] = result.x
    return (*unpacked(theta), result.cost)


def by_pyceres(camera, point, seen, start, xyz):
    import pyceres

    class Reprojection(pyceres.CostFunction):
        def __init__(self, pixel):
            super().__init__()
            self.pixel = pixel
            self.set_num_residuals(2)
            self.set_parameter_block_sizes([4, 3, 3])

        def Evaluate(self, parameters, residuals, jacobians):
            q, t, x = (np.asarray(p) for p in parameters)
            w, v = q[0], q[1:]
            turned = x + 2 * np.cross(v, np.cross(v, x) + w * x)
            c = turned + t
            residuals[:] = (FOCAL * c[:2] / c[2] - self.pixel) / SIGMA
            if jacobians is not None:
                by_c = FOCAL / SIGMA * np.array([[1 / c[2], 0, -c[0] / c[2] ** 2], [0, 1 / c[2], -c[1] / c[2] ** 2]])
                if jacobians[0] is not None:
                    skew = np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])
                    by_v = 2 * (-w * skew + np.outer(v, x) + (v @ x) * np.eye(3) - 2 * np.outer(x, v))
                    by_q = np.concatenate([2 * np.cross(v, x)[:, None], by_v], axis=1)
                    jacobians[0][:] = (by_c @ by_q).ravel()
                if jacobians[1] is not None:
                    jacobians[1][:] = by_c.ravel()
                if jacobians[2] is not None:
                    columns = [e + 2 * np.cross(v, np.cross(v, e) + w * e) for e in np.eye(3)]
                    jacobians[2][:] = (by_c @ np.stack(columns, axis=1)).ravel()
            return True

    problem, costs = pyceres.Problem(), []
    qs, ts = [row[:4].copy() for row in start], [row[4:].copy() for row in start]
    xs = [row.copy() for row in xyz]
    for i, k, pixel in zip(camera, point, seen):
        costs.append(Reprojection(pixel))
        problem.add_residual_block(costs[-1], None, [qs[i], ts[i], xs[k]])
    for q in qs:
        problem.set_manifold(q, pyceres.QuaternionManifold())
    problem.set_parameter_block_constant(qs[0])
    problem.set_parameter_block_constant(ts[0])
    problem.set_manifold(ts[1], pyceres.SubsetManifold(3, [0]))
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_SCHUR
    options.function_tolerance, options.parameter_tolerance, options.max_num_iterations = 1e-9, 1e-9, 100
    options.num_threads = 1
    summary = pyceres.SolverSummary()
    pyceres.solve(options, problem, summary)
    return np.concatenate([np.array(qs), np.array(ts)], axis=1), np.array(xs), summary.final_cost


def by_gtsam(camera, point, seen, start, xyz):
    import gtsam

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Isotropic.Sigma(2, SIGMA)
    k = gtsam.Cal3_S2(FOCAL, FOCAL, 0.0, 0.0, 0.0)
    c, p = gtsam.symbol_shorthand.C, gtsam.symbol_shorthand.P

    def pose_of(row):
        return gtsam.Pose3(gtsam.Rot3.Quaternion(*row[:4]), row[4:]).inverse()

    for i, row in enumerate(start):
        values.insert(c(i), pose_of(row))
    for i, row in enumerate(xyz):
        values.insert(p(i), row)
    for i, j, pixel in zip(camera, point, seen):
        graph.add(gtsam.GenericProjectionFactorCal3_S2(pixel, noise, c(i), p(j), k))
    graph.add(gtsam.PriorFactorPose3(c(0), pose_of(start[0]), gtsam.noiseModel.Constrained.All(6)))
    # The scale: gtsam holds the distance of the first two cameras, which changes no residual at the minimum.
    distance = np.linalg.norm(pose_of(start[1]).translation())
    graph.add(gtsam.RangeFactorPose3(c(0), c(1), distance, gtsam.noiseModel.Isotropic.Sigma(1, 1e-6)))
    parameters = gtsam.LevenbergMarquardtParams.CeresDefaults()
    parameters.setRelativeErrorTol(1e-9)
    result = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()
    poses = [result.atPose3(c(i)).inverse() for i in range(len(start))]
    rows = [
        np.concatenate([[q.w(), q.x(), q.y(), q.z()], pose.translation()])
        for pose in poses
        for q in [pose.rotation().toQuaternion()]
    ]
    return np.array(rows), np.array([result.atPoint3(p(i)) for i in range(len(xyz))]), graph.error(result)


def main() -> int:
    cameras, points = (int(word) for word in sys.argv[1:3]) if len(sys.argv) > 2 else (10, 200)
    _, truth, *given = simulate(cameras, points)
    programs: dict[str, Callable] = {
        "depthcal": by_depthcal,
        "depthcal, jacobian given": lambda *a: by_depthcal(*a, jacobian=jacobian),
        "scipy": by_scipy,
        "pyceres, one thread": by_pyceres,
        "gtsam": by_gtsam,
    }
    print(f"{cameras} cameras, {points} points, {cameras * points} observations")
    for name, program in programs.items():
        try:
            begin = time.perf_counter()
            _, xyz, cost = program(*given)
        except ImportError as error:
            print(f"  {name}: not installed ({error.name})")
            continue
        seconds = time.perf_counter() - begin
        # Scales may differ.
        scale = np.median(np.linalg.norm(truth, axis=1)) / np.median(np.linalg.norm(xyz, axis=1))
        rms = np.sqrt(np.mean(np.sum((scale * xyz - truth) ** 2, axis=1)))
        print(f"  {name}: {seconds:.2f} s, cost {cost:.3f}, points {1000 * rms:.1f} mm rms from the truth")
    return 0


if __name__ == "__main__":
    sys.exit(main())
