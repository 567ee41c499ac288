"""A table in memory in place of a file: a pandas DataFrame, what turns into one (polars, Arrow), or a
mapping of names to arrays. `read_table` reads it as strictly as a file; str(table) is its name."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from exactarm.errors import InputError


def is_memory_table(data: Any) -> bool:
    """Whether these are columns with names; a type says nothing of itself."""
    if isinstance(data, type):
        return False
    return isinstance(data, Mapping) or (hasattr(data, "columns")
                                         and (hasattr(data, "iloc") or hasattr(data, "to_pandas")))


@dataclass(frozen=True, eq=False)
class MemoryTable:
    """Names (one each column, (N,) in `values`) as they were given."""

    label: str
    names: list[str]
    values: list[np.ndarray]

    @classmethod
    def of(cls, data: Any, number: int) -> MemoryTable:
        label = f"table {number} in memory"
        data = data.to_pandas() if hasattr(data, "to_pandas") else data
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

    def __str__(self) -> str:
        return self.label


def _one_dimensional(label: str, name: str, column: Any) -> np.ndarray:
    try:
        values = np.asarray(column)
    except ValueError:  # rows of several lengths
        values = np.empty((0, 0))
    if values.ndim != 1:
        raise InputError("is no row of cells; expected one value a row", file=label, column=name)
    return values
