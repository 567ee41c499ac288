"""A table in memory in place of a file: a pandas DataFrame, what turns into one (polars, Arrow), or a
mapping of names to arrays. `read_table` reads it as strictly as a file. str(table) is its label, repr(table)
the variable that a call has in its place. Both names a refused row as `table.loc` finds it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.errors import InputError

_LABEL = "table {} in memory"


def is_memory_table(data: Any) -> bool:
    """Whether these are columns with names; a type says nothing of itself."""
    if isinstance(data, type):
        return False
    return isinstance(data, Mapping) or (hasattr(data, "columns")
                                         and (hasattr(data, "iloc") or hasattr(data, "to_pandas")))


class Label(str):
    """What a table in memory is called in place of a path; knows the index of its rows (None: 0, 1, ...)."""

    __slots__ = ("index",)

    def __new__(cls, text: str, index: Any = None) -> Label:
        made = super().__new__(cls, text)
        made.index = index
        return made

    def row_name(self, row: int) -> str:
        """Of row `row`, from 1."""
        label = row - 1 if self.index is None or not 0 < row <= len(self.index) else self.index[row - 1]
        return f"row index {repr(label) if isinstance(label, str) else label}"


@dataclass(frozen=True, eq=False)
class MemoryTable:
    """Names (one each column, (N,) in `values`) as they were given."""

    label: Label
    names: list[str]
    values: list[np.ndarray]

    @classmethod
    def of(cls, data: Any, which: int | str) -> MemoryTable:
        """which: its place among several, from 1, or the name of the argument."""
        data = data.to_pandas() if hasattr(data, "to_pandas") else data
        index = getattr(data, "index", None)
        label = Label(_LABEL.format(which), index)
        inside = [name for name in getattr(index, "names", ()) if isinstance(name, str) and name not in data]
        if inside:  # a column that was made the index is read all the same
            data = data.reset_index(level=inside)
        given = list(data) if isinstance(data, Mapping) else list(data.columns)
        columns = ([data[name] for name in given] if isinstance(data, Mapping)
                   else [data.iloc[:, i] for i in range(len(given))])
        for name in given:
            if not isinstance(name, str):
                raise InputError(f"name {name!r} is no text; expected the names of columns as in a CSV file",
                                 file=label)
        values = [_one_dimensional(label, name, column) for name, column in zip(given, columns, strict=True)]
        for name, column in zip(given, values, strict=True):
            if len(column) != len(values[0]):
                raise InputError(f"{len(column)} rows; expected {len(values[0])} as in column {given[0]}",
                                 file=label, column=name)
        return cls(label, given, values)

    @property
    def sha256(self) -> str:
        """Of names, types and cells."""
        digest = hashlib.sha256()
        for name, column in zip(self.names, self.values, strict=True):
            cells = repr(column.tolist()).encode() if column.dtype.kind == "O" else column.tobytes()
            digest.update(f"{name}\0{column.dtype.str}\0{len(cells)}\0".encode() + cells)
        return digest.hexdigest()

    @property
    def name(self) -> str:
        """As a path has it."""
        return self.label

    def row_name(self, row: int) -> str:
        """Of row `row`, from 1, in its own index."""
        return self.label.row_name(row)

    @property
    def parquet(self) -> bytes:
        """The same table as the content of a Parquet file; what is no number as text."""
        import pyarrow as pa
        import pyarrow.parquet

        texts = lambda column: list(map(cell_text, column.tolist()))
        cells = lambda column: column if column.dtype.kind in "biuf" else texts(column)
        stream = pa.BufferOutputStream()
        pa.parquet.write_table(pa.table({name: pa.array(cells(column), from_pandas=True)
                                         for name, column in zip(self.names, self.values)}), stream)
        return stream.getvalue().to_pybytes()

    @property
    def texts(self) -> list[list[str]]:
        """Its rows, each cell as a CSV file would hold it."""
        return [list(row) for row in zip(*(map(cell_text, column.tolist()) for column in self.values))]

    @property
    def rows(self) -> int:
        return len(self.values[0]) if self.values else 0

    def __str__(self) -> str:
        return self.label

    def __repr__(self) -> str:
        return variable_of(self.label) or self.label


AnyFile = str | Path | MemoryTable  # of a table


def cell_text(value: object) -> str:
    """As a CSV file would hold it; None and NaN, in whichever way pandas has them, are empty cells."""
    missing = value is None or str(value) in ("<NA>", "NaT", "nan")
    return "" if missing else str(value)


def variable_of(label: str) -> str | None:
    """`table_1` of the label of a table in memory, as a call has it; None of a file."""
    found = re.fullmatch(_LABEL.format(r"(\w+)"), label)
    return found and f"table_{found[1]}"


def _one_dimensional(label: str, name: str, column: Any) -> np.ndarray:
    try:
        values = np.asarray(column)
    except ValueError:  # rows of several lengths
        values = np.empty((0, 0))
    if values.ndim != 1:
        raise InputError("is no row of cells; expected one value a row", file=label, column=name)
    return values
