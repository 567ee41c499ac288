"""What is known of a measuring fixture: distances between its contacts, radii, bars (`--fixture
fixture.toml`).

    [[distances]]              [[radii]]                       [[bars]]
    contact = "socket"         contact = "sphere"  # or "ball"  number = 0
    between = [0, 1]           number = 0          # not "ball" zero = "free"  # its zero is estimated
    length_mm = 50.0           radius_mm = 12.7
    sigma_mm = 0.01            sigma_mm = 0.001
    session = 2                session = 2

A camera and its flat board ([board] alone: the lens is estimated, the camera is on the flange):

    [board]                                    [camera]
    squares = [9, 7]      # columns, rows       on = "flange"           # or "stand": the board is carried
    square_mm = 25.0                           size_px = [1600, 1200]
    sigma_mm = 0.005                           focal_px = [1400.0, 1400.0]
    marker_mm = 18.0      # to detect corners   centre_px = [800.0, 600.0]
    dictionary = "DICT_5X5_100"                distortion = [-0.1, 0.05, 0.0, 0.0, 0.0]   # k1, k2, p1, p2, k3
                                               given = true            # the lens is not estimated

Another arm that the target touches, ball to ball (columns partner_q_i):

    [partner]
    robot = "other/robot.toml"    # its robot file, beside this one; or a shipped name
    distance_mm = 25.4            # between the two balls' centres: the sum of their radii
    sigma_mm = 0.01

`ball`: the ball or tip on the flange. `sigma_mm`: standard deviation of the known length, SIGMA_M where it is
not given. Without `session` an entry holds at every session. Lengths in m inside.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from exactarm.errors import InputError
from exactarm.files.toml_file import is_number, read_toml
from exactarm.robot.robot import Robot

SIGMA_M = 1e-5  # a workshop measures a fixture to a hundredth of a millimetre
SIGMA_SQUARE_M = 5e-6  # a caliper measures eight squares to 0.04 mm
SHORTEST_MM, LONGEST_MM = 1e-6, 1e6  # what anyone measures; beyond, a unit or a digit is wrong
LEAST_FOCAL = 0.1  # of a picture's longer side: a view of 157 degrees, beyond what the lens model bends
MOST_SQUARES, MOST_PX = 1000, 1e6  # on a side of a board; of a picture, its middle or a focal length
MOST_DISTORTION = 1e3  # of real lenses k1 is below 1, k2 below 10, k3 below 100
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
class CameraSetup:
    """Board and camera: columns, rows of squares; square, sigma: its size and standard deviation; marker (m);
    lens: fx, fy, cx, cy (px), k1, k2, p1, p2, k3, or None; lens_given: it is not estimated; size: of a
    picture, px."""

    columns: int = 9
    rows: int = 7
    square: float = 0.025
    sigma: float = SIGMA_SQUARE_M
    marker: float | None = None
    dictionary: str = ""
    on_flange: bool = True
    size: tuple[int, int] | None = None
    lens: tuple[float, ...] | None = None
    lens_given: bool = False

    @property
    def corners(self) -> int:
        """Inner corners, numbered from 0 row by row."""
        return (self.columns - 1) * (self.rows - 1)

    def corner(self, number: np.ndarray) -> np.ndarray:
        """(K, 3) in squares from the board's outer corner: column, row, 0."""
        row, column = np.divmod(number, self.columns - 1)
        return np.stack([column + 1.0, row + 1.0, np.zeros(len(number))], axis=1)


@dataclass(frozen=True)
class Partner:
    """Another arm that is touched: its robot file as named, the arm itself where a reader was given; distance
    between the centres of the two balls, m, and its standard deviation."""

    file: str
    distance: float
    sigma: float = SIGMA_M
    robot: Robot | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Fixture:
    """Everything known; `free_bars`: numbers of the bars (wires) whose zero is not known."""

    distances: tuple[Distance, ...] = ()
    radii: tuple[Radius, ...] = ()
    free_bars: frozenset[int] = frozenset()
    camera: CameraSetup | None = None
    partner: Partner | None = None

    def radius_of(self, contact: str, number: int | None, session: int) -> Radius | None:
        """The entry for one sphere (or the ball) at one session; None = not known."""
        for radius in self.radii:
            if (radius.contact, radius.number) == (contact, number) and radius.session in (None, session):
                return radius
        return None


def load_fixture(path: str | Path, robots: Callable[[str], Robot] | None = None) -> Fixture:
    """Reads a fixture file; robots: reads the robot file of a partner (without it only its name is kept).
    Raises InputError naming the entry that is wrong."""
    tables = read_toml(path, "a fixture file (.toml)")
    unknown = sorted(set(tables) - set(_ENTRIES) - set(_TABLES))
    if unknown:
        raise InputError(f"unknown table [[{unknown[0]}]]; expected [[{']], [['.join(_ENTRIES)}]], "
                         f"[{'], ['.join(_TABLES)}]", file=path)
    found = {}
    for name, read in _ENTRIES.items():
        entries = tables.get(name, [])
        if not (isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)):
            raise InputError(f"{name} is no list of tables; expected [[{name}]]", file=path)
        found[name] = [read(_Entry(str(path), f"[[{name}]] entry {place}", entry))
                       for place, entry in enumerate(entries, 1)]
    for name in _TABLES:
        if not isinstance(tables.get(name, {}), dict):
            raise InputError(f"{name} is no table; expected [{name}]", file=path)
    if "camera" in tables and "board" not in tables:
        raise InputError("[camera] without [board]; expected squares and square_mm of the board", file=path)
    camera = None
    if "board" in tables:
        camera = _camera(*(_Entry(str(path), f"[{name}]", tables.get(name, {})) for name in _OF_CAMERA))
    partner = None
    if "partner" in tables:
        partner = _partner(_Entry(str(path), "[partner]", tables["partner"]), robots)
    return Fixture(tuple(found["distances"]), tuple(found["radii"]), frozenset(found["bars"]), camera,
                   partner)


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
        return float(self.take(key, _is_length, _LENGTH, default)) * 1e-3

    def session(self) -> int | None:
        return self.take("session", _is_number, "a whole number", None)


def _distance(entry: _Entry) -> Distance:
    entry.check_keys("contact", "between", "length_mm", "sigma_mm", "session")
    contact = entry.take("contact", lambda v: v in WITH_DISTANCE, f"one of {', '.join(WITH_DISTANCE)}")
    pair = entry.take(
        "between", lambda v: isinstance(v, list) and len(v) == 2 and all(map(_is_number, v)) and v[0] != v[1],
        "two different numbers of contacts")
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


def _partner(entry: _Entry, robots: Callable[[str], Robot] | None) -> Partner:
    entry.check_keys("robot", "distance_mm", "sigma_mm")
    named = entry.take("robot", lambda v: isinstance(v, str) and v != "",
                       "the robot file of the other arm, or a shipped name")
    beside = Path(entry.path).parent / named
    file = str(beside) if os.path.isfile(beside) else named
    return Partner(file, entry.metres("distance_mm"), entry.metres("sigma_mm", 1e3 * SIGMA_M),
                   None if robots is None else robots(file))


def _camera(board: _Entry, camera: _Entry) -> CameraSetup:
    board.check_keys("squares", "square_mm", "sigma_mm", "marker_mm", "dictionary")
    camera.check_keys("on", "size_px", "focal_px", "centre_px", "distortion", "given")
    whole = lambda most: lambda v: (isinstance(v, list) and len(v) == 2
                                    and all(_is_number(x) and 2 < x <= most for x in v))
    some = lambda least, most, *count: lambda v: (isinstance(v, list) and len(v) in count
                                                  and all(is_number(x) and least <= x <= most for x in v))
    columns, rows = board.take("squares", whole(MOST_SQUARES),
                               f"columns and rows of squares, as [9, 7], at most {MOST_SQUARES}")
    marker = board.take("marker_mm", _is_length, _LENGTH, None)
    size = camera.take("size_px", whole(MOST_PX), "width and height of the pictures, as [1600, 1200]", None)
    focal = camera.take("focal_px", some(1.0, MOST_PX, 2), "fx and fy above 1, as [1400.0, 1400.0]", None)
    if size is not None and focal is not None and min(focal) < LEAST_FOCAL * max(size):
        raise InputError(f"[camera]: focal_px {focal} for a picture {max(size)} px wide; expected pixels (mm "
                         "over the size of a pixel)", file=camera.path)
    middle = None if size is None else [0.5 * size[0], 0.5 * size[1]]
    centre = camera.take("centre_px", some(-MOST_PX, MOST_PX, 2), "cx and cy, as [800.0, 600.0]", middle)
    bent = camera.take("distortion", some(-MOST_DISTORTION, MOST_DISTORTION, 4, 5),
                       f"k1, k2, p1, p2 and perhaps k3, none beyond {MOST_DISTORTION:g}", [0.0] * 5)
    given = camera.take("given", lambda v: isinstance(v, bool), "true or false", False)
    if (focal is not None and centre is None) or (given and focal is None):
        missing = "centre_px or size_px" if focal is not None else "focal_px"
        raise InputError(f"[camera]: {missing} missing; expected it with what else is given of the lens",
                         file=camera.path)
    lens = None if focal is None else tuple(float(v) for v in [*focal, *centre, *bent, 0.0][:9])
    return CameraSetup(
        columns, rows, board.metres("square_mm"), board.metres("sigma_mm", 1e3 * SIGMA_SQUARE_M),
        None if marker is None else 1e-3 * float(marker),
        board.take("dictionary", lambda v: isinstance(v, str), "a name, as DICT_5X5_100", ""),
        camera.take("on", lambda v: v in ("flange", "stand"), '"flange" or "stand"', "flange") == "flange",
        None if size is None else tuple(size), lens, given)


def _is_number(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_length(value: object) -> bool:
    return is_number(value) and SHORTEST_MM <= value <= LONGEST_MM


_LENGTH = f"a length above 0 in mm, {SHORTEST_MM:g} to {LONGEST_MM:g}"
_OF_CAMERA = ("board", "camera")
_TABLES = (*_OF_CAMERA, "partner")
_ENTRIES = {"distances": _distance, "radii": _radius, "bars": _free_bar}
