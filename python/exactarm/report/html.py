"""A report as one HTML file: styles and plots inside it, nothing fetched, readable light, dark and printed.

Names from outside (files, columns, robots) are text here and nothing else: the template escapes them, figures
have plain names (sections.py), and the page's content security policy lets no script run and nothing be
fetched.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from exactarm.report.plots.files import Drawing
from exactarm.report.sections import Figure, Highlights, Link, Report, Table, Text, line_to_copy
from exactarm.report.terminal import columns_of, highlight_texts

TEMPLATE = Path(__file__).parent / "page.html"
SHORT_CELL = 24  # a column of such cells is never broken
WIDE_TABLE = 6  # columns from which a table is set closer
STACKED_TABLE = 3  # columns from which a phone shows each row as a block of lines


def render_html(report: Report, drawings: Sequence[Drawing] = ()) -> str:
    """The page; `drawings` are the report's figures in their order."""
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True,
                                     undefined=jinja2.StrictUndefined)
    environment.filters["prose"] = _prose
    environment.tests["line"] = line_to_copy
    template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
    pending = list(drawings)
    blocks = []
    for section in report.sections:
        if isinstance(section, Highlights):
            blocks.append(("highlights", highlight_texts(section)))
        elif isinstance(section, Table) and section.rows:
            blocks.append(("table", _table(section)))
        elif isinstance(section, Figure):
            blocks.append(("figure", {"section": section, "svg": _inline_svg(pending.pop(0).svg, section)}))
        elif isinstance(section, Text):
            blocks.append(("text", section))
    return template.render(report=report, blocks=blocks)


def render_verdict_html(report: Report) -> str:
    """Title, verdict, the main numbers and the first table, as a piece of a page (for notebooks)."""
    parts = [Markup("<p><strong>{}</strong><br>{}</p>").format(report.title, report.verdict)]
    for section in report.sections:
        if isinstance(section, Highlights):
            for label, value, before in highlight_texts(section):
                text = f"{before} → {value}" if before else value
                parts.append(Markup("<div>{}: <strong>{}</strong></div>").format(label, text))
    table = next((section for section in report.sections if isinstance(section, Table) and section.rows),
                 None)
    if table is not None:
        header, columns, _ = columns_of(table)
        head = Markup("").join(Markup("<th>{}</th>").format(name) for name in header)
        rows = (Markup("").join(Markup("<td>{}</td>").format(cell) for cell in row) for row in zip(*columns))
        body = Markup("").join(Markup("<tr>{}</tr>").format(row) for row in rows)
        parts.append(Markup(
            "<table><caption>{}</caption><thead><tr>{}</tr></thead><tbody>{}</tbody></table>").format(
            table.heading, head, body))
    parts += [Markup("<p>warning: {}</p>").format(item) for item in report.warnings]
    return str(Markup("").join(parts))


def _table(table: Table) -> dict:
    header, columns, numeric = columns_of(table)
    rows = [[_link(cell) if isinstance(cell, Link) else text for cell, text in zip(cells, texts)]
            for cells, texts in zip(table.rows, zip(*columns))]
    read = zip(*([cell.text if isinstance(cell, Link) else text for cell, text in zip(cells, texts)]
                 for cells, texts in zip(table.rows, zip(*columns))))
    short = [max(map(len, column)) <= SHORT_CELL for column in read]
    return {"section": table, "header": header, "rows": rows, "numeric": numeric, "short": short,
            "wide": len(header) >= WIDE_TABLE, "stack": len(header) >= STACKED_TABLE}


def _link(cell: Link) -> Markup:
    return Markup('<a href="{}">{}</a>').format(cell.target, cell.text)


def _prose(text: str) -> Markup:
    """Text with its `code` marked, and an option or a hash that no line end cuts."""
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    marked = re.sub(r"(?<![\w-])--[a-z][a-z-]*", r'<span class="whole">\g<0></span>', marked)
    return Markup(re.sub(r"\bSHA-256( [0-9a-f]+)?", r'<span class="whole">\g<0></span>', marked))


def _inline_svg(svg: str, figure: Figure) -> Markup:
    """The <svg> element alone, its ids made unique on the page, scaled by its view box."""
    element = svg[svg.index("<svg"):]
    element = re.sub(r"<metadata>.*?</metadata>", "", element, flags=re.DOTALL)
    element = re.sub(r'\b(id=")', rf"\1{figure.name}-", element)
    element = re.sub(r'((?:xlink:)?href="#)', rf"\1{figure.name}-", element)
    element = element.replace("url(#", f"url(#{figure.name}-")
    head, body = element.split(">", 1)
    head = re.sub(r'\s(?:width|height)="[^"]*"', "", head)
    return Markup(f'{head} role="img" aria-label="{escape(figure.alt)}">{body}')
