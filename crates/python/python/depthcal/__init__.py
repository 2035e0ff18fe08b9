"""Calibration of depth cameras.

The measurement: a camera frame as OpenCV has it (x right, y down, z forward), lengths in millimetres, pixels with centres at
integers. Depth is the z coordinate, not the range; inverse depth is 1/z. Depth images are arrays (height, width) in units of
``unit_mm`` millimetres: uint16 in whole steps, 0 and 65535 where nothing was measured, or float32, 0, NaN and infinity where
nothing was (metres: ``unit_mm=1000``).

Arrays may have any strides and byte order, as slices, transposed arrays and those of MATLAB have. Types are not guessed: an
array of another type than is asked for, or with a mask, is an error.

>>> import depthcal
>>> dataset = depthcal.load("captures/")                        # or depthcal.Dataset.from_arrays(...)
>>> fit = depthcal.calibrate(dataset, cross_validate=3)
>>> fit.calibration.parameters.to_pandas()
>>> fit.save("result/")                                         # the files that the command line writes
>>> corrector = depthcal.Corrector(fit.calibration)
>>> corrected = corrector.correct(depth, unit_mm=1.0)

Exceptions are those of the command line, with its messages: :class:`InputError` where files, arrays or arguments are at fault (exit
code 1) and :class:`UntrustedFitError` where a fit cannot be trusted (exit code 2), both of the class :class:`Error`. What the command
line warns of are warnings of the class :class:`DepthcalWarning`. :mod:`depthcal.solver` solves other least-squares problems.
"""

from . import solver
from ._calibration import Calibration, Extrinsics, Parameter
from ._compare import ComparedModel, Comparison, compare
from ._dataset import Board, Dataset, Frame, FrameInfo, load
from ._depthcal import (
    Corrector,
    Error,
    InputError,
    UntrustedFitError,
    __version__,
    has_detection,
    set_threads,
)
from ._diagnose import Diagnosis, Step, diagnose
from ._diff import Difference, DifferenceAt, diff
from ._effects import Effect, EffectCost, EffectWarning, effect, read_effects
from ._evaluate import DatasetErrors, Evaluation, FrameErrors, TransferError, evaluate
from ._fit import Fit, calibrate
from ._fleet import Fleet, FleetEffect, FleetOutlier, FleetParameter, fleet
from ._import import import_recording
from ._registration import Registered, Registration
from ._report import Report
from ._rig import (
    Rig,
    RigDiagnosis,
    RigEvaluation,
    RigFit,
    RigFrame,
    calibrate_rig,
    diagnose_rig,
    evaluate_rig,
    load_rig,
)
from ._simulate import simulate, simulate_points
from ._tables import Matrix, Table
from ._warnings import DepthcalWarning

__all__ = [
    "Board",
    "Calibration",
    "ComparedModel",
    "Comparison",
    "Corrector",
    "Dataset",
    "DatasetErrors",
    "DepthcalWarning",
    "Diagnosis",
    "Difference",
    "DifferenceAt",
    "Effect",
    "EffectCost",
    "EffectWarning",
    "Error",
    "Evaluation",
    "Extrinsics",
    "Fit",
    "Fleet",
    "FleetEffect",
    "FleetOutlier",
    "FleetParameter",
    "Frame",
    "FrameErrors",
    "FrameInfo",
    "InputError",
    "Matrix",
    "Parameter",
    "Registered",
    "Registration",
    "Report",
    "Rig",
    "RigDiagnosis",
    "RigEvaluation",
    "RigFit",
    "RigFrame",
    "Step",
    "Table",
    "TransferError",
    "UntrustedFitError",
    "__version__",
    "calibrate",
    "calibrate_rig",
    "compare",
    "diagnose",
    "diagnose_rig",
    "diff",
    "effect",
    "evaluate",
    "evaluate_rig",
    "fleet",
    "has_detection",
    "import_recording",
    "load",
    "load_rig",
    "read_effects",
    "set_threads",
    "simulate",
    "simulate_points",
    "solver",
]
