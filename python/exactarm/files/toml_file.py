"""TOML files from outside: one guarded reader for robots, paths and all that is declared by hand.

    read_toml(path, "a robot file (.toml)") -> tables        is_number(value)        fits_shape(value, (None,
    3))

Refused with one line that names the file: what cannot be read, is no text or no TOML, is nested deeper than
`DEEPEST` or holds a whole number beyond 64 bits, which TOML leaves to the reader and no double holds exactly.
"""

import math
import tomllib
from pathlib import Path
from typing import Any

from exactarm.errors import InputError
from exactarm.files.file_bytes import file_text, path_of

DEEPEST = 32  # tables within tables; a robot file has four, a record of records of commands some more
LARGEST_WHOLE = 2**63 - 1  # what TOML promises to hold


def read_toml(path: str | Path, expected: str) -> dict[str, Any]:
    """The tables of a file; `expected` says what the caller wanted, for the messages."""
    path_of(path, expected)
    try:
        tables = tomllib.loads(file_text(path))
    except FileNotFoundError:
        raise InputError(f"no such file; expected {expected}", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); expected {expected}", file=path) from None
    except UnicodeDecodeError:
        raise InputError(f"is no text; expected {expected}", file=path) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is no valid TOML: {error}; expected {expected}", file=path) from None
    except RecursionError:
        raise InputError(f"is nested too deeply; expected {expected}", file=path) from None
    except ValueError:  # Python refuses to read whole numbers of thousands of digits, and dates that are none
        raise InputError(
            f"holds a number or date that cannot be read; expected {expected}", file=path) from None
    _check(tables, path, expected)
    return tables


def is_number(value: Any) -> bool:
    """Whether a value is a number as a file has them; true and false are none."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def fits_shape(value: Any, shape: tuple[int | None, ...]) -> bool:
    """Whether nested lists hold finite numbers in this shape; None: any length."""
    if not shape:
        return is_number(value) and math.isfinite(value)
    sized = isinstance(value, list) and shape[0] in (None, len(value))
    return sized and all(fits_shape(part, shape[1:]) for part in value)


def _check(tables: dict[str, Any], path: str | Path, expected: str) -> None:
    """Depth and whole numbers, without recursion: what comes from outside must not choose our depth."""
    todo: list[tuple[Any, int]] = [(tables, 0)]
    while todo:
        value, depth = todo.pop()
        if depth > DEEPEST:
            raise InputError(f"is nested deeper than {DEEPEST} tables; expected {expected}", file=path)
        if isinstance(value, dict):
            todo += [(item, depth + 1) for item in value.values()]
        elif isinstance(value, list):
            todo += [(item, depth + 1) for item in value]
        elif isinstance(value, int) and abs(value) > LARGEST_WHOLE:
            raise InputError(
                f"holds a whole number of {len(hex(abs(value))) - 2} hexadecimal digits; expected one of 64 "
                "bits", file=path)
