"""A report as terminal text: the verdict first, then the numbers, then the warnings."""

import re
import textwrap
from collections.abc import Sequence

from exactarm.report.numbers import DASH, common_unit, format_cells, read_beside
from exactarm.report.sections import Cell, Estimate, Highlights, Quantity, Report, Table, Text, line_to_copy

WIDTH = 100
MOST_ROWS = 40
LEAST_TEXT_WIDTH = 30
_UNBROKEN = "\u00a0"  # between a number and its unit


def render_verdict(report: Report, most: int, width: int = WIDTH) -> str:
    """Title, verdict, the numbers that matter most and the warnings, in at most `most` lines."""
    lines = [report.title, *textwrap.wrap(report.verdict, width)]
    for section in report.sections:
        if isinstance(section, Highlights):
            lines += _highlights(section)
    warnings = [textwrap.shorten(f"warning: {item}", width, placeholder=" ...") for item in report.warnings]
    room = max(most - len(lines), 0)
    if len(warnings) > room:
        warnings = [*warnings[: max(room - 1, 0)],
                    f"{len(warnings) - max(room - 1, 0)} more warnings in summary()"]
    return "\n".join([*lines, *warnings][:most])


def render_text(report: Report, width: int | None = None) -> str:
    """The whole report but its figures."""
    width = WIDTH if width is None else width
    blocks = [report.title + "\n" + "=" * len(report.title), _wrap(report.verdict, width)]
    for section in report.sections:
        if isinstance(section, Highlights):
            blocks.append("\n".join(_highlights(section)))
        elif isinstance(section, Table) and section.rows:
            blocks.append(_table(section, width))
        elif isinstance(section, Text):
            blocks.append("\n".join([section.heading,
                                     *(_paragraph(text, width) for text in section.paragraphs)]))
    blocks += [_wrap(f"warning: {item}", width, hanging="  ") for item in report.warnings]
    return "\n\n".join(blocks) + "\n"


def _paragraph(text: str, width: int) -> str:
    line = line_to_copy(text)
    return _wrap(text, width, "  ") if line is None else f"    {line}"


def _wrap(text: str, width: int, indent: str = "", hanging: str = "") -> str:
    whole = re.sub(r"(?<=\d) (?=%|[nµmkM]?(?:m|rad|s|Nm|Hz|g|deg)\b)", _UNBROKEN, " ".join(text.split()))
    return textwrap.fill(whole, width, initial_indent=indent, subsequent_indent=indent + hanging,
                         break_long_words=False, break_on_hyphens=False).replace(_UNBROKEN, " ")


def highlight_texts(section: Highlights) -> list[tuple[str, str, str | None]]:
    """Label, number and the number before of each; numbers of one unit have one prefix, as in a sentence."""
    changed = [cell for item in section.items if item.before is not None
               for cell in (item.value, item.before)]
    texts: list[tuple[str, str, str | None]] = []
    for item in section.items:
        if item.before is None:
            alike = read_beside(item.value, [other.value for other in section.items if other.before is None])
            texts.append((item.label, format_cells([item.value], beside=alike)[0], None))
            continue
        alike = [cell for cell in changed if cell.unit == item.value.unit]
        if read_beside(item.value, alike):
            value, before = format_cells([item.value, item.before], beside=alike)
        else:  # nanometres after millimetres
            value, before = (format_cells([cell], beside=read_beside(cell, alike))[0]
                             for cell in (item.value, item.before))
        texts.append((item.label, value, before))
    return texts


def _highlights(section: Highlights) -> list[str]:
    width = max(len(highlight.label) for highlight in section.items)
    lines = []
    for label, value, before in highlight_texts(section):
        lines.append(f"  {label:<{width}}  " + (f"{before} → {value}" if before else value))
    return lines


def columns_of(table: Table) -> tuple[list[str], list[list[str]], list[bool]]:
    """Header with units, the columns as text, and which of them are numbers."""
    header, columns, numeric = [], [], []
    all_cells = list(zip(*table.rows)) if table.rows else [()] * len(table.header)
    for k, (name, cells) in enumerate(zip(table.header, all_cells)):
        beside = _compared(table.header, all_cells, k)
        unit = common_unit(cells, beside)
        header.append(f"{name} [{unit}]" if unit else name)
        columns.append(format_cells(cells, with_unit=unit is None, beside=beside))
        numeric.append(any(isinstance(cell, (int, Quantity, Estimate)) for cell in cells)
                       or _reads_as_numbers(columns[-1]))
    return header, columns, numeric


_READ_TOGETHER = r"before|after|without|mean|RMS|maximum|std\. dev\."


def _compared(header: Sequence[str], columns: Sequence[Sequence[Cell]], k: int) -> list[Cell]:
    """Numbers of the columns that are read against column `k`, in one SI unit: names that differ in "before",
    "after" or "without" alone, or that are statistics of one error."""
    units = lambda cells: {cell.unit for cell in cells if isinstance(cell, (Quantity, Estimate))}
    stems = [re.sub(rf"\W*\b({_READ_TOGETHER})(?!\w)\W*", "", name) for name in header]
    return [cell for j, cells in enumerate(columns)
            if j != k and header[j] != header[k] and stems[j] == stems[k] and len(units(cells)) == 1
            and units(cells) == units(columns[k]) for cell in cells if isinstance(cell, (Quantity, Estimate))]


def _reads_as_numbers(texts: list[str]) -> bool:
    """Texts that are numbers with or without a unit, such as 1,203, 83 % or 0.2 mm, stand as numbers do."""
    said = [text for text in texts if text not in ("", DASH)]
    return bool(said) and all(re.fullmatch(r"[−+-]?\d[\d,]*(\.\d+)?(e−?\d+)?( [^\s\d]{1,6})?", text)
                              for text in said)


def _table(table: Table, width: int) -> str:
    """The table in `width` columns: headers and texts wrap; what is still too wide continues below, each part
    with the first column."""
    header, columns, numeric = columns_of(table)
    texts = [[name, *column[:MOST_ROWS]] for name, column in zip(header, columns)]
    lines = [table.heading]
    for part in _parts(texts, numeric, width):
        lines += _lines([texts[k] for k in part], [numeric[k] for k in part], width)
    left_out = len(table.rows) - MOST_ROWS
    if left_out > 0:
        lines.append(f"  ... {left_out} more in report.html")
    if table.note:
        lines.append(_wrap(table.note, width, "  "))
    return "\n".join(lines)


def _least(texts: list[str], numeric: bool) -> int:
    """Width below which a column would break a word, or a number."""
    whole = texts[1:] if numeric else []
    words = [word for text in ([texts[0]] if numeric else texts) for word in text.split()]
    return max((len(text) for text in [*whole, *words]), default=0)


def _taken(widths: list[int]) -> int:
    return sum(widths) + 2 * len(widths)


def _parts(texts: list[list[str]], numeric: list[bool], width: int) -> list[list[int]]:
    """Columns that stand side by side, the first in every part."""
    least = [_least(column, number) for column, number in zip(texts, numeric)]
    parts = [[0]]
    for k in range(1, len(texts)):
        if len(parts[-1]) > 1 and _taken([least[j] for j in [*parts[-1], k]]) > width:
            parts.append([0])
        parts[-1].append(k)
    return parts


def _widths(texts: list[list[str]], numeric: list[bool], width: int) -> list[int]:
    """Of the columns: as wide as they are; else a last column of text gives way first, then the widest."""
    widths = [max(len(text) for text in column) for column in texts]
    least = [_least(column, number) for column, number in zip(texts, numeric)]
    if not numeric[-1]:
        room = width - _taken(widths) + widths[-1]
        widths[-1] = min(widths[-1], max(room, LEAST_TEXT_WIDTH, least[-1]))
    while _taken(widths) > width:
        loose = [k for k in range(len(widths)) if widths[k] > least[k]]
        if not loose:
            break
        widths[max(loose, key=lambda k: widths[k])] -= 1
    return widths


def _lines(texts: list[list[str]], numeric: list[bool], width: int) -> list[str]:
    widths = _widths(texts, numeric, width)
    lines = []
    for row, cells in enumerate(zip(*texts)):
        wrapped = [textwrap.wrap(cell, max(size, 1), break_long_words=False, break_on_hyphens=False)
                   for cell, size in zip(cells, widths)]
        height = max(max(map(len, wrapped)), 1)
        for k in range(height):
            # a header stands on its column, a text begins at its row
            at = [k - height + len(cell) if row == 0 else k for cell in wrapped]
            shown = [cell[i] if 0 <= i < len(cell) else "" for cell, i in zip(wrapped, at)]
            padded = [f"{text:>{size}}" if right else f"{text:<{size}}"
                      for text, size, right in zip(shown, widths, numeric)]
            lines.append(("  " + "  ".join(padded)).rstrip())
    return lines
