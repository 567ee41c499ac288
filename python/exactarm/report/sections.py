"""A report before it is rendered: a verdict, then sections.

It knows results only: names, numbers with units, and how to draw its figures. A figure is drawn when a
renderer asks for it, and only then is matplotlib imported.
Units of numbers are SI ("m", "rad", "Nm", "rad/s", ...); the renderers choose mm, mrad, ...
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

LONGEST_NAME = 80  # of a figure's file, in characters: file systems end at 255 bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing


@dataclass(frozen=True)
class Quantity:
    """A number with its SI unit; None prints as a dash. `exact`: a declared one, with all its digits up to
    six. `decimals`: so many are shown, where something else in the table says how many count."""

    value: float | None
    unit: str = ""
    exact: bool = False
    decimals: int | None = None


@dataclass(frozen=True)
class Estimate:
    """An estimated number with its 95 % interval, SI unit. No interval: low and high are None."""

    value: float | None
    low: float | None
    high: float | None
    unit: str = ""


@dataclass(frozen=True)
class Link:
    """A file beside the report; the terminal shows its path."""

    target: str
    text: str


Cell = str | int | None | Quantity | Estimate | Link


@dataclass(frozen=True)
class Table:
    """Rows of cells under a header. `emphasis` names the row (from 0) that matters most."""

    heading: str
    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    emphasis: int | None = None

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows):
            if len(row) != len(self.header):
                raise ValueError(f"table {self.heading!r}, row {number}: {len(row)} cells, expected "
                                 f"{len(self.header)}")


@dataclass(frozen=True)
class Figure:
    """A plot: `name` is its file stem, `build` draws it, `alt` says in words what it shows.

    The name also becomes part of ids and of a path, so of what it was made from (a path file's name, a
    column's) only letters, digits, `_` and `-` are kept.
    panel: draws it on given axes, for a plot of one panel. Both are partial functions of arrays, so that a
    report can be pickled. main: of several panels the most telling one, which given axes take.
    """

    name: str
    heading: str
    build: Callable[[], Drawing]
    caption: str
    alt: str
    panel: Callable[[Axes], None] | None = None
    main: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", re.sub(r"[^\w-]", "_", self.name)[:LONGEST_NAME] or "figure")


@dataclass(frozen=True)
class Highlight:
    """One number that matters most, and what it was before."""

    label: str
    value: Quantity
    before: Quantity | None = None


@dataclass(frozen=True)
class Highlights:
    """The few numbers that a reader must not miss, shown large, right after the verdict."""

    items: tuple[Highlight, ...]


@dataclass(frozen=True)
class Text:
    """A heading and paragraphs. One that is `code` alone is a line to copy: it is never broken."""

    heading: str
    paragraphs: tuple[str, ...]


def line_to_copy(paragraph: str) -> str | None:
    """The line of such a paragraph."""
    found = re.fullmatch(r"`([^`]+)`", paragraph)
    return found and found[1]


@dataclass(frozen=True)
class Warnings:
    """What the reader should act on; prints last on a terminal, before the figures on the page."""

    items: tuple[str, ...]


Section = Highlights | Table | Figure | Text | Warnings
Tone = Literal["good", "caution", "bad", "plain"]


@dataclass(frozen=True)
class Report:
    """Title, the verdict in one sentence, the sections. `tone` colours the verdict."""

    title: str
    verdict: str
    sections: tuple[Section, ...] = ()
    tone: Tone = "plain"
    # robot, files, seed ...: filled by the command line
    details: dict[str, str] = field(default_factory=dict)

    @property
    def warnings(self) -> tuple[str, ...]:
        return tuple(item for section in self.sections if isinstance(section, Warnings)
                     for item in section.items)

    @property
    def figures(self) -> tuple[Figure, ...]:
        return tuple(section for section in self.sections if isinstance(section, Figure))

    def __post_init__(self) -> None:
        seen: dict[str, int] = {}
        object.__setattr__(self, "sections", tuple(_renamed(section, seen) for section in self.sections))


def _renamed(section: Section, seen: dict[str, int]) -> Section:
    """A figure whose name is taken gets a number."""
    if not isinstance(section, Figure):
        return section
    seen[section.name] = seen.get(section.name, 0) + 1
    return (
        section if seen[section.name] == 1 else replace(section, name=f"{section.name}_{seen[section.name]}"))
