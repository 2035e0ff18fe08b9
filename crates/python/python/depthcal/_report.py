"""Reports: one page of HTML that needs no network."""

from __future__ import annotations

import html as _html
import os
from pathlib import Path
from typing import Any


class Report:
    """A report. Notebooks show it inline, in a frame of its own."""

    def __init__(self, html: str) -> None:
        self.html = html
        """The page."""

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the page to a file; returns its path."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(self.html, encoding="utf-8")
        return path

    def __repr__(self) -> str:
        return f"<depthcal.Report, {len(self.html) / 1e6:.1f} MB of HTML: .save(path) writes it>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{_html.escape(self.html)}" sandbox="allow-scripts" '
            'style="width:100%;height:800px;border:1px solid #ccc"></iframe>'
        )


class Reported:
    """A result with a report: what :class:`Fit`, :class:`Evaluation`, :class:`Comparison` and :class:`Diagnosis` share. Notebooks show
    a summary of some kilobytes; :attr:`report` at the end of a cell is the whole page."""

    _native: Any

    @property
    def report(self) -> Report:
        """The report, as the command line writes it to ``report.html``."""
        return Report(self._native.report_html())

    def save(self, out: str | os.PathLike[str]) -> list[Path]:
        """Writes the files that the command line writes into the folder ``out``, which is created; returns their paths."""
        return [Path(path) for path in self._native.save(os.fspath(out))]

    def _summary(self) -> list[Any]:
        """Tables that a notebook shows below the result's text."""
        return []

    def _repr_html_(self) -> str:
        # The report itself has megabytes of maps: a notebook would store them with every cell that ends with a result.
        tables = "".join(table._repr_html_() for table in self._summary())
        return f"<pre>{_html.escape(repr(self))}</pre>{tables}<p>The whole report: <code>.report</code> shows it here, <code>.save(folder)</code> writes it.</p>"
