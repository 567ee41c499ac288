"""Tables on disk: CSV and Parquet with one header row, read strictly and written atomically.

`read_table` gives {name: numbers (N,) float64, or list of str for the columns named in `text`} and
refuses, in one line that names file, row (1 = first data row), column and what was expected: an
unreadable or empty file, names missing or given twice, rows of another length, cells that are no
finite number or beyond 1e30. `write_table` is its inverse, exact to the last bit.
"""

import csv
import hashlib
import io
import os
import re
import reprlib
from collections.abc import Callable, Collection, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from exactarm.errors import InputError
from exactarm.files.arrow_columns import column_of, numbers_of
from exactarm.files.csv_dialect import Dialect, dialect_of, header_start, is_number, split_header
from exactarm.files.examples import meant_example
from exactarm.files.file_bytes import file_bytes
from exactarm.files.free_memory import GIGABYTE, SHARE, free_bytes
from exactarm.files.memory_table import MemoryTable, cell_text

LARGEST_NUMBER = 1e30  # its square and the square's sum over all rows are still numbers
_COPIES = 2.0  # of a Parquet file's numbers: Arrow's, and the table's
_NOT_BLANK = re.compile(rb"\S")
_PLAIN = Dialect(",", ".")
_NO_CSV = {b"PK\x03\x04": "an Excel workbook or another archive", b"\xd0\xcf\x11\xe0": "an Excel workbook",
           b"\xff\xfe": "text in UTF-16", b"\xfe\xff": "text in UTF-16"}  # first bytes -> what it is


@dataclass(frozen=True)
class Table:
    """The columns of one file in its order, and the SHA-256 of its bytes."""

    columns: dict[str, np.ndarray]
    sha256: str
    rows: int


def read_table(path: str | Path | MemoryTable, text: Collection[str] = (),
               may_be_empty: Callable[[list[str]], Collection[str]] = lambda names: ()) -> Table:
    """All columns of a CSV or Parquet file, or of a table in memory; those named in `text` as strings.

    may_be_empty(names of all columns): those in which an empty cell is no fault but NaN.
    """
    if isinstance(path, MemoryTable):
        path, arrow, sha256 = path.label, _memory(path, text, may_be_empty), path.sha256
    else:
        content = _read_bytes(path)
        arrow = (_parquet(path, content, text) if _is_parquet(path)
                 else _csv(path, content, text, may_be_empty))
        sha256 = hashlib.sha256(content).hexdigest()
    if arrow.num_rows == 0:
        raise InputError("no data rows below the header; expected at least one", file=path)
    gaps = may_be_empty(arrow.column_names)
    columns = {name: _numpy(path, name, arrow.column(i), name in text, name in gaps)
               for i, name in enumerate(arrow.column_names)}
    return Table(columns, sha256, arrow.num_rows)


def column_names(path: str | Path | MemoryTable) -> list[str]:
    """The names in the header of a table."""
    if isinstance(path, MemoryTable):
        return path.names
    content = _read_bytes(path)
    if _is_parquet(path):
        return parquet_table(path, content).column_names
    return _csv_header(path, content)[0]


def write_table(path: str | Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of one length, as Parquet or CSV after the name's ending; whole or not at all."""
    table = pa.table({name: column_of(np.asarray(values)) for name, values in columns.items()})
    with atomic_file(path) as temporary:
        if _is_parquet(path):
            pa.parquet.write_table(table, temporary)
            return
        with open(temporary, "wb") as file:
            # Arrow would quote every name.
            file.write((",".join(table.column_names) + "\n").encode())
            pa.csv.write_csv(table, file, pa.csv.WriteOptions(include_header=False, quoting_style="needed"))


@contextmanager
def atomic_file(path: str | Path):
    """A temporary path beside `path` that replaces it when the block ends well, and vanishes when not."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _is_parquet(path: str | Path) -> bool:
    return Path(path).suffix.lower() in (".parquet", ".pq")


def _read_bytes(path: str | Path) -> bytes:
    try:
        content = file_bytes(path)
    except FileNotFoundError:
        meant = meant_example(path)
        hint = f"; did you mean the shipped {meant}?" if meant else ""
        raise InputError(f"no such file; expected a CSV or Parquet file{hint}", file=path) from None
    except IsADirectoryError:
        raise InputError("is a directory; expected a CSV or Parquet file", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None
    if not _NOT_BLANK.search(content):
        raise InputError("is empty; expected a header row and data", file=path)
    if not _is_parquet(path):
        for start, what in _NO_CSV.items():
            if content.startswith(start):
                raise InputError(f"is {what}; expected a CSV file in UTF-8 (Excel: save as CSV UTF-8)",
                                 file=path)
    return content


# -- CSV ---------------------------------------------------------------------------------------------
def _csv(path: str | Path, content: bytes, text: Collection[str], may_be_empty: Callable) -> pa.Table:
    names, delimiter, start = _csv_header(path, content)
    _check_names(path, names)
    body = pa.py_buffer(content)[start:]
    if not _NOT_BLANK.search(body):
        raise InputError("no data rows below the header; expected at least one", file=path)
    types = {name: pa.string() if name in text else pa.float64() for name in names}
    dialect = dialect_of(delimiter, body)
    try:
        return _parse_csv(body, names, types, dialect)
    except pa.ArrowInvalid as error:
        return _csv_cell_by_cell(path, body, names, text, may_be_empty(names), dialect, error)


def _parse_csv(body: pa.Buffer, names: list[str], types: Mapping[str, pa.DataType],
               dialect: Dialect) -> pa.Table:
    return pa.csv.read_csv(
        pa.BufferReader(body),
        parse_options=pa.csv.ParseOptions(delimiter=dialect.delimiter),
        read_options=pa.csv.ReadOptions(column_names=names, block_size=1 << 23),
        # An empty cell is a fault to be named, not a missing value.
        convert_options=pa.csv.ConvertOptions(column_types=dict(types), null_values=[],
                                              strings_can_be_null=False, decimal_point=dialect.decimal),
    )


def _csv_header(path: str | Path, content: bytes) -> tuple[list[str], str, int]:
    """Names in the first line, what parts them, and where the data start."""
    bom = header_start(content)
    end = content.find(b"\n", bom)
    end = len(content) if end < 0 else end + 1
    try:
        line = content[bom:end].decode()
    except UnicodeDecodeError:
        raise InputError("first line is no text in UTF-8; expected a header row (Excel: save as CSV UTF-8)",
                         file=path) from None
    if "\0" in line:
        raise InputError("first line is no text; expected a header row", file=path)
    if "\r" in line.rstrip("\r\n"):
        raise InputError("lines end in a carriage return alone; expected a line feed", file=path)
    try:
        names, delimiter = split_header(line)
    except csv.Error as error:
        raise InputError(f"first line is no header row: {error}", file=path) from None
    return names, delimiter, end


def _check_names(path: str | Path, names: list[str]) -> None:
    if not names:
        raise InputError("first line is empty; expected a header row with the names of the columns",
                         file=path)
    if all(is_number(name) for name in names):
        raise InputError("first row is numbers; expected a header row with the names of the columns",
                         file=path)
    for position, name in enumerate(names, start=1):
        if not name:
            raise InputError(f"column {position} has no name; expected one", file=path)
        if names.index(name) != position - 1:
            raise InputError("name given twice; expected each column once", file=path, column=name)


def _csv_cell_by_cell(path: str | Path, body: pa.Buffer, names: list[str], text: Collection[str],
                      gaps: Collection[str], dialect: Dialect, error: pa.ArrowInvalid) -> pa.Table:
    """The slow way, taken when the fast one failed: finds the row and the cell that are to blame."""
    try:
        strings = _parse_csv(body, names, {name: pa.string() for name in names}, dialect)
    except pa.ArrowInvalid:
        _refuse_ragged(path, body, names, dialect)
        raise InputError(f"is no CSV file: {str(error).splitlines()[0]}", file=path) from None
    return pa.table({name: strings.column(name) if name in text
                     else _numbers(path, name, strings.column(name), name in gaps, dialect)
                     for name in names})


def _numbers(path: str | Path, name: str, cells: pa.ChunkedArray, may_be_empty: bool,
             dialect: Dialect) -> pa.ChunkedArray:
    """A column's cells as numbers; one by one only where not all are numbers as they stand."""
    if dialect.decimal == ".":
        with suppress(pa.ArrowInvalid):
            return cells.cast(pa.float64())
    found = [np.nan if may_be_empty and not cell.strip() else _number(path, name, row, cell, dialect)
             for row, cell in enumerate(cells.to_pylist(), start=1)]
    return pa.chunked_array([column_of(np.array(found))])


def _refuse_ragged(path: str | Path, body: pa.Buffer, names: list[str], dialect: Dialect) -> None:
    try:
        content = bytes(body).decode()
    except UnicodeDecodeError as error:
        row = bytes(body)[: error.start].count(b"\n") + 1
        raise InputError("is not UTF-8 text (Excel: save as CSV UTF-8)", file=path, row=row) from None
    reader = csv.reader(io.StringIO(content, newline=""), delimiter=dialect.delimiter)
    rows, row = (cells for cells in reader if cells), 0
    try:
        for row, cells in enumerate(rows, start=1):
            if len(cells) < len(names):
                message = f"only {len(cells)} cells; expected {len(names)}"
                raise InputError(message, file=path, row=row, column=names[len(cells)])
            if len(cells) > len(names):
                message = f"{len(cells)} cells; expected {len(names)}, one for each name in the header"
                raise InputError(message, file=path, row=row)
    except csv.Error as error:
        raise InputError(f"is no row of cells: {error}", file=path, row=row + 1) from None


def _number(path: str | Path, name: str, row: int, cell: str, dialect: Dialect) -> float:
    plain = dialect.plain(cell)
    if not is_number(plain):
        if len(cell.split()) == len(name.split()) > 1:
            raise InputError("cells parted by blanks; expected commas, semicolons or tabs", file=path,
                             row=row)
        found = f"{reprlib.repr(cell)}{dialect.ambiguity(cell)}" if cell.strip() else "empty cell"
        raise InputError(f"{found}; expected a number", file=path, row=row, column=name)
    return float(plain)


# -- Parquet -----------------------------------------------------------------------------------------
def parquet_table(path: str | Path, content: bytes) -> pa.Table:
    try:
        file = pa.parquet.ParquetFile(pa.BufferReader(content))
        _check_memory(path, file.metadata)
        return file.read()
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"is no Parquet file: {str(error).splitlines()[0]}", file=path) from None


def _check_memory(path: str | Path, told: pa.parquet.FileMetaData) -> None:
    """A small file can hold a value a thousand million times: in memory every cell is a number."""
    needed, free = _COPIES * 8.0 * told.num_rows * told.num_columns, free_bytes()
    if free is not None and needed > SHARE * free:
        raise InputError(
            f"{told.num_rows} rows of {told.num_columns} columns need {needed / GIGABYTE:.3g} GB of memory, "
            f"{free / GIGABYTE:.3g} GB are free; expected fewer rows", file=path)


def _parquet(path: str | Path, content: bytes, text: Collection[str]) -> pa.Table:
    table = parquet_table(path, content)
    # Row labels that pandas adds are not measured.
    names = [name for name in table.column_names if not name.startswith("__index_level_")]
    _check_names(path, names)
    table = table.select(names)
    for index, name in enumerate(names):
        kind = table.schema.field(index).type
        value = kind.value_type if pa.types.is_dictionary(kind) else kind
        wanted = pa.string() if name in text else pa.float64()
        fits = (pa.types.is_string(value) or pa.types.is_large_string(value)
                if name in text else _is_numeric(value))
        if not fits:
            expected = "text" if name in text else "numbers"
            raise InputError(f"type {kind}; expected {expected}", file=path, column=name)
        table = table.set_column(index, name, table.column(index).cast(wanted, safe=False))
    return table


def _is_numeric(kind: pa.DataType) -> bool:
    tests = (pa.types.is_floating, pa.types.is_integer, pa.types.is_boolean, pa.types.is_decimal)
    return any(test(kind) for test in tests)


# -- in memory ---------------------------------------------------------------------------------------
def _memory(table: MemoryTable, text: Collection[str], may_be_empty: Callable) -> pa.Table:
    _check_names(table.label, table.names)
    gaps = may_be_empty(table.names)
    columns = {}
    for name, values in zip(table.names, table.values, strict=True):
        if name in text or values.dtype.kind not in "biuf":
            cells = pa.chunked_array([column_of(np.array([cell_text(value) for value in values], str))])
            columns[name] = cells if name in text else _numbers(table.label, name, cells, name in gaps,
                                                                _PLAIN)
        else:
            columns[name] = pa.chunked_array([column_of(values.astype(float))])
    return pa.table(columns)


# -- all ---------------------------------------------------------------------------------------------
def _numpy(path: str | Path, name: str, column: pa.ChunkedArray, is_text: bool, has_gaps: bool) -> np.ndarray:
    if is_text:
        return np.array([cell or "" for cell in column.to_pylist()], dtype=object)
    numbers = numbers_of(column)
    finite = np.isfinite(numbers) | (has_gaps & np.isnan(numbers))
    if not finite.all():
        row = int(np.argmin(finite))
        raise InputError(f"{numbers[row]}; expected a finite number", file=path, row=row + 1, column=name)
    sizes = np.nan_to_num(np.abs(numbers))
    if sizes.max(initial=0.0) > LARGEST_NUMBER:
        row = int(np.argmax(sizes))
        raise InputError(f"{numbers[row]}; expected a number of at most {LARGEST_NUMBER:g} in size",
                         file=path, row=row + 1, column=name)
    return numbers
