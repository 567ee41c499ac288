"""Gyroscope g-sensitivity: the reading changes with the acceleration that the sensor feels.

change of the reading = K f,   K (3, 3) in rad/s per g, f (3,) the specific force in the sensor's axes
                               in units of g

Its axes are its own where axes that are not parallel show how it is mounted (chain/sensor_link.py), with one
matrix for all; else those of the moving joint. Entry zx: what a force along x does to the reading about z.
Acceleration other than gravity is left out. A component of f that does not vary in the runs at hand, or only
as others do, cannot be told from a bias or from them: its column of K is held at zero. Either the row of the
moving axis alone is estimated, or all three.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station

_ENTRIES = tuple((row, column) for row in range(3) for column in range(3))
_LEAST_G = 0.05  # RMS that a component must vary beyond a constant and the others: 3 degrees of tilt


@dataclass(frozen=True)
class GyroGSensitivity(Effect):
    """values: K row by row. rows, columns: those that are estimated, numbers from 0; the rest is held."""

    rows: tuple[int, ...] = (0, 1, 2)
    columns: tuple[int, ...] = (0, 1, 2)

    name = "gyro_g_sensitivity"
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    per_joint = False
    sentence = "the gyroscope's reading follows gravity as the sensor turns in it"
    source = "IEEE Std 1431: g-sensitive drift"

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"{'xyz'[row]}{'xyz'[column]}_rad_s_per_g", 2e-3, -1.0, 1.0,
                               fixed=row not in self.rows or column not in self.columns)
                     for row, column in _ENTRIES)

    def caveat(self, covariance: np.ndarray) -> str:
        held = [f"{'xyz'[column]}" for column in range(3) if column not in self.columns]
        return (f"the runs do not show forces along the sensor's {' and '.join(held)}: held at zero"
                if held else "")

    def change(self, view) -> Change:
        force = view.signals["specific_force"]
        derivative = np.zeros((view.rows, 3, 9))
        for k, (row, column) in enumerate(_ENTRIES):
            derivative[:, row, k] = force[:, column]
        return Change((0, 1, 2), force @ np.reshape(self.values, (3, 3)).T, derivative)

    @classmethod
    def from_table(cls, table) -> Effect:
        """Entries that are not given are zero; x, y, z without a row are those of the moving axis, as files
        used to have."""
        raw = cls(None, ())
        given = {f"z{axis}_rad_s_per_g": f"{axis}_rad_s_per_g" for axis in "xyz"}
        values = [table.get(p.name, table.get(given.get(p.name), 0.0)) for p in raw.parameters()]
        return raw.with_values(values)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if "specific_force" not in view.signals:
            return ()
        columns = shown_components(view.signals["specific_force"][view.keep])
        if not columns:
            return ()
        return (cls(None, (0.0,) * 9, rows, columns) for rows in ((2,), (0, 1, 2)))


def shown_components(force: np.ndarray) -> tuple[int, ...]:
    """Components of a force (N, 3) that vary by themselves, the strongest taken first; from 0, rising."""
    left, found = force - force.mean(axis=0) if len(force) else force, []
    while len(left):
        sizes = np.sqrt(np.mean(left**2, axis=0))
        sizes[found] = 0.0
        best = int(np.argmax(sizes))
        if sizes[best] < _LEAST_G:
            break
        found.append(best)
        unit = left[:, best] / np.linalg.norm(left[:, best])
        left = left - np.outer(unit, unit @ left)
    return tuple(sorted(found))
