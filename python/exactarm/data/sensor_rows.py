"""Rows whose contact needs no number: a reading of gravity at rest, a corner in a picture, angles of another
arm mark them."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from exactarm.data.columns import ACCEL, TILT
from exactarm.data.kinds.base import is_a_series
from exactarm.data.rows import NO_CONTACT, Rows
from exactarm.errors import InputError

Data = TypeVar("Data", bound=Rows)


def with_sensors(data: Data) -> Data:
    """The rows with `contacts` of what a flange's sensor or a camera has measured, or another arm touched."""
    return _with_gravity_sensor(_with_partner(_with_camera(data)))


def _with_partner(data: Data) -> Data:
    """Rows with angles of another arm touch it."""
    if data.partner is None:
        return data
    touched = np.where(np.isnan(data.partner).all(axis=1), NO_CONTACT, 0)
    return replace(data, contacts=data.contacts | {"partner": touched})


def _with_camera(data: Data) -> Data:
    """Rows with pixels are corners that a camera has seen."""
    if data.pixel is None:
        return data
    seen = np.where(np.isnan(data.pixel).any(axis=1), NO_CONTACT, 0)
    return replace(data, contacts=data.contacts | {"camera": seen})


def _with_gravity_sensor(data: Data) -> Data:
    """Rows at rest with a reading are touches of the sensor; in a motion the columns are covariates."""
    sensors = {"tilt": (data.tilt, TILT, "rad"), "accel": (data.accel, ACCEL, "m_s2")}
    held = {name: (values, names, unit) for name, (values, names, unit) in sensors.items()
            if values is not None}
    if not held or not is_a_series(data):
        marks = {name: np.where(np.isnan(values).any(axis=1), NO_CONTACT, 0)
                 for name, (values, _, _) in held.items()}
        return replace(data, contacts=data.contacts | marks)
    columns = {f"{name}_{unit}": values[:, k] for values, names, unit in held.values()
               for k, name in enumerate(names)}
    for name, values in columns.items():
        if (empty := np.flatnonzero(np.isnan(values))).size:
            raise InputError("empty cell; expected a number in every row of a motion", column=name,
                             file=data.first_file, row=int(data.row[empty[0]]))
    return replace(data, tilt=None, accel=None, covariates=data.covariates | columns)
