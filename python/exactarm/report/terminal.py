"""A report as terminal text: the verdict first, then the numbers, then the warnings."""

from __future__ import annotations

import textwrap

from exactarm.report.numbers import common_unit, format_cells
from exactarm.report.sections import Estimate, Highlight, Highlights, Quantity, Report, Table, Text

WIDTH = 100
MOST_ROWS = 40
LEAST_TEXT_WIDTH = 30


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
                                     *(_wrap(paragraph, width, "  ") for paragraph in section.paragraphs)]))
    blocks += [_wrap(f"warning: {item}", width, hanging="  ") for item in report.warnings]
    return "\n\n".join(blocks) + "\n"


def _wrap(text: str, width: int, indent: str = "", hanging: str = "") -> str:
    return textwrap.fill(" ".join(text.split()), width, initial_indent=indent,
                         subsequent_indent=indent + hanging,
                         break_long_words=False, break_on_hyphens=False)


def highlight_texts(highlight: Highlight) -> tuple[str, str | None]:
    """The number and the number before, both with the same unit."""
    if highlight.before is None:
        return format_cells([highlight.value])[0], None
    value, before = format_cells([highlight.value, highlight.before])
    return value, before


def _highlights(section: Highlights) -> list[str]:
    width = max(len(highlight.label) for highlight in section.items)
    lines = []
    for highlight in section.items:
        value, before = highlight_texts(highlight)
        lines.append(f"  {highlight.label:<{width}}  " + (f"{before} → {value}" if before else value))
    return lines


def columns_of(table: Table) -> tuple[list[str], list[list[str]], list[bool]]:
    """Header with units, the columns as text, and which of them are numbers."""
    header, columns, numeric = [], [], []
    for name, cells in zip(table.header, zip(*table.rows) if table.rows else [()] * len(table.header)):
        unit = common_unit(cells)
        header.append(f"{name} [{unit}]" if unit else name)
        columns.append(format_cells(cells, with_unit=unit is None))
        numeric.append(any(isinstance(cell, (int, Quantity, Estimate)) for cell in cells))
    return header, columns, numeric


def _table(table: Table, width: int) -> str:
    header, columns, numeric = columns_of(table)
    columns = [column[:MOST_ROWS] for column in columns]
    widths = [max(len(text) for text in [name, *column]) for name, column in zip(header, columns)]
    if not numeric[-1]:  # a last column of text is wrapped in its own place
        widths[-1] = min(widths[-1], max(width - sum(widths[:-1]) - 2 * len(widths), LEAST_TEXT_WIDTH))

    def line(cells: list[str]) -> str:
        last = textwrap.wrap(cells[-1], max(widths[-1], 1), break_long_words=False) or [""]
        padded = [f"{text:>{size}}" if right else f"{text:<{size}}"
                  for text, size, right in zip([*cells[:-1], last[0]], widths, numeric)]
        indent = " " * (sum(widths[:-1]) + 2 * len(widths))
        return "\n".join([("  " + "  ".join(padded)).rstrip(), *(indent + text for text in last[1:])])

    lines = [table.heading, line(header), *(line(list(row)) for row in zip(*columns))]
    left_out = len(table.rows) - MOST_ROWS
    if left_out > 0:
        lines.append(f"  ... {left_out} more in report.html")
    if table.note:
        lines.append(_wrap(table.note, width, "  "))
    return "\n".join(lines)
