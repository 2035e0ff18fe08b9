"""Fits that travel to other processes: what they have said, and their files."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from . import _depthcal
from ._depthcal import InputError


class PickledFit:
    """Stands for the native fit of a pickled one: its records and its files, without the normal equations."""

    def __init__(
        self,
        calibration: str,
        evaluation: str,
        table: str,
        prior: list[str],
        scores: dict[str | None, str | None],
        files: dict[str, bytes],
    ) -> None:
        self._calibration, self._evaluation, self._table = calibration, evaluation, table
        self._prior, self._scores, self._files = prior, scores, files

    @classmethod
    def of(cls, native: Any) -> PickledFit:
        """What a fit has said."""
        if isinstance(native, PickledFit):
            return native
        calibration = native.calibration()
        names: list[Any] = calibration.cameras() or [None]
        text = calibration.json()
        # What the other process could not read is said here.
        _depthcal.Calibration.parse(text, [])
        with tempfile.TemporaryDirectory() as folder:
            written = [Path(path) for path in native.save(folder)]
            files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in written}
        scores = {name: native.scores(name) for name in names}
        return cls(text, native.evaluation(), native.table(), native.prior_sentences(), scores, files)

    def state(self) -> tuple[Any, ...]:
        """The arguments that make it."""
        return self._calibration, self._evaluation, self._table, self._prior, self._scores, self._files

    def calibration(self) -> Any:
        return _depthcal.Calibration.parse(self._calibration, [])

    def evaluation(self) -> str:
        return self._evaluation

    def table(self) -> str:
        return self._table

    def prior_sentences(self) -> list[str]:
        return self._prior

    def scores(self, camera: str | None) -> str | None:
        if camera not in self._scores:
            raise InputError(f"camera: give one of {', '.join(str(name) for name in self._scores)}")
        return self._scores[camera]

    def report_html(self) -> str:
        return self._files["report.html"].decode()

    def save(self, out: str) -> list[Path]:
        return _depthcal.write_files(out, "calibration.json", list(self._files.items()))

    def next_captures(self, *_: Any) -> str:
        raise InputError("the fit was pickled, without its normal equations: call next_captures where it was fitted")
