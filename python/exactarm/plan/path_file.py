"""Path files: a shipped name (`line`, `spiral`) or a `.toml` -> PlannedPath, checked key by key.

A value that cannot be used is refused with one line that names the file, the key and what was expected.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.errors import InputError
from exactarm.files.file_bytes import path_of
from exactarm.files.toml_file import fits_shape, is_number, read_toml
from exactarm.plan.reference import Curve, Line, Points, Reference, Spiral, sample_reference

SHIPPED = Path(__file__).parent.parent / "data" / "paths"
MOST_SAMPLES = 2_000_000
NU = 1e-14  # weight of the input where the path says none
_FARTHEST_M = 100.0  # from the base: no arm, with its rail, goes so far
CHOICES = {
    "gear_direction": ("motion", "cw", "ccw"),
    "input": ("acceleration", "jerk"),
    "solver": ("stagewise", "ipopt"),
    "linear_solver": ("mumps", "ma27"),
}
COMMON = {"kind", "duration_s", "rate_hz", "nu", "orientation_wxyz", *CHOICES}


@dataclass(frozen=True)
class PlannedPath:
    """What to follow and how: the curve, its timing and orientation, and the options of the planner."""

    curve: Curve
    duration: float
    rate_hz: float = 1000.0
    nu: float = NU
    orientation_wxyz: np.ndarray = None
    gear_direction: str = "motion"
    input: str = "acceleration"
    solver: str = "stagewise"
    linear_solver: str = "mumps"
    name: str = ""

    def reference(self) -> Reference:
        wxyz = np.array([0.0, 0.0, 0.0, 1.0]) if self.orientation_wxyz is None else self.orientation_wxyz
        return sample_reference(self.curve, wxyz, self.duration, self.rate_hz)

    def lasting(self, duration: float) -> PlannedPath:
        """The same path in another time (s); times of via-points are stretched with it."""
        times = getattr(self.curve, "times", None)
        curve = self.curve if times is None else replace(self.curve, times=times * (duration / times[-1]))
        return replace(self, curve=curve, duration=duration)


def shipped_paths() -> tuple[str, ...]:
    """Names of the paths that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def load_path(name_or_path: str | Path) -> PlannedPath:
    """The path of that shipped name, or of that `.toml` file."""
    expected = f"a path file (.toml) or one of {', '.join(shipped_paths())}"
    path = path_of(name_or_path, expected)
    file = SHIPPED / f"{name_or_path}.toml" if str(name_or_path) in shipped_paths() else path
    table = read_toml(file, expected)
    return _Reader(name_or_path, table).path(file.stem)


class _Reader:
    """Reads one table; every refusal names the file and the key."""

    def __init__(self, file: str | Path, table: dict[str, Any]):
        self.file, self.table = file, table

    def refuse(self, key: str, expected: str) -> InputError:
        found = f"found {reprlib.repr(self.table[key])}" if key in self.table else "is missing"
        return InputError(f"key {key}: {found}, expected {expected}", file=self.file)

    def path(self, name: str) -> PlannedPath:
        kinds: dict[str, tuple[set[str], Callable[[], Curve]]] = {
            "line": ({"start_m", "end_m"}, self._line),
            "spiral": ({"centre_m", "radius_max_m", "turns", "angle_start_rad", "z_start_m", "z_end_m"},
                       self._spiral),
            "points": ({"points_m", "times_s"}, self._points),
        }
        kind = self.table.get("kind")
        if not isinstance(kind, str) or kind not in kinds:
            raise self.refuse("kind", " or ".join(kinds))
        unknown = sorted(set(self.table) - COMMON - kinds[kind][0])
        if unknown:
            raise InputError(f"key {unknown[0]}: unknown, expected one of "
                             f"{', '.join(sorted(COMMON | kinds[kind][0]))}", file=self.file)
        curve = kinds[kind][1]()
        duration = self.number("duration_s", least=0.0, default=self._last_time(curve))
        if isinstance(curve, Points) and curve.times is not None and abs(duration - curve.times[-1]) > 1e-9:
            raise self.refuse("duration_s", f"the last of times_s, {curve.times[-1]}")
        rate = self.number("rate_hz", least=0.0, default=1000.0)
        if not 12 <= duration * rate + 1 <= MOST_SAMPLES:
            raise InputError(f"key rate_hz: {duration * rate + 1:.0f} samples in {duration} s, expected 12 "
                             "to "
                             f"{MOST_SAMPLES}", file=self.file)
        wxyz = self._orientation(curve)
        chosen = {key: self._choice(key, options) for key, options in CHOICES.items()}
        return PlannedPath(curve, duration, rate, self.number("nu", least=0.0, default=NU), wxyz,
                           name=name, **chosen)

    def number(self, key: str, least: float | None = None, default: float | None = None) -> float:
        value = self.table.get(key, default)
        expected = "a number" if least is None else f"a number above {least:g}"
        if not is_number(value) or not np.isfinite(value):
            raise self.refuse(key, expected)
        if least is not None and value <= least:
            raise self.refuse(key, expected)
        return float(value)

    def numbers(self, key: str, shape: tuple[int | None, ...], expected: str) -> np.ndarray:
        if not fits_shape(self.table.get(key), shape):
            raise self.refuse(key, expected)
        found = np.array(self.table[key], float).reshape([-1 if size is None else size for size in shape])
        if key.endswith("_m") and np.abs(found).max(initial=0.0) > _FARTHEST_M:
            raise self.refuse(key, f"{expected}, {_FARTHEST_M:g} m at most (in mm?)")
        return found

    def _line(self) -> Line:
        three = "three coordinates in m"
        return Line(self.numbers("start_m", (3,), three), self.numbers("end_m", (3,), three))

    def _spiral(self) -> Spiral:
        return Spiral(
            self.numbers("centre_m", (2,), "x and y in m"), self.number("radius_max_m", least=0.0),
            self.number("turns", least=0.0), self.number("angle_start_rad"),
            self.number("z_start_m"), self.number("z_end_m"),
        )

    def _points(self) -> Points:
        points = self.numbers("points_m", (None, 3), "a list of points [x, y, z] in m")
        if len(points) < 2 or np.any(np.linalg.norm(np.diff(points, axis=0), axis=1) == 0.0):
            raise self.refuse("points_m", "at least two points, neighbours apart")
        if "times_s" not in self.table:
            return Points(points)
        times = self.numbers("times_s", (len(points),), f"{len(points)} times, one a point")
        if times[0] != 0.0 or np.any(np.diff(times) <= 0.0):
            raise self.refuse("times_s", "times that start at 0 and rise")
        return Points(points, times)

    @staticmethod
    def _last_time(curve: Curve) -> float | None:
        return float(curve.times[-1]) if isinstance(curve, Points) and curve.times is not None else None

    def _orientation(self, curve: Curve) -> np.ndarray:
        value = self.table.get("orientation_wxyz", [0.0, 0.0, 0.0, 1.0])
        single = isinstance(value, list) and bool(value) and not isinstance(value[0], list)
        self.table = self.table | {"orientation_wxyz": [value] if single else value}
        wxyz = self.numbers("orientation_wxyz", (None, 4), "a quaternion [w, x, y, z] or a list of them")
        allowed = {1, 2} | ({len(curve.points)} if isinstance(curve, Points) else set())
        if len(wxyz) not in allowed:
            raise self.refuse("orientation_wxyz", "one, two (from start to end) or one per point")
        norm = np.linalg.norm(wxyz, axis=1, keepdims=True)
        if np.any(np.abs(norm - 1.0) > 0.01):
            raise self.refuse("orientation_wxyz", "quaternions of length 1")
        return wxyz / norm

    def _choice(self, key: str, options: tuple[str, ...]) -> str:
        value = self.table.get(key, options[0])
        if value not in options:
            raise self.refuse(key, " or ".join(options))
        return value
