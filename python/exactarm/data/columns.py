"""The columns of measured data: quantity, index, unit in one name, `theta_3_rad`, `x_mm`, `gyro_z_deg_s`.

`parse_column` turns a header's name into a `Column` with the factor that takes its numbers to SI
(rad, m, s, Nm, A). A name that starts like a known quantity and goes on wrongly (no axis number,
a unit that does not belong to it) is refused, and so is a payload or temperature in another unit; any other
name is a covariate, kept as it is.
"""

import difflib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from exactarm.errors import InputError
from exactarm.files.whole_number import whole_number

ANGLE = {"rad": 1.0, "deg": math.pi / 180.0}
ANGULAR_RATE = {"rad_s": 1.0, "deg_s": math.pi / 180.0}
LENGTH = {"m": 1.0, "mm": 1e-3}
ACCELERATION = {"m_s2": 1.0}
PIXELS = {"px": 1.0}
TIME = {"s": 1.0, "ms": 1e-3}
TORQUE = {"Nm": 1.0}
FORCE = {"N": 1.0}
CURRENT = {"A": 1.0}
NO_UNIT: dict[str, float] = {"": 1.0}

# Joint angles of another arm that the target touches.
PARTNER = "partner_q"
# Quantities per axis, `quantity_i_unit`; the key is the key of `Dataset.joints`.
JOINT_UNITS = {
    "theta": ANGLE,
    "q": ANGLE,
    "theta_dot": ANGULAR_RATE,
    "q_dot": ANGULAR_RATE,
    "tau": TORQUE,
    "tau_motor": TORQUE,
    "current": CURRENT,
    "approach": NO_UNIT,
    PARTNER: ANGLE,  # of another arm: the axis is its own
}
# What a prismatic axis has instead; its motor still turns.
PRISMATIC_UNITS = {"q": LENGTH, "tau": FORCE}

POSITION = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
ROTATION_VECTOR = ("rx", "ry", "rz")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
# which contact a row belongs to; under these names alone
CONTACTS = ("socket", "plane", "sphere", "bar", "pair")
# a corner of a board, seen in a picture
PIXEL, PICTURE = ("u", "v"), ("picture", "corner")
# of a sensor on the flange, at rest: angles of its x and y axes above the horizon; specific force
TILT = ("tilt_x", "tilt_y")
ACCEL = ("accel_x", "accel_y", "accel_z")
# covariates that are a load too
PAYLOAD, PAYLOAD_CENTRE = "payload_kg", ("payload_x_m", "payload_y_m", "payload_z_m")
_MARKS = ("session", "visit", "run", "set")
SCALAR_UNITS = (dict.fromkeys(POSITION, LENGTH)
                | dict.fromkeys(QUATERNION, NO_UNIT)
                | dict.fromkeys(ROTATION_VECTOR, ANGLE)
                | dict.fromkeys(GYRO, ANGULAR_RATE)
                | dict.fromkeys(TILT, ANGLE)
                | dict.fromkeys(ACCEL, ACCELERATION)
                | dict.fromkeys(PIXEL, PIXELS)
                | {"time": TIME}
                | dict.fromkeys(_MARKS, NO_UNIT))

# Beyond these no arm, drive or device measures anything, whatever its unit was meant to be (SI units).
MOST = {
    "theta": 1e8, "q": 1e5, PARTNER: 1e5, "theta_dot": 1e8, "q_dot": 1e5, "tau": 1e8, "tau_motor": 1e8,
    "current": 1e7, "time": 1e13,
} | dict.fromkeys(TILT, 0.5 * math.pi) | dict.fromkeys(ACCEL, 1e4) | dict.fromkeys(PIXEL, 1e6)
MOST |= dict.fromkeys(POSITION, 1e6) | dict.fromkeys(ROTATION_VECTOR, 1e3) | dict.fromkeys(GYRO, 1e5)
MOST |= {PAYLOAD: 1e4} | dict.fromkeys(PAYLOAD_CENTRE, 1e2)

_ALMOST = 0.75  # share of matching letters: one wrong or swapped letter of five, not another word
_ALMOST_A_MARK = 0.86  # "sesion", "visits", "paylod_kg", "Session"; "mission" (0.857) is another word
_JOINT_NAMES = "|".join(sorted(JOINT_UNITS, key=len, reverse=True))
_ALL_UNITS = {unit for units in (*JOINT_UNITS.values(), *PRISMATIC_UNITS.values()) for unit in units} - {""}
_INDEXED = re.compile(rf"({_JOINT_NAMES})_(\d+)(?:_(.*))?")
_NO_INDEX = re.compile(rf"({_JOINT_NAMES})(?:_({'|'.join(_ALL_UNITS)}))?")
_SCALAR = re.compile(rf"({'|'.join(SCALAR_UNITS)})(?:_(.*))?")
_REFLECTOR = re.compile(rf"([xyz])_?(\d+)_({'|'.join(LENGTH)})")  # one of several on the tool
_PAYLOAD_CENTRE = re.compile(r"(payload_[xyz])(?:_(.*))?")
_LOADS = (PAYLOAD, *(name.removesuffix("m") + unit for name in PAYLOAD_CENTRE for unit in LENGTH))
# loads and temperatures have one unit: in any other they would be covariates of other numbers
_LOAD = PAYLOAD.removesuffix("_kg")
_OTHER_MASSES = {"", "lb", "lbs", "pound", "pounds", "oz", "g", "t", "n", "lbf"}
_OTHER_TEMPERATURES = {"degf", "f", "fahrenheit", "degk", "k", "kelvin"}
_LENGTH = re.compile(rf"length_({'|'.join(LENGTH)})")


def may_be_empty(names: list[str]) -> set[str]:
    """Columns whose cells may be empty: a row without a contact, and in a file with contacts a row without a
    tracker; reflectors, of which `reflectors` says better what an empty cell lacks."""
    scalars = {name: match[1] for name in names if (match := _SCALAR.fullmatch(name))}
    seen = {name for name in names if _REFLECTOR.fullmatch(name)}
    partner = {name for name in names if (match := _INDEXED.fullmatch(name)) and match[1] == PARTNER}
    if not (set(CONTACTS) & set(names) or partner or {*TILT, *ACCEL, *PIXEL} & set(scalars.values())):
        return seen
    vectors = (*POSITION, *QUATERNION, *ROTATION_VECTOR, *TILT, *ACCEL, *PIXEL)
    return seen | partner | {
        name for name in names
        if name in (*CONTACTS, *PICTURE) or _LENGTH.fullmatch(name) or scalars.get(name) in vectors}


@dataclass(frozen=True)
class Column:
    """One column: quantity ("covariate" if it is none of ours), axis from 1 or None, name, factor to SI."""

    quantity: str
    axis: int | None
    name: str
    factor: float = 1.0

    @property
    def key(self) -> tuple[str, int | None] | str:
        """What may stand only once in a file, whatever its unit."""
        return self.name if self.quantity == "covariate" else (self.quantity, self.axis)


def parse_column(name: str, file: str, prismatic: frozenset[int] = frozenset()) -> Column:
    """The column that a header's `name` stands for. `prismatic`: axes (from 1) that move along a line."""
    if match := _INDEXED.fullmatch(name):
        quantity, axis, unit = match[1], whole_number(match[2]), match[3] or ""
        if not axis:
            raise InputError(f"axis {match[2][:9]}; expected axes counted from 1", file=file, column=name)
        units = JOINT_UNITS[quantity]
        if axis in prismatic:
            units = PRISMATIC_UNITS.get(quantity, units)
        return Column(quantity, axis, name, _factor(f"{quantity}_{axis}", unit, units, file, name))
    if match := _NO_INDEX.fullmatch(name):
        example = f"{match[1]}_1" + (f"_{match[2]}" if match[2] else "")
        raise InputError(f"no axis number; expected a name like {example}", file=file, column=name)
    if name in (*CONTACTS, *PICTURE):
        return Column(name, None, name)
    if match := _LENGTH.fullmatch(name):
        return Column("length", None, name, LENGTH[match[1]])
    if match := _REFLECTOR.fullmatch(name):
        return Column(f"{match[1]}{whole_number(match[2])}", None, name, LENGTH[match[3]])
    if match := _PAYLOAD_CENTRE.fullmatch(name):
        return Column("covariate", None, f"{match[1]}_m",
                      _factor(match[1], match[2] or "", LENGTH, file, name))
    if match := _SCALAR.fullmatch(name):
        quantity, unit = match[1], match[2] or ""
        return Column(quantity, None, name, _factor(quantity, unit, SCALAR_UNITS[quantity], file, name))
    _check_load_or_temperature(name, file)
    if joint := _misspelt(name):
        raise InputError(f"is no quantity of a joint; did you mean {joint}?", file=file, column=name)
    meant = difflib.get_close_matches(name.lower(), (*_MARKS, *_LOADS), n=1, cutoff=_ALMOST_A_MARK)
    if meant and name != PAYLOAD and name.isidentifier():
        raise InputError(f"would not be read; did you mean {meant[0]}?", file=file, column=name)
    return Column("covariate", None, name)


def _check_load_or_temperature(name: str, file: str) -> None:
    stem, _, unit = name.rpartition("_") if "_" in name else (name, "", "")
    if stem.lower() == _LOAD and unit.lower() in _OTHER_MASSES:
        expected = PAYLOAD
    elif unit.lower() in _OTHER_TEMPERATURES and ("temp" in stem.lower() or unit.lower() == "degf"):
        expected = f"{stem}_degC"
    else:
        return
    raise InputError(f"{f'unknown unit {unit!r}' if unit else 'no unit'}; expected {expected}", file=file,
                     column=name)


def _misspelt(name: str) -> str | None:
    """The joint's quantity that a name with axis and unit nearly spells: thta_2_rad is no covariate."""
    match = re.fullmatch(rf"([a-z_]+)_(\d+)_({'|'.join(_ALL_UNITS)})", name, flags=re.IGNORECASE)
    if match is None:
        return None
    close = difflib.get_close_matches(match[1].lower(), JOINT_UNITS, n=1, cutoff=_ALMOST)
    unit = next(unit for unit in _ALL_UNITS if unit.lower() == match[3].lower())
    return f"{close[0]}_{match[2]}_{unit}" if close else None


def _factor(quantity: str, unit: str, units: dict[str, float], file: str, name: str) -> float:
    if unit in units:
        return units[unit]
    expected = " or ".join(f"{quantity}_{known}" if known else quantity for known in units)
    found = f"unknown unit {unit!r}" if unit else "no unit"
    raise InputError(f"{found}; expected {expected}", file=file, column=name)


def renamed(names: list[str], given: Mapping[str, str], file: str) -> list[str]:
    """The names of a file's columns with those that `given` maps in place of the file's own."""
    missing = next((name for name in given if name not in names), None)
    if missing is not None:
        close = difflib.get_close_matches(missing, names, n=1)
        expected = f"did you mean {close[0]}?" if close else f"expected one of {', '.join(names)}"
        raise InputError(f"--map names a column that is not there; {expected}", file=file, column=missing)
    return [given.get(name, name) for name in names]
