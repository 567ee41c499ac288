"""What a certificate says that no data can: who measured which arm with what, and when. Options, or keys of a
TOML file.

serial = "20-1234"                    instrument = "AT960"
measured = 2026-03-02                 instrument_u_mm = 0.015     # standard uncertainty (k = 1) of one
coordinate
"""

import argparse
import math
from collections.abc import Mapping
from datetime import date, datetime
from pathlib import Path
from typing import Any

from exactarm.errors import InputError
from exactarm.files.toml_file import read_toml

KEYS = {  # key -> what the page calls it
    "number": "certificate number",
    "serial": "robot, serial no.",
    "maker": "robot, maker and type",
    "payload": "load",
    "instrument": "instrument",
    "instrument_serial": "instrument, serial no.",
    "instrument_calibrated": "instrument calibrated on",
    "instrument_u_mm": "instrument, standard uncertainty (k = 1)",
    "measured": "measured on",
    "temperature": "ambient temperature",
    "place": "place",
    "operator": "measured by",
    "customer": "customer",
}
DATES = ("instrument_calibrated", "measured")
EXPECTED_KEYS = ("serial", "instrument", "measured", "instrument_u_mm")  # a certificate without them says so
LARGEST_U_MM = 10.0  # an instrument worse than that measures no robot: the unit is wrong
_EXPECTED = "what a certificate says of arm and instrument (.toml)"


def add_about(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what the certificate says", "options, or keys of the file of --about")
    group.add_argument(
        "--about", metavar="FILE", type=Path, help='a .toml with the keys below, as serial = "..."')
    for key, label in KEYS.items():
        group.add_argument(
            f"--{key.replace('_', '-')}", metavar="DATE" if key in DATES else "TEXT", dest=key, help=label)


def about_of(file: str | Path | Mapping[str, Any] | None, options: Mapping[str, Any]) -> dict[str, Any]:
    """All that is known, options before the file's keys; `instrument_u_mm` is a number, dates are ISO."""
    known: dict[str, Any] = {}
    where = None
    if isinstance(file, Mapping):
        known = dict(file)
    elif file is not None:
        known, where = read_toml(file, _EXPECTED), str(file)
    for key in known:
        if key not in KEYS:
            raise InputError(f"key {key!r} is unknown; expected one of {', '.join(KEYS)}", file=where)
    told = {key: _checked(key, value, where, key) for key, value in known.items()}
    told |= {key: _checked(key, value, None, f"--{key.replace('_', '-')}")
             for key, value in options.items()
             if value is not None}
    return {key: told[key] for key in KEYS if key in told}


def _checked(key: str, value: Any, file: str | None, name: str) -> Any:
    if key in DATES:
        if isinstance(value, (date, datetime)):
            return value.isoformat()[:10]
        try:
            return date.fromisoformat(str(value)).isoformat()
        except ValueError:
            raise InputError(f"{name}: {str(value)!r}; expected a date as 2026-03-02", file=file) from None
    if key == "instrument_u_mm":
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if isinstance(value, bool) or not 0.0 <= number <= LARGEST_U_MM:
            raise InputError(
                f"{name}: {value!r}; expected a standard uncertainty in mm, from 0 to {LARGEST_U_MM:g}",
                file=file)
        return number
    if isinstance(value, (dict, list)) or not str(value).strip():
        raise InputError(f"{name}: expected a text", file=file)
    return str(value)
