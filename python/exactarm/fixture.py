"""What is known of a measuring fixture: distances between its contacts, radii, bars (`--fixture
fixture.toml`).

    [[distances]]              [[radii]]                       [[bars]]
    contact = "socket"         contact = "sphere"  # or "ball"  number = 0
    between = [0, 1]           number = 0          # not "ball" zero = "free"  # its zero is estimated
    length_mm = 50.0           radius_mm = 12.7
    sigma_mm = 0.01            sigma_mm = 0.001
    session = 2                session = 2

`ball`: the ball or tip on the flange. `sigma_mm`: standard deviation of the known length, SIGMA_M where it is
not given. Without `session` an entry holds at every session. Lengths in m inside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from exactarm.errors import InputError
from exactarm.toml_file import is_number, read_toml

SIGMA_M = 1e-5  # a workshop measures a fixture to a hundredth of a millimetre
WITH_DISTANCE = ("socket", "plane", "sphere", "bar")
WITH_RADIUS = ("sphere", "ball")


@dataclass(frozen=True)
class Distance:
    """Known distance between two contacts of one kind; of two planes: between their surfaces."""

    contact: str
    between: tuple[int, int]
    length: float
    sigma: float = SIGMA_M
    session: int | None = None


@dataclass(frozen=True)
class Radius:
    """Known radius of a touched sphere, or of the ball on the flange (`number` None)."""

    contact: str
    number: int | None
    length: float
    sigma: float = SIGMA_M
    session: int | None = None


@dataclass(frozen=True)
class Fixture:
    """Everything known; `free_bars`: numbers of the bars (wires) whose zero is not known."""

    distances: tuple[Distance, ...] = ()
    radii: tuple[Radius, ...] = ()
    free_bars: frozenset[int] = frozenset()

    def radius_of(self, contact: str, number: int | None, session: int) -> Radius | None:
        """The entry for one sphere (or the ball) at one session; None = not known."""
        for radius in self.radii:
            if (radius.contact, radius.number) == (contact, number) and radius.session in (None, session):
                return radius
        return None


def load_fixture(path: str | Path) -> Fixture:
    """Reads a fixture file. Raises InputError naming the entry that is wrong."""
    tables = read_toml(path, "a fixture file (.toml)")
    unknown = sorted(set(tables) - set(_ENTRIES))
    if unknown:
        raise InputError(f"unknown table [[{unknown[0]}]]; expected [[{']], [['.join(_ENTRIES)}]]", file=path)
    found = {}
    for name, read in _ENTRIES.items():
        entries = tables.get(name, [])
        if not (isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)):
            raise InputError(f"{name} is no list of tables; expected [[{name}]]", file=path)
        found[name] = [read(_Entry(str(path), f"[[{name}]] entry {place}", entry))
                       for place, entry in enumerate(entries, 1)]
    return Fixture(tuple(found["distances"]), tuple(found["radii"]), frozenset(found["bars"]))


@dataclass(frozen=True)
class _Entry:
    """One table of the file, with the words that name it in a message."""

    path: str
    name: str
    table: dict

    def take(self, key: str, good: Callable[[object], bool], expected: str, default: object = ...) -> object:
        value = self.table.get(key, default)
        if value is ... or (value is not default and not good(value)):
            found = f"{key} missing" if value is ... else f"{key} = {value!r}"
            raise InputError(f"{self.name}: {found}; expected {expected}", file=self.path)
        return value

    def check_keys(self, *known: str) -> None:
        unknown = sorted(set(self.table) - set(known))
        if unknown:
            raise InputError(f"{self.name}: unknown key {unknown[0]}; expected {', '.join(known)}",
                             file=self.path)

    def metres(self, key: str, default: object = ...) -> float:
        return float(self.take(key, _is_length, "a length above 0 in mm", default)) * 1e-3

    def session(self) -> int | None:
        return self.take("session", _is_number, "a whole number", None)


def _distance(entry: _Entry) -> Distance:
    entry.check_keys("contact", "between", "length_mm", "sigma_mm", "session")
    contact = entry.take("contact", lambda v: v in WITH_DISTANCE, f"one of {', '.join(WITH_DISTANCE)}")
    pair = entry.take(
        "between", lambda v: isinstance(v, list) and len(v) == 2 and all(map(_is_number, v)) and v[0] != v[1],
        "two different numbers of contacts",
    )
    return Distance(contact, tuple(pair), entry.metres("length_mm"), entry.metres("sigma_mm", 1e3 * SIGMA_M),
                    entry.session())


def _radius(entry: _Entry) -> Radius:
    entry.check_keys("contact", "number", "radius_mm", "sigma_mm", "session")
    contact = entry.take("contact", lambda v: v in WITH_RADIUS, f"one of {', '.join(WITH_RADIUS)}")
    number = None if contact == "ball" else entry.take("number", _is_number, "the sphere's number")
    return Radius(contact, number, entry.metres("radius_mm"), entry.metres("sigma_mm", 1e3 * SIGMA_M),
                  entry.session())


def _free_bar(entry: _Entry) -> int:
    entry.check_keys("number", "zero")
    entry.take("zero", lambda v: v == "free", '"free"')
    return entry.take("number", _is_number, "the bar's number")


def _is_number(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_length(value: object) -> bool:
    return is_number(value) and math.isfinite(value) and value > 0


_ENTRIES = {"distances": _distance, "radii": _radius, "bars": _free_bar}
