"""Depth of one camera of a rig in the image of another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import _depthcal
from ._calibration import Calibration


@dataclass(frozen=True)
class Registered:
    """A frame of depth in another camera's image."""

    depth: np.ndarray
    """Corrected depth (height, width) of the other camera's image, of the type of the depth that was given; 0 where there is none."""
    colours: np.ndarray | None
    """Colours (height, width, 3) of the pixels of depth, uint8; black where there is none, or where another surface hides the point."""
    holes: int
    """Number of pixels of :attr:`depth` without depth."""


class Registration:
    """Takes the corrected depth of one camera of a rig into the image of another, as ``depthcal apply --register`` does.

    >>> onto_colour = depthcal.Registration(fit.calibration, "infrared", "colour")
    >>> registered = onto_colour(depth, unit_mm=1.0, image=rgb)
    """

    def __init__(self, calibration: Calibration, source: str, target: str) -> None:
        self._native = _depthcal.Registration(calibration._native, source, target)
        self.source = source
        """The camera with depth."""
        self.target = target
        """The camera in whose image depth is resampled, and whose colours the pixels of depth get."""

    def __call__(
        self,
        depth: np.ndarray,
        unit_mm: float = 1.0,
        *,
        image: np.ndarray | None = None,
        amplitude: np.ndarray | None = None,
        time_s: float | None = None,
        temperature_c: float | None = None,
        timestamp_s: float | None = None,
    ) -> Registered:
        """Registers a frame. ``depth`` (height, width) is as measured, as :meth:`Corrector.correct` takes it; ``image`` the target's image
        (height, width, 3), RGB, uint8. ``time_s`` is since the start of the recording, for effects; ``timestamp_s`` as in the dataset, for a
        place that changes with time. Raises :class:`InputError`."""
        conditions = {
            "amplitude": amplitude,
            "time_s": time_s,
            "temperature_c": temperature_c,
            "timestamp_s": timestamp_s,
        }
        return Registered(*self._native.register(depth, unit_mm, image, conditions))
