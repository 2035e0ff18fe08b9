"""Tables of results: sequences of typed rows."""

from __future__ import annotations

import dataclasses
import html
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

if TYPE_CHECKING:
    import pandas

Row = TypeVar("Row")


def number(value: float | None) -> str:
    """A number for people: three significant digits."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, int):
        return str(value)
    text = f"{value:.3g}"
    return text if "e" not in text or abs(value) < 1e-3 else f"{value:.0f}"


class Table(Sequence[Row], Generic[Row]):
    """Rows of one type (a dataclass), in order.

    ``table[0]``, ``len(table)`` and loops work as on a list; :meth:`to_pandas` gives a data frame. Notebooks show it as a table.
    """

    def __init__(self, rows: Sequence[Row], index: str | None = None, row_type: type[Row] | None = None) -> None:
        self._rows = list(rows)
        self._index = index
        self._type = row_type if row_type is not None else (type(rows[0]) if rows else None)

    @overload
    def __getitem__(self, place: int) -> Row: ...
    @overload
    def __getitem__(self, place: slice) -> list[Row]: ...
    def __getitem__(self, place: Any) -> Any:
        return self._rows[place]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows)

    def __repr__(self) -> str:
        lines = [" ".join(f"{name:>14}" for name in self.columns)]
        lines += [" ".join(f"{cell:>14}" for cell in self._cells(row)) for row in self._rows]
        return "\n".join(lines)

    @property
    def columns(self) -> list[str]:
        """Names of the columns: the fields of a row."""
        return [] if self._type is None else [field.name for field in dataclasses.fields(self._type)]  # type: ignore[arg-type]

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a data frame, one row per element, missing values as NaN. Needs pandas."""
        import pandas

        columns = self.columns
        data = {name: [getattr(row, name) for row in self._rows] for name in columns}
        frame = pandas.DataFrame(data, columns=columns)
        return frame.set_index(self._index) if self._index else frame

    def _cells(self, row: Row) -> list[str]:
        values = [getattr(row, name) for name in self.columns]
        return [
            number(v) if isinstance(v, (int, float)) and not isinstance(v, bool) or v is None else str(v)
            for v in values
        ]

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in self.columns)
        rows = ("".join(f"<td>{html.escape(cell)}</td>" for cell in self._cells(row)) for row in self._rows)
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
