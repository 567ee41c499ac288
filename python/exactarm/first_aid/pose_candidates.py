"""Usual mistakes in pose data, each undone in one step: what would have been meant, and the data or robot
that it means.

Angles: units, signs, exchanged columns, zeros, coupled axes, motor or joint side. Device: units, a mirrored
frame, rows beside the wrong angles, the convention of orientations. Robot: another size, a table of the
other convention, another robot that is shipped. `pose_mistakes` judges them.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm.data.columns import QUATERNION, ROTATION_VECTOR
from exactarm.data.dataset import Dataset
from exactarm.data.euler import TURNS, read_as
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import Placement, Robot
from exactarm.robot_file import load_robot, shipped_robots

MOST_AXES_FOR_SIGNS = 7  # all combinations of signs: 128; arms with more axes get single ones and pairs
# of the lengths: arms of one maker differ by more, and no arm is off by so much as a whole
ANOTHER_SIZE = 0.03
# mm for m and another arm by far; beyond, the flange turns on its place, as a turntable's does: any unit fits
FARTHEST_SIZE = 1e5
_TURN = 2.0 * np.pi
_DEGREE = np.pi / 180.0
_GON = 0.9  # degrees
_ALL_COLUMNS = "xyz"
_OF_THE_LINK_BEFORE = ("a table whose rows hold a and alpha of the link before the axis (Craig's convention; "
                       "in a robot file they are those of the link behind it)")
_MIRROR = np.array([1.0, 1.0, -1.0])
MIRRORED = "one of x, y, z with the opposite sign, or two of them exchanged"

Candidate = tuple[str, Robot, Dataset]


def candidates(robot: Robot, data: Dataset, whole: Dataset, rows: np.ndarray,
               size: float) -> Iterator[Candidate]:
    """(what would have been meant, robot, data) of every mistake; `data` are the rows `rows` of `whole`,
    `size`: how many times as far apart as the robot says the points lie."""
    sized = 1.0 / FARTHEST_SIZE < size < FARTHEST_SIZE
    units = _of_units(data) if sized else ()
    for words, changed in (*of_angles(robot, data), *units, *_of_device(data), *_of_rows(data, whole, rows)):
        yield words, robot, changed
    yield _OF_THE_LINK_BEFORE, _one_row_up(robot), data
    for name in shipped_robots():
        other = load_robot(name)
        turns = "theta" not in data.joints or all(joint.has_gear for joint in other.joints)
        if other.has_geometry and other.axes == robot.axes and other.name != robot.name and turns:
            yield f"data of {name}", replace(other, base=Placement(), tool=Placement()), data


def _one_row_up(robot: Robot) -> Robot:
    """The arm whose table holds in each row a and alpha of the link before the axis; the last link's are
    the tool's."""
    a, alpha = ([*(getattr(joint, name) for joint in robot.joints[1:]), 0.0] for name in ("a", "alpha"))
    joints = (replace(joint, a=a[i], alpha=alpha[i], beta=None) for i, joint in enumerate(robot.joints))
    return replace(robot, joints=tuple(joints))


def of_angles(robot: Robot, data: Dataset) -> Iterator[tuple[str, Dataset]]:
    n, with_joints = robot.axes, lambda change: with_angles(data, change)
    axes = range(n)
    turning = [i for i in axes if robot.joints[i].type == "revolute"]
    yield "degrees labelled as radians", with_joints(scaled(turning, _DEGREE))
    yield "radians labelled as degrees", with_joints(scaled(turning, 1.0 / _DEGREE))
    yield "whole turns labelled as radians", with_joints(scaled(turning, _TURN))
    yield "gon labelled as degrees", with_joints(scaled(turning, _GON))
    for i in turning:
        yield f"degrees labelled as radians on axis {i + 1}", with_joints(scaled([i], _DEGREE))
        yield f"radians labelled as degrees on axis {i + 1}", with_joints(scaled([i], 1.0 / _DEGREE))
    most = n if n <= MOST_AXES_FOR_SIGNS else 2
    for count in range(1, most + 1):
        for chosen in combinations(axes, count):
            yield f"the opposite sign of {axes_in_words(chosen)}", with_joints(scaled(list(chosen), -1.0))
    for i, j in combinations(axes, 2):
        order = list(axes)
        order[i], order[j] = j, i
        yield f"{axes_in_words((i, j))} exchanged", with_joints(_order(order))
    yield "all axes in reverse order", with_joints(_order(list(axes)[::-1]))
    for shift in (1, -1):
        yield "all axes one column further on", with_joints(_order(list(np.roll(np.arange(n), shift))))
    for i in turning:
        for angle in (90.0, -90.0, 180.0):
            yield (f"another zero of axis {i + 1} (by {angle:+.0f} degrees)",
                   with_joints(turned(i, angle * _DEGREE, robot)))
    for i, j in [(i, i + 1) for i in range(n - 1)] + [(i + 1, i) for i in range(n - 1)]:
        for sign in (1.0, -1.0):
            words = (f"axis {j + 1} counted {'from' if sign > 0 else 'with'} axis {i + 1}, as controllers of "
                     f"coupled arms do ({_told_by(robot, i, j, sign)})")
            yield words, with_joints(_coupled(i, j, sign, robot))
    if any(joint.has_gear for joint in robot.joints):
        yield ("motor angles labelled as q_i",
               with_angles(data, scaled(list(axes), 1.0 / robot.ratios), ("q",)))
        yield ("joint angles labelled as theta_i",
               with_angles(data, scaled(list(axes), robot.ratios), ("theta",)))


def with_angles(data: Dataset, change: Callable[[np.ndarray, str], np.ndarray],
                names: tuple[str, ...] = ("theta", "q")) -> Dataset:
    """Columns of angles changed; change: of a copy (N, n) and the name of the column."""
    joints = {name: change(data.joints[name].copy(), name) for name in names if name in data.joints}
    return replace(data, joints=data.joints | joints)


def scaled(axes: list[int], factor) -> Callable[[np.ndarray, str], np.ndarray]:
    def change(angles: np.ndarray, name: str) -> np.ndarray:
        angles[:, axes] *= factor
        return angles

    return change


def _order(order: list[int]) -> Callable[[np.ndarray, str], np.ndarray]:
    return lambda angles, name: angles[:, order]


def turned(axis: int, angle: float, robot: Robot) -> Callable[[np.ndarray, str], np.ndarray]:
    def change(angles: np.ndarray, name: str) -> np.ndarray:
        angles[:, axis] += angle * (robot.controller_ratios[axis] if name == "theta" else 1.0)
        return angles

    return change


def _coupled(driver: int, axis: int, sign: float, robot: Robot) -> Callable[[np.ndarray, str], np.ndarray]:
    def change(angles: np.ndarray, name: str) -> np.ndarray:
        scale = robot.controller_ratios[axis] / robot.controller_ratios[driver] if name == "theta" else 1.0
        angles[:, axis] -= sign * scale * angles[:, driver]
        return angles

    return change


def _told_by(robot: Robot, driver: int, axis: int, sign: float) -> str:
    """The line of the robot file that says so, beside the couplings that it declares."""
    declared = {(i, j): factor for i, j, factor in robot.controller.coupling or ()}
    pair = (axis + 1, driver + 1)
    declared[pair] = declared.get(pair, 0.0) - sign
    line = ", ".join(f"[{i}, {j}, {factor:.1f}]" for (i, j), factor in declared.items() if factor)
    return f"`coupling = [{line}]` under `[controller]` of the robot file"


def _of_units(data: Dataset) -> Iterator[tuple[str, Dataset]]:
    """Units of the measuring device."""
    position = lambda factors: replace(data, position=data.position * factors)
    yield "millimetres labelled as metres", position(1e-3)
    yield "metres labelled as millimetres", position(1e3)
    for k, name in enumerate(_ALL_COLUMNS):
        for factor, words in ((1e-3, "millimetres labelled as metres"),
                              (1e3, "metres labelled as millimetres")):
            yield f"{words} in {name}", position(np.where(np.arange(3) == k, factor, 1.0))


def _of_device(data: Dataset) -> Iterator[tuple[str, Dataset]]:
    """Directions and orientations of the measuring device."""
    mirrored = replace(data, position=data.position * _MIRROR, rotation=None)
    yield MIRRORED, mirrored
    if data.rotation is not None:
        yield MIRRORED, replace(mirrored, rotation=data.rotation * np.outer(_MIRROR, _MIRROR))
        yield from ((words, replace(data, rotation=meant)) for words, meant in _orientations(data))


def _orientations(data: Dataset) -> Iterator[tuple[str, np.ndarray]]:
    """What the columns of an orientation may mean, (N, 3, 3), by the names that the file has."""
    names, told, read = _told(data)
    inverse = np.swapaxes(data.rotation, -1, -2)
    if names == QUATERNION[1:]:
        quaternion = Rotation.from_matrix(data.rotation).as_quat()
        turned = Rotation.from_quat(quaternion[:, [3, 0, 1, 2]]).as_matrix()
        yield "a conjugate quaternion (of the device in the target)", inverse
        yield "a quaternion in the order x, y, z, w", turned
        yield "a conjugate quaternion in the order x, y, z, w", np.swapaxes(turned, -1, -2)
    else:
        yield f"{', '.join(names)} of the device in the target (the inverse orientation)", inverse
    for i, j in ((0, 1), (1, 2), (0, 2)):
        order = np.arange(3)
        order[[i, j]] = j, i
        yield f"{names[i]} and {names[j]} exchanged", read(told[:, order])
    for k, name in enumerate(names):
        yield f"the opposite sign of {name}", read(told * np.where(np.arange(3) == k, -1.0, 1.0))
    if names == ROTATION_VECTOR:
        for words, axes in _TURNS:
            yield f"rx, ry, rz as {words} in place of a rotation vector", read_as(axes, told).as_matrix()
        yield "a rotation vector in degrees labelled as radians", read(told * _DEGREE)
    if names == TURNS:
        for words, axes in _TURNS[2:]:
            yield f"roll, pitch, yaw as {words}", read_as(axes, told).as_matrix()
        yield "roll, pitch, yaw as a rotation vector (to be named rx, ry, rz)", _of_vectors(told)
        yield "roll, pitch, yaw in degrees labelled as radians", read(told * _DEGREE)
        yield "roll, pitch, yaw in radians labelled as degrees", read(told / _DEGREE)


def _told(data: Dataset) -> tuple[tuple[str, ...], np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """Names of three numbers of the orientation as the file has them, these (N, 3), and how they are read."""
    if data.turns is not None:
        return TURNS, data.turns, lambda turns: read_as("xyz", turns).as_matrix()
    if data.rotation_vector is not None:
        return ROTATION_VECTOR, data.rotation_vector, _of_vectors
    quaternion = Rotation.from_matrix(data.rotation).as_quat()
    return QUATERNION[1:], quaternion[:, :3], lambda part: Rotation.from_quat(
        np.column_stack([part, quaternion[:, 3]])).as_matrix()


def _of_vectors(vectors: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(np.nan_to_num(vectors)).as_matrix()


_TURNS = (("roll, pitch and yaw (to be named so)", "xyz"),
          ("yaw, pitch and roll (to be named so)", "ZYX"),
          ("turns about moving x, y and z", "XYZ"), ("turns about moving z, y and z", "ZYZ"))


def _of_rows(data: Dataset, whole: Dataset, rows: np.ndarray) -> Iterator[tuple[str, Dataset]]:
    """The device's columns of the row before or after; the first or last row of a session keeps its own."""
    def rows_beside(shift: int) -> np.ndarray:
        order = np.clip(rows + shift, 0, len(whole) - 1)
        return np.where(whole.session[order] == whole.session[rows], order, rows)

    late = ((1, "positions one row later than the angles"),
            (-1, "positions one row earlier than the angles"),
            (2, "positions two rows later than the angles"),
            (-2, "positions two rows earlier than the angles"))
    # of a series it is a delay, which the library knows and the file's model may have
    for shift, words in () if TRACKED_MOTION.name in whole.kinds else late:
        order = rows_beside(shift)
        rotation = None if whole.rotation is None else whole.rotation[order]
        yield words, replace(data, position=whole.position[order], rotation=rotation)
    for shift, way in ((1, "later"), (-1, "earlier"), (2, "later"), (-2, "earlier")):
        order, count = rows_beside(shift), "one row" if abs(shift) == 1 else "two rows"
        for i in range(data.axes):
            def own(angles: np.ndarray, name: str, i: int = i, order: np.ndarray = order) -> np.ndarray:
                angles[:, i] = whole.joints[name][order, i]
                return angles

            yield f"the angles of axis {i + 1} {count} {way} than the others", with_angles(data, own)
        for k, name in enumerate(_ALL_COLUMNS):
            position = data.position.copy()
            position[:, k] = whole.position[order, k]
            yield f"column {name} {count} {way} than the others", replace(data, position=position)
