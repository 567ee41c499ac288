"""Several reflectors of one plate on the tool, `x1_mm, y1_mm, z1_mm, x2_mm, ...`: they are one pose.

The plate's shape is the median of all rows, laid over each other; each row's pose is the rigid motion that
brings the shape closest to its points (Kabsch 1976). The target is the first reflector, as the plate has it;
its axes: x to the second, z across the plane of the first three. One reflector is a position.
"""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm.data.columns import POSITION, QUATERNION, ROTATION_VECTOR, Column
from exactarm.errors import InputError
from exactarm.numerics.factors import svd
from exactarm.numerics.rotation import nearest

Key = tuple[str, int | None] | str
_RIGID = 0.02  # of the plate's size: reflectors are exchanged or moved, not measured badly
_LINE = 0.02  # width of the plate beside its length, below which it is a line, whose turn nothing shows
_PASSES = 3  # of the shape: each is closer by the noise over the number of rows


def with_target(path: str, columns: Mapping[Key, Column],
                values: Mapping[Key, np.ndarray]) -> tuple[dict[Key, Column], dict[Key, np.ndarray]]:
    """Columns and their numbers in SI units with position and quaternion in the place of reflectors."""
    columns, values = dict(columns), dict(values)
    found = [re.fullmatch(r"[xyz](\d+)", key[0]) for key in columns if isinstance(key, tuple)]
    numbers = sorted({int(match[1]) for match in found if match})
    if not numbers:
        return columns, values
    names = [[f"{axis}{number}" for axis in POSITION] for number in numbers]
    for group in names:
        held = [columns[name, None].name for name in group if (name, None) in columns]
        missing = [name for name in group if (name, None) not in columns]
        if missing:
            raise InputError(f"column missing; expected it beside column {held[0]}", file=path,
                             column=missing[0])
    first = columns[names[0][0], None]
    for name in (*POSITION, *QUATERNION, *ROTATION_VECTOR):
        if (name, None) in columns:
            raise InputError(f"a pose beside the reflector {first.name}; expected either", file=path,
                             column=columns[name, None].name)
    if len(numbers) == 2:
        raise InputError("two reflectors, whose common turn nothing shows; expected three of one plate, or "
                         "one", file=path, column=columns[names[1][0], None].name)
    points = np.stack([np.stack([values.pop((name, None)) for name in group], axis=1) for group in names],
                      axis=1)
    told = [columns.pop((name, None)) for group in names for name in group]
    empty = np.argwhere(np.isnan(points.reshape(len(points), -1)))
    if empty.size:
        row, column = empty[0].tolist()
        wanted = ("all reflectors in every row, or, where a row shows one of them, x, y, z and a number "
                  "`session` for each reflector" if len(numbers) > 1 else "a number")
        raise InputError(f"empty cell; expected {wanted}", file=path, row=row + 1, column=told[column].name)
    numbers_of = dict(zip(POSITION, points[:, 0].T))
    if len(numbers) > 2:
        position, rotation = plate_poses(points, path, first.name)
        x, y, z, w = Rotation.from_matrix(rotation).as_quat().T
        numbers_of = dict(zip((*POSITION, *QUATERNION), (*position.T, w, x, y, z)))
    for (name, each), column in zip(numbers_of.items(), (*told[:3], *[first] * 4)):
        columns[name, None], values[name, None] = replace(column, quantity=name), each
    return columns, values


def plate_poses(points: np.ndarray, path: str, column: str) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) position of the first reflector and (N, 3, 3) rotation of the plate of points (N, k, 3), m."""
    apart = np.linalg.norm(points[:, :, None] - points[:, None], axis=3)
    usual = np.argmin(np.sum((apart - np.median(apart, axis=0)) ** 2, axis=(1, 2)))
    shape = points[usual]
    for _ in range(_PASSES):
        rotation, centre = _laid_over(shape, points)
        shape = np.median(np.einsum("nij,nki->nkj", rotation, points - centre[:, None]), axis=0)
    lengths = svd(shape - shape.mean(axis=0), compute_uv=False)
    if not lengths[1] > _LINE * lengths[0]:
        raise InputError("the reflectors lie on one line, whose turn nothing shows; expected three that span "
                         "a plane", file=path, column=column)
    shape = (shape - shape[0]) @ _own_axes(shape)
    rotation, centre = _laid_over(shape, points)
    position = centre - rotation @ shape.mean(axis=0)
    missed = np.linalg.norm(points - position[:, None] - np.einsum("nij,kj->nki", rotation, shape), axis=2)
    row, size = int(np.argmax(missed.max(axis=1))), lengths[0] / np.sqrt(len(shape))
    if missed[row].max() > _RIGID * size:
        raise InputError(f"the reflectors do not keep their distances: {1e3 * missed[row].max():.3g} mm off "
                         f"the plate of the other rows, expected less than {1e3 * _RIGID * size:.2g} mm: are "
                         "two exchanged, or was one moved?", file=path, row=row + 1, column=column)
    return position, rotation


def _laid_over(shape: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (N, 3, 3) that bring the shape (k, 3) closest to points (N, k, 3), about centres (N, 3)."""
    centre = points.mean(axis=1)
    return nearest(np.einsum("nki,kj->nij", points - centre[:, None], shape - shape.mean(axis=0))), centre


def _own_axes(shape: np.ndarray) -> np.ndarray:
    """(3, 3) axes as columns: x from the first to the second point, z across the plane of the first three."""
    x = shape[1] - shape[0]
    z = np.cross(x, shape[2] - shape[0])
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)
