"""Names of an earlier release for datasets of several cameras, which :func:`load`, :func:`calibrate`, :func:`evaluate` and :func:`diagnose`
take now. They warn and will be removed with the next release."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import TypeVar

from ._dataset import Dataset, FrameInfo, load
from ._diagnose import Diagnosis, diagnose
from ._evaluate import Evaluation, evaluate
from ._fit import Fit, calibrate

Rig = Dataset
RigFrame = FrameInfo
RigFit = Fit
RigEvaluation = Evaluation
RigDiagnosis = Diagnosis

Function = TypeVar("Function", bound=Callable)


def _renamed(name: str, function: Function) -> Function:
    """The function under its earlier name, of which it warns."""

    @functools.wraps(function)
    def call(*arguments, **named):
        message = f"depthcal.{name} is depthcal.{function.__name__} now, and will be removed"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        return function(*arguments, **named)

    call.__name__ = call.__qualname__ = name
    return call  # type: ignore[return-value]


load_rig = _renamed("load_rig", load)
calibrate_rig = _renamed("calibrate_rig", calibrate)
evaluate_rig = _renamed("evaluate_rig", evaluate)
diagnose_rig = _renamed("diagnose_rig", diagnose)
