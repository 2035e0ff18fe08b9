"""A program whose types are checked by mypy and pyright in test_types.py; it is not run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

import depthcal
from depthcal import solver


def captures(board: depthcal.Board) -> depthcal.Dataset:
    depth: npt.NDArray[np.uint16] = np.zeros((480, 640), np.uint16)
    frame = depthcal.Frame(np.zeros((54, 2)), depth, name="one", temperature_c=25.0)
    one = depthcal.Dataset.from_arrays(board, [frame], unit_mm=1.0, intrinsics=(600.0, 600.0, 320.0, 240.0))
    return depthcal.Dataset.from_cameras({"infrared": one, "colour": one}, extrinsics={"colour": np.eye(4)})


def fitted(dataset: depthcal.Dataset, out: Path) -> depthcal.Calibration:
    fit = depthcal.calibrate(dataset, fixed={"pinhole.fx": 580.0, "brown_conrady.k3": None}, cross_validate=3)
    written: list[Path] = fit.save(out)
    std: float | None = fit.calibration.parameters["pinhole.fx"].std_dev
    covariance = fit.calibration.covariance
    if covariance is not None:
        element: float = covariance["pinhole.fx", "pinhole.fy"]
        block: depthcal.Matrix = covariance[["pinhole.fx"]]
        print(element, block.names, std, written)
    names: list[str] = [row.camera for row in fit.calibration.extrinsics]
    print(names, [row.rms_px for row in fit.transfers], depthcal.fleet({"a": fit}).units)
    return fit.calibration


def corrected(calibration: depthcal.Calibration) -> npt.NDArray[np.float32]:
    corrector = depthcal.Corrector(calibration, threads=1)
    in_steps, in_metres = np.zeros((480, 640), np.uint16), np.zeros((480, 640), np.float32)
    steps: npt.NDArray[np.uint16] = corrector.correct(in_steps, unit_mm=0.25)
    metres: npt.NDArray[np.float32] = corrector.correct(in_metres, unit_mm=1000.0)
    print(steps.dtype, metres.dtype)
    return corrector.points(steps, unit_mm=0.25)


def others(dataset: depthcal.Dataset) -> None:
    diagnosis = depthcal.diagnose(dataset, discovery=False)
    effects: list[str] = [step.effect for step in diagnosis.steps]
    comparison = depthcal.compare(dataset, models=["none", "projective"])
    difference: depthcal.Difference = depthcal.diff(diagnosis.calibration, "other/calibration.json")
    errors: depthcal.Evaluation = depthcal.evaluate(diagnosis, [dataset])
    print(effects, comparison.models.names, difference.differs, errors.datasets[0].depth_rms_mm)


def line() -> npt.NDArray[np.float64]:
    problem = solver.Problem()
    variables = problem.vectors([[0.0, 0.0]], name="line")

    def residual(p: npt.NDArray[np.float64], x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return p[:, 0] * x - p[:, 1]

    problem.add(residual, variables, data=np.arange(5.0), loss=solver.Huber(1.0))
    solution: solver.Solution = problem.solve()
    return solution[variables]


@depthcal.effect(parameters={"a": "mm"}, adds_to="depth")
def bowl(r: npt.NDArray[np.float64], a: float) -> npt.NDArray[np.float64]:
    return a * r**2
