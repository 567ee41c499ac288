"""How a CSV file parts its columns and writes its numbers: comma, semicolon or tab; a decimal point or comma.

The header decides about the columns: what it holds of the three. Numbers have a decimal comma where columns
are not parted by commas and the rows hold commas; then a point in a number is refused, for 1.234 could mean
either.
"""

import csv
import io
import re
from dataclasses import dataclass

# mark of UTF-8; lines of comment; Excel's line
_BEFORE_HEADER = re.compile(rb"(?:\xef\xbb\xbf)?(?:#[^\n]*\n)*(?:sep=.\r?\n)?")
_LAST_COMMENT = re.compile(rb"#[ \t]*([^\n]*)\n\Z")
# as 1.234,5 or 1,234.5 or 1'234.5; 1,234 alone is a number with a decimal comma, or two columns
_MARKED = re.compile(r"[-+]?\d{1,3}(?:(?:\.\d{3})+,\d+|(?:,\d{3})+\.\d+|(?:['\s]\d{3})+[.,]\d+)")
DELIMITERS = (",", ";", "\t")  # in this order: a header with commas is parted by them


@dataclass(frozen=True)
class Dialect:
    """delimiter between cells; decimal mark of numbers."""

    delimiter: str = ","
    decimal: str = "."

    def plain(self, cell: str) -> str:
        """A number's cell with a decimal point; what would be ambiguous becomes empty."""
        if self.decimal == "." or ("." not in cell and "," not in cell):
            return cell
        return cell.replace(",", ".") if "." not in cell else ""

    def ambiguity(self, cell: str) -> str:
        """Behind the cell, in a message: why it is no number; empty where that is plain to see."""
        if marks_thousands(cell):
            return " (thousands have a mark, which is not read)"
        return " (a point, with decimal commas elsewhere)" if cell and not self.plain(cell) else ""


def marks_thousands(cell: str) -> bool:
    """Whether a cell is a number with a mark between its thousands."""
    return _MARKED.fullmatch(cell) is not None


def header_start(content: bytes) -> int:
    """Where the header begins: behind the mark of UTF-8, lines of comment (`#`), and the line by which Excel
    tells how columns are parted. Where numbers follow, the last comment is the header, as NumPy writes it."""
    match = _BEFORE_HEADER.match(content)
    start = 0 if match is None else match.end()
    comment = _LAST_COMMENT.search(content[:start])
    if comment is None:
        return start
    end = content.find(b"\n", start)
    cells = [_cells(line) for line in (comment[1], content[start : end if end >= 0 else len(content)])]
    numbers = all(is_number(cell.replace(",", ".")) for cell in cells[1])
    return comment.start(1) if len(cells[0]) == len(cells[1]) and numbers else start


def _cells(line: bytes) -> list[str]:
    try:
        return split_header(line.decode())[0]
    except (UnicodeDecodeError, csv.Error):
        return []


def is_number(cell: str) -> bool:
    """Whether a cell with a decimal point is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


def split_header(line: str) -> tuple[list[str], str]:
    """Names in a header line, and the delimiter that parts them; raises csv.Error."""
    best: tuple[list[str], str] = ([], DELIMITERS[0])
    for delimiter in DELIMITERS:
        reader = csv.reader(io.StringIO(line), delimiter=delimiter, skipinitialspace=delimiter != "\t")
        names = [name.strip() for name in next(reader, [])]
        if len(names) > 1:
            return names, delimiter
        best = best if best[0] else (names, delimiter)
    return best


def dialect_of(delimiter: str, body: bytes | memoryview) -> Dialect:
    """The dialect of the rows below a header."""
    return Dialect(delimiter, "," if delimiter != "," and b"," in bytes(body) else ".")
