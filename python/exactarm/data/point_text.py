"""Points that a measuring program has written as text: names, groups and x, y, z of each, in m.

    // a comment, as SpatialAnalyzer writes them before the points (also #, % and !)
    Group      Point    X [mm]     Y [mm]     Z [mm]          a header, or none
    monday     p1       512.301    -20.118    834.002         names as far as the program was asked for them

Documented by its maker is what SpatialAnalyzer exports: the name as none, target, group target or
collection group target, then the coordinates in the working frame, parted by commas or spaces, comments
behind `//`, and further columns (tolerances, uncertainties, time, details) if asked for; it joins names as
collection::group::target. Programs of Leica, FARO and API let their user choose the columns; no layout of
theirs is documented in public. So columns are found by what stands in the file, and what could mean two
things is refused: the unit (from the header or --unit), a number that may be a name, more numbers than three
(--layout names the columns then). Polar coordinates are columns named by --layout or --map with their unit
and sense, for no file says these:

    x, y, z = d (sin v cos hz, sin v sin hz, cos v)     hz from x to y, v from z: hz_deg, v_deg, distance_mm

`hz_cw_...` turns the other way, `elevation_...` counts from the plane of x and y. Cylindrical ones are not
read.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from exactarm.data.columns import LENGTH, MOST, POSITION, parse_column
from exactarm.errors import InputError
from exactarm.files.csv_dialect import Dialect, marks_thousands
from exactarm.files.file_bytes import file_bytes
from exactarm.files.memory_table import AnyFile, MemoryTable

UNITS = LENGTH | {"in": 0.0254}
DELIMITERS = (";", "\t", ",", " ")  # in this order: a point of a semicolon file may hold decimal commas
COMMENTS = ("//", "#", "%", "!")
NAMES = {
    "name": {
        "name", "point", "point name", "pointname", "target", "target name", "point id", "pointid", "id"},
    "group": {"group", "group name", "point group", "pointgroup"},
    "collection": {"collection", "collection name"},
}
TEXT_COLUMNS = (("name",), ("group", "name"), ("collection", "group", "name"))  # of one, two, three names
SKIP = "-"
TURN = {"deg": np.pi / 180.0, "rad": 1.0, "gon": np.pi / 200.0}
_POLAR = re.compile(r"(?:(hz_cw|hz|v|elevation)_(deg|rad|gon)|(distance)_(mm|m|in))")
_AXIS = re.compile(r"([xyz])(?:[\s_]*[\[(]?\s*(mm|m|in|inch|inches)\s*[\])]?)?", re.IGNORECASE)


@dataclass(frozen=True)
class Points:
    """N points: names, groups ("" where the file has none), lines of the file (N,), position (N, 3) m.

    extras: further columns by our names, as the file has them; told: what was read in which way, in words.
    """

    names: tuple[str, ...]
    groups: tuple[str, ...]
    lines: np.ndarray
    position: np.ndarray
    extras: dict[str, np.ndarray]
    told: tuple[str, ...]

    def of_groups(self, wanted: Sequence[str], path: AnyFile) -> Points:
        """The points of these groups; of all without any."""
        missing = next((group for group in wanted if group not in self.groups), None)
        if missing is not None:
            known = ", ".join(dict.fromkeys(group or "(none)" for group in self.groups))
            raise InputError(f"--group {missing}: no such group; expected one of {known}", file=path)
        rows = [i for i, group in enumerate(self.groups) if not wanted or group in wanted]
        take = lambda values: tuple(values[i] for i in rows)
        extras = {name: values[rows] for name, values in self.extras.items()}
        return Points(take(self.names), take(self.groups), self.lines[rows], self.position[rows], extras,
                      self.told)


@dataclass(frozen=True)
class _Rows:
    """Cells of all data lines, with their line numbers; header: of the line before them, or None."""

    cells: list[list[str]]
    lines: list[int]
    header: list[str] | None
    skipped: list[int]
    dialect: Dialect


def read_points(path: AnyFile, unit: str | None = None, layout: str | None = None,
                columns: Mapping[str, str] | None = None) -> Points:
    """Points of one file, or of a table in memory. unit: of x, y, z where the header has none; layout: names
    of the columns, as "group,name,x,y,z" (`-`: not wanted); columns: the header's names -> ours."""
    rows = _read(path)
    names, where = _columns(path, rows, layout, columns or {})
    number = lambda i: _numbers(path, rows, i, names[i])
    axes = [_axis_of(name) for name in names]
    if any(map(_POLAR.fullmatch, names)):
        position = _from_polar(names, number)
    else:
        factors = _factors(path, names, unit)
        position = np.stack([factors[axis] * number(axes.index(axis)) for axis in POSITION], axis=1)
    beyond = np.abs(position).max(axis=1) > MOST["x"]
    if beyond.any():
        raise InputError(f"a coordinate beyond {MOST['x']:g} m", file=path, line=rows.lines[beyond.argmax()])
    extras = {name: number(i) for i, name in enumerate(names)
              if name not in (SKIP, *NAMES) and axes[i] is None and not _POLAR.fullmatch(name)}
    marks = {key: [row[names.index(key)].strip() for row in rows.cells] for key in NAMES if key in names}
    found, groups = _split_names(marks, len(rows.cells))
    told = [f"{len(found)} points; columns {', '.join(names)} {where}",
            *([f"not read: line {', '.join(map(str, rows.skipped))}"] if rows.skipped else [])]
    return Points(found, groups, np.array(rows.lines), position, extras, tuple(told))


def header_names(path: AnyFile) -> list[str]:
    """Names in the header of a file of points; empty where it has none."""
    return [cell.strip() for cell in _read(path).header or []]


def _read(path: AnyFile) -> _Rows:
    if isinstance(path, MemoryTable):
        return _Rows(path.texts, list(range(2, path.rows + 2)), path.names, [], Dialect(",", "."))
    return _rows(path, _text(path))


def _text(path: str | Path) -> str:
    try:
        content = file_bytes(path)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); expected a text file of points",
                         file=path) from None
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")  # names alone can hold such letters
    if "\0" in text:
        raise InputError("is no text; expected a text file of points", file=path)
    return text


# -- lines and cells ---------------------------------------------------------------------------------------
def _rows(path: str | Path, text: str) -> _Rows:
    """By the first delimiter that parts all lines from the first point on into the same number of cells."""
    lines = [(i, line) for i, line in enumerate(text.splitlines(), start=1)
             if line.strip() and not line.lstrip().startswith(COMMENTS)]
    tried: list[tuple[int, str, int]] = []  # points read, why no more, line
    for delimiter in DELIMITERS:
        parted = [(i, _cells(line, delimiter)) for i, line in lines]
        first = next((k for k, (_, cells) in enumerate(parted) if _count(cells) >= 3), None)
        if first is None:
            continue
        data, width = parted[first:], len(parted[first][1])
        bad = next((k for k, (_, cells) in enumerate(data) if len(cells) != width or _count(cells) < 3), None)
        if bad is not None:
            line, cells = data[bad]
            tried.append((bad, f"{len(cells)} cells, {_count(cells)} of them numbers; expected {width} as in "
                          f"line {data[0][0]}, 3 of them numbers at least", line))
            continue
        before = parted[:first]
        if before and len(before[-1][1]) == width and _count(before[-1][1]) >= 2:
            line, cells = before[-1]  # no header: a point whose numbers cannot all be read
            raise InputError(f"{width} cells, {_count(cells)} of them numbers; expected 3 of them as in line "
                             f"{data[0][0]}, or the names of the columns", file=path, line=line)
        headed = bool(before) and len(before[-1][1]) == width and _count(before[-1][1]) < 2
        commas = any("," in cell and _is_number(cell) for _, cells in data for cell in cells)
        return _Rows(
            [cells for _, cells in data], [i for i, _ in data], before[-1][1] if headed else None,
            [i for i, _ in (before[:-1] if headed else before)], Dialect(delimiter, "," if commas else "."))
    if tried:
        _, why, line = max(tried)
        raise InputError(why, file=path, line=line)
    raise InputError("no point was found; expected lines with x, y, z, parted by commas, semicolons, tabs or "
                     "spaces", file=path)


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        found = next(csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        return []
    cells = [cell.strip() for cell in found]
    if delimiter == " ":
        return [cell for cell in cells if cell]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _is_number(cell: str) -> bool:
    return re.fullmatch(r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?", cell) is not None


def _is_meant(cell: str) -> bool:
    """Whether a cell is meant as a number; one with a mark between its thousands is refused by its column."""
    return _is_number(cell) or marks_thousands(cell)


def _count(cells: Sequence[str]) -> int:
    return sum(map(_is_meant, cells))


def _numbers(path: AnyFile, rows: _Rows, index: int, name: str) -> np.ndarray:
    values = np.empty(len(rows.cells))
    for k, cells in enumerate(rows.cells):
        cell = rows.dialect.plain(cells[index])
        try:
            values[k] = float(cell) if _is_number(cell) else np.nan
        except ValueError:
            values[k] = np.nan
        if not np.isfinite(values[k]):
            found = f"{cells[index][:40]!r}{rows.dialect.ambiguity(cells[index])}"
            raise InputError(f"{found}; expected a number", file=path, line=rows.lines[k], column=name)
    return values


# -- which column is what ----------------------------------------------------------------------------------
def _columns(path: AnyFile, rows: _Rows, layout: str | None,
             given: Mapping[str, str]) -> tuple[list[str], str]:
    """Our name of every column, SKIP where it is not wanted; and where the names come from."""
    width = len(rows.cells[0])
    if layout is not None:
        names = [name.strip() for name in layout.split(",")]
        if len(names) > width:
            raise InputError(f"--layout names {len(names)} columns, the points have {width}", file=path,
                             line=rows.lines[0])
        names, where = names + [SKIP] * (width - len(names)), "by --layout"
    elif rows.header is not None:
        names, where = [_ours(cell.strip(), given) for cell in rows.header], "by the header"
    else:
        names, where = _by_content(path, rows), "by what stands in them"
    for name in names:
        if name not in (SKIP, *NAMES) and _axis_of(name) is None and not _POLAR.fullmatch(name):
            parse_column(name, str(path))  # refuses what would be refused in a table
        if name != SKIP and names.count(name) > 1:
            raise InputError("given twice; expected each column once", file=path, column=name)
    polar = [match[1] or match[3] for name in names if (match := _POLAR.fullmatch(name))]
    if polar and (len(polar) != 3 or "distance" not in polar or any(map(_axis_of, names))
                  or len({"hz", "hz_cw"} & set(polar)) != 1):
        raise InputError(f"polar columns {', '.join(polar)}; expected hz or hz_cw, v or elevation, distance, "
                         "and no x, y, z", file=path)
    for axis in () if polar else POSITION:
        if sum(_axis_of(name) == axis for name in names) != 1:
            told = f"found {', '.join(rows.header)}" if rows.header else f"found {', '.join(names)}"
            raise InputError(f"no column {axis}, or more than one ({told}); expected --map THEIRS={axis}_mm, "
                             "or --layout", file=path)
    return names, where


def _ours(cell: str, given: Mapping[str, str]) -> str:
    if cell in given:
        return given[cell]
    for key, known in NAMES.items():
        if cell.lower() in known:
            return key
    return cell.lower() if _AXIS.fullmatch(cell) or _POLAR.fullmatch(cell.lower()) else SKIP


def _from_polar(names: Sequence[str], number: Callable[[int], np.ndarray]) -> np.ndarray:
    """(N, 3) m of columns hz or hz_cw, v or elevation, distance."""
    found = {}
    for i, name in enumerate(names):
        if match := _POLAR.fullmatch(name):
            found[match[1] or match[3]] = number(i) * (TURN[match[2]] if match[1] else UNITS[match[4]])
    hz = found["hz"] if "hz" in found else -found["hz_cw"]
    v = found["v"] if "v" in found else 0.5 * np.pi - found["elevation"]
    direction = np.stack([np.sin(v) * np.cos(hz), np.sin(v) * np.sin(hz), np.cos(v)], axis=1)
    return found["distance"][:, None] * direction


def _by_content(path: AnyFile, rows: _Rows) -> list[str]:
    """Names first, then exactly three numbers."""
    width = len(rows.cells[0])
    texts = [i for i in range(width) if not all(_is_meant(cells[i]) for cells in rows.cells)]
    if texts != list(range(len(texts))) or width - len(texts) != 3 or len(texts) > len(TEXT_COLUMNS):
        raise InputError(
            f"{width} columns, {width - len(texts)} of them numbers, and no header that names them: a number "
            "may be a name, a coordinate or something else; expected --layout, as group,name,x,y,z",
            file=path, line=rows.lines[0])
    return [*(TEXT_COLUMNS[len(texts) - 1] if texts else ()), *POSITION]


def _axis_of(name: str) -> str | None:
    match = _AXIS.fullmatch(name)
    return match[1].lower() if match else None


def _factors(path: AnyFile, names: Sequence[str], unit: str | None) -> dict[str, float]:
    """Axis -> factor to m."""
    factors = {}
    for name in names:
        match = _AXIS.fullmatch(name)
        if match is None:
            continue
        own = None if match[2] is None else "in" if match[2].lower().startswith("in") else match[2].lower()
        if own is None and unit is None:
            raise InputError(f"the unit of {match[1]} is not in the file; expected --unit {', '.join(UNITS)}",
                             file=path)
        if own is not None and unit is not None and own != unit:
            raise InputError(f"--unit {unit}, but the file says {own} of {match[1]}", file=path)
        factors[match[1].lower()] = UNITS[own or unit or ""]
    return factors


def _split_names(marks: dict[str, list[str]], count: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and groups; a name alone may hold both, joined by `::`; a collection stands before its group."""
    names, groups = marks.get("name", [""] * count), marks.get("group", [""] * count)
    if "collection" in marks:
        groups = ["::".join(parts) for parts in zip(marks["collection"], groups)]
    if "group" not in marks and any("::" in name for name in names):
        parted = [name.rpartition("::") for name in names]
        names, groups = [part[2] for part in parted], [part[0] for part in parted]
    return tuple(names), tuple(groups)
