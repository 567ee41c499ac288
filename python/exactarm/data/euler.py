"""Orientations told by three turns, `roll_deg, pitch_deg, yaw_deg`: about fixed x, then y, then z.

    R = R_z(yaw) R_y(pitch) R_x(roll)

The same by other names: C, B, A of KUKA, W, P, R of Fanuc, Rx, Ry, Rz of Yaskawa, rpy of URDF. As a rotation
vector these numbers would be read without complaint, and mean another orientation. All three make an
orientation; one or two alone (an inclinometer's) stay covariates.
"""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm.data.columns import ANGLE, QUATERNION, ROTATION_VECTOR, Column
from exactarm.errors import InputError

Key = tuple[str, int | None] | str
TURNS = ("roll", "pitch", "yaw")


def with_orientation(path: str, columns: Mapping[Key, Column],
                     values: Mapping[Key, np.ndarray]) -> tuple[dict[Key, Column], dict[Key, np.ndarray]]:
    """Columns and their numbers in SI units with a quaternion beside the three turns, which stay under their
    names without a unit."""
    columns, values = dict(columns), dict(values)
    found = {turn: [f"{turn}_{unit}" for unit in ANGLE if f"{turn}_{unit}" in columns] for turn in TURNS}
    if not all(found.values()):
        return columns, values
    told = [names[0] for names in found.values()]
    second = next((names[1] for names in found.values() if len(names) > 1), None)
    other = next((columns[name, None].name for name in (*QUATERNION, *ROTATION_VECTOR)
                  if (name, None) in columns), second)
    if other is not None:
        raise InputError(f"an orientation beside {', '.join(told)}; expected it once", file=path,
                         column=other)
    turns = np.stack([values.pop(name) * ANGLE[name.rpartition("_")[2]] for name in told], axis=1)
    own = [columns.pop(name) for name in told]
    for turn, column, each in zip(TURNS, own, turns.T):
        columns[turn, None], values[turn, None] = Column(turn, None, column.name), each
    x, y, z, w = read_as("xyz", turns).as_quat().T
    for name, each in zip(QUATERNION, (w, x, y, z)):
        columns[name, None], values[name, None] = Column(name, None, own[0].name), each
    return columns, values


def read_as(axes: str, turns: np.ndarray) -> Rotation:
    """Of turns (N, 3), rad, about these axes one after another: fixed ones where the letters are small,
    moving ones where they are capital. NaN turns nothing."""
    return Rotation.from_euler(axes, np.nan_to_num(turns))
