"""Progress of long calls."""

from __future__ import annotations

import sys
from typing import Any, Callable, Optional, Union

Show = Callable[[str, int, str, Optional[int]], None]
"""Receives (event, number of the job, text, steps): events are "begin", "doing", "advance" and "end"."""

Progress = Union[bool, Show, None]


class Bars:
    """Bars of tqdm, one for every job with steps, and a line for what the others do."""

    def __init__(self) -> None:
        try:
            # Bars of notebooks; without ipywidgets tqdm would warn of their lack.
            import ipywidgets  # noqa: F401
            from tqdm.auto import tqdm
        except ImportError:
            from tqdm import tqdm
        self._tqdm = tqdm
        self._bars: dict[int, Any] = {}

    def __call__(self, event: str, job: int, text: str, steps: int | None) -> None:
        if event == "begin":
            self._bars[job] = self._tqdm(total=steps, desc=text, leave=False)
        elif job in self._bars:
            bar = self._bars[job]
            if event == "doing":
                bar.set_description(text)
            elif event == "advance":
                bar.update()
            elif event == "end":
                bar.close()
                del self._bars[job]

    def close(self) -> None:
        for bar in self._bars.values():
            bar.close()
        self._bars.clear()


def _is_watched() -> bool:
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())


def show(progress: Progress) -> Show | None:
    """What shows progress: a given function; bars of tqdm for True, and for None where somebody watches and tqdm is installed."""
    if callable(progress):
        return progress
    if progress is False or (progress is None and not _is_watched()):
        return None
    try:
        return Bars()
    except ImportError:
        if progress:
            raise
        return None
