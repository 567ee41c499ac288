"""What the numbers of a column, and the columns of a file, have to be; InputError names file, row and
column."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

import numpy as np

from exactarm.data.columns import (
    ACCEL,
    CONTACTS,
    GYRO,
    MOST,
    PAYLOAD,
    PICTURE,
    PIXEL,
    POSITION,
    QUATERNION,
    ROTATION_VECTOR,
    TILT,
    Column,
)
from exactarm.data.rows import NO_CONTACT
from exactarm.errors import InputError

LARGEST_MARK = 2**53  # whole numbers beyond are not exact in a table of doubles


def check_values(path: str, column: Column, numbers: np.ndarray) -> None:
    """Columns that hold marks, not measurements."""
    if column.quantity == "set":
        good = np.isin(numbers.astype(str), ("identification", "validation"))
        expected = "identification or validation"
    elif column.quantity == "approach":
        good, expected = np.isin(numbers, (-1.0, 0.0, 1.0)), "-1, 0 or 1"
    elif column.quantity in (*CONTACTS, *PICTURE):
        good = np.isnan(numbers) | (
            (numbers == np.round(numbers)) & (numbers >= NO_CONTACT) & (numbers < LARGEST_MARK))
        expected = "a whole number from 0, or -1 (or nothing) where the row has no contact"
    elif column.quantity in ("session", "visit", "run"):
        good, expected = (numbers == np.round(numbers)) & (np.abs(numbers) < LARGEST_MARK), "a whole number"
    elif column.name == PAYLOAD:
        good, expected = numbers >= 0.0, "a mass of 0 or more"
    else:
        return
    if not good.all():
        row = int(np.argmin(good))
        raise InputError(f"{numbers[row]}; expected {expected}", file=path, row=row + 1, column=column.name)


def check_size(path: str, column: Column, values: np.ndarray) -> None:
    """A cell that no device measures is no measurement; one alone would carry any fit with it."""
    most = MOST.get(column.quantity.rstrip("0123456789"), MOST.get(column.name, np.inf))
    if most < np.inf and np.nanmax(np.abs(values), initial=0.0) > most:
        row = int(np.nanargmax(np.abs(values)))
        message = f"{values[row]:.6g} in SI units; expected at most {most:g} in size"
        raise InputError(message, file=path, row=row + 1, column=column.name)


def check_vectors(path: str, columns: Mapping[Any, Column]) -> None:
    for vector in (POSITION, QUATERNION, ROTATION_VECTOR, GYRO, TILT, ACCEL, (*PIXEL, *PICTURE)):
        missing = [name for name in vector if (name, None) not in columns]
        if missing and len(missing) < len(vector):
            found = next(name for name in vector if name not in missing)
            message = f"column missing; expected it beside column {columns[found, None].name}"
            others = {re.split(r"[\s\[(]|_(?=[^_]*$)", key)[0]: key  # "x_inch", "x [mm]"
                      for key in columns if isinstance(key, str)}
            close = get_close_matches(missing[0], others, n=1)
            message += f"; did you mean it with {others[close[0]]}?" if close else ""
            raise InputError(message, file=path, column=missing[0])
    if ("qw", None) in columns and ("rx", None) in columns:
        message = "a rotation vector beside a quaternion; expected one of the two"
        raise InputError(message, file=path, column=columns["rx", None].name)
