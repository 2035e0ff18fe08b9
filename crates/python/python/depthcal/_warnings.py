"""Warnings at the line that called the package."""

from __future__ import annotations

import sys
import warnings
from types import FrameType


class DepthcalWarning(UserWarning):
    """What depthcal warns of: frames that are left out, declarations that data contradict, inputs that effects need."""


def warn(message: str, category: type[Warning] = DepthcalWarning) -> None:
    """Warns at the nearest line outside the package."""
    level = 1
    frame: FrameType | None = sys._getframe()
    while frame is not None and frame.f_globals.get("__name__", "").split(".")[0] == "depthcal":
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level)
