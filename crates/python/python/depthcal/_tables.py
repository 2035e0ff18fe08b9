"""Results as rows and matrices by name, which pandas can take."""

from __future__ import annotations

import dataclasses
import html
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np

if TYPE_CHECKING:
    import pandas

Row = TypeVar("Row")

#: Rows and columns that are shown in a notebook.
_SHOWN = 60
_SHOWN_COLUMNS = 12


def number(value: float | None) -> str:
    """A number for people: three significant digits."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, int):
        return str(value)
    text = f"{value:.3g}"
    return text if "e" not in text or abs(value) < 1e-3 else f"{value:.0f}"


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table for a notebook; of a long one the beginning, with the number of the rows that are left out."""
    cells = "".join(f"<th>{html.escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(f'<td>{html.escape(c)}</td>' for c in row)}</tr>" for row in rows[:_SHOWN])
    more = f"<p>… and {len(rows) - _SHOWN} more rows</p>" if len(rows) > _SHOWN else ""
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>{more}"


class Table(Sequence[Row], Generic[Row]):
    """Rows of one type (a dataclass), in order.

    ``table[0]``, ``len(table)`` and loops work as on a list. ``table["pinhole.fx"]`` is the row of that name, ``table.names`` has the
    names, ``table.column("value")`` a column; :meth:`to_pandas` gives a data frame. Notebooks show it as a table.
    """

    def __init__(self, rows: Sequence[Row], index: str | None = None, row_type: type[Row] | None = None) -> None:
        self._rows = list(rows)
        self._index = index
        self._type = row_type if row_type is not None else (type(rows[0]) if rows else None)

    @overload
    def __getitem__(self, place: int | str) -> Row: ...
    @overload
    def __getitem__(self, place: slice) -> list[Row]: ...
    def __getitem__(self, place: Any) -> Any:
        if not isinstance(place, str):
            return self._rows[place]
        named = [row for row, name in zip(self._rows, self.names) if name == place]
        if len(named) != 1:
            several = f"{len(named)} rows are called '{place}'" if named else f"no row is called '{place}'"
            raise KeyError(f"{several}; there are {', '.join(dict.fromkeys(self.names)) or 'no names'}")
        return named[0]

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

    @property
    def names(self) -> list[str]:
        """Names of the rows, in order; none where rows have no name of their own."""
        return [] if self._index is None else [getattr(row, self._index) for row in self._rows]

    def column(self, name: str) -> list[Any]:
        """The values of a column, in order."""
        if name not in self.columns:
            raise KeyError(f"no column is called '{name}'; there are {', '.join(self.columns)}")
        return [getattr(row, name) for row in self._rows]

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
        return html_table(self.columns, [self._cells(row) for row in self._rows])


class Matrix:
    """A square matrix whose rows and columns have names.

    ``matrix["pinhole.fx", "pinhole.cx"]`` is an element, ``matrix[["pinhole.fx", "pinhole.cx"]]`` the matrix of these alone, and
    ``numpy.asarray(matrix)`` all of it; :meth:`to_pandas` gives a data frame.
    """

    def __init__(self, names: Sequence[str], values: Any) -> None:
        self.names = list(names)
        """Names of rows and columns, in order."""
        self._values = np.asarray(values, dtype=np.float64)
        self._places = {name: place for place, name in enumerate(self.names)}

    def _place(self, name: str) -> int:
        try:
            return self._places[name]
        except KeyError:
            raise KeyError(f"no parameter is called '{name}'; there are {', '.join(self.names)}") from None

    @overload
    def __getitem__(self, names: tuple[str, str]) -> float: ...
    @overload
    def __getitem__(self, names: list[str]) -> Matrix: ...
    def __getitem__(self, names: Any) -> Any:
        if isinstance(names, tuple) and len(names) == 2:
            return float(self._values[self._place(names[0]), self._place(names[1])])
        if isinstance(names, list):
            places = [self._place(name) for name in names]
            return Matrix(names, self._values[np.ix_(places, places)])
        raise TypeError("give the names of a row and a column, or a list of names")

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self._values, dtype=dtype)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and of columns."""
        return self._values.shape  # type: ignore[return-value]

    def __len__(self) -> int:
        return len(self.names)

    def to_pandas(self) -> pandas.DataFrame:
        """The matrix as a data frame. Needs pandas."""
        import pandas

        return pandas.DataFrame(self._values, index=self.names, columns=self.names)

    def __repr__(self) -> str:
        shown = self.names[:_SHOWN_COLUMNS]
        more = f"\n… and {len(self) - len(shown)} more" if len(self) > len(shown) else ""
        rows = [[name, *(number(float(v)) for v in row)] for name, row in zip(shown, self._values[:, : len(shown)])]
        return "\n".join(" ".join(f"{cell:>14}" for cell in row) for row in [["", *shown], *rows]) + more

    def _repr_html_(self) -> str:
        shown = self.names[:_SHOWN_COLUMNS]
        rows = [
            [name, *(number(float(v)) for v in row)] for name, row in zip(self.names, self._values[:, : len(shown)])
        ]
        return html_table(["", *shown], rows)
