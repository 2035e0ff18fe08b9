"""Recordings as datasets."""

from __future__ import annotations

import json
import os
from typing import Any, Optional, Union

from . import _depthcal, _progress
from ._arguments import whole
from ._dataset import Board
from ._depthcal import InputError


def import_recording(
    recording: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    board: Optional[Board] = None,
    image: str | None = None,
    depth: str | None = None,
    frames: int = 40,
    pair: Union[str, float] = "time",
    skip_s: float = 0.0,
    progress: _progress.Progress = None,
) -> dict[str, Any]:
    """Imports frames of a recording (ROS bags, MCAP, Matroska) as a dataset into the folder ``out``, as ``depthcal import`` does; returns
    what was imported. :func:`load` reads the dataset.

    ``board`` is written to dataset.toml, and frames that show it are picked; without it dataset.toml has to be completed. ``image`` and
    ``depth`` name the streams, ``depth="none"`` imports images alone; at most ``frames`` are taken. ``pair`` is how depth is paired with
    images: ``"time"``, ``"order"``, or seconds that are added to the times of depth. ``skip_s`` leaves out the beginning.
    Raises :class:`InputError` with the file, what is wrong and the remedy.
    """
    if not hasattr(_depthcal, "import_recording"):
        raise InputError(
            "this package was built without the feature 'import': build it with it, or use the command line"
        )
    options = {
        "board": None if board is None else board._json(),
        "image": image,
        "depth": depth,
        "frames": whole("frames", frames, 1),
        "pair": pair,
        "skip_s": float(skip_s),
    }
    show = _progress.show(progress)
    return json.loads(_depthcal.import_recording(os.fspath(recording), os.fspath(out), options, show))
