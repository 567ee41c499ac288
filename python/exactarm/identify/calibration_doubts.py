"""What a calibration shows of its data and its robot file that no arm does: more left over than arms miss by,
readings that are rounded as coarsely, a length far from the file's.

    rounding to a step s leaves s / sqrt(12); of an angle: times the lever of its axis
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.identify.reach import reach
from exactarm.numerics.signals import step_of_quantisation
from exactarm.robot.robot import Robot

# Of the reach, after calibration: arms miss by 0.001 to 0.003 of it before, by a tenth of that after.
MOST_LEFT = 0.004
ROUNDED = 0.5, 2.0  # of what is left: a grid of the commanded poses would leave far more than there is
FEWEST_ROWS = 20  # of which a grid is told
LEAST_ROUNDED_M = 2e-4  # what is left by trackers and controllers as they are
FAR_FROM_DRAWING = 0.02  # of the reach: ten times what arms miss by


def left_over(robot: Robot, data: Dataset, left_m: float) -> Iterator[str]:
    """Data that no arm gives: columns or rows that do not belong together, whichever they are; or readings
    that were rounded."""
    if left_m > MOST_LEFT * reach(robot):
        yield (f"{1e3 * left_m:.2g} mm (RMS) are left after calibration, more than an arm that reaches "
               f"{reach(robot):.2g} m misses by: are rows, columns or files mixed up, angles rounded, a "
               "column not measured, or is the device as coarse?")
    yield from _rounded(robot, data, left_m)


def _rounded(robot: Robot, data: Dataset, left_m: float) -> Iterator[str]:
    if len(data) < FEWEST_ROWS or left_m < LEAST_ROUNDED_M or data.position is None:
        return
    steps = np.array([step_of_quantisation(column) for column in data.position.T])
    found = {"x, y, z": (f"{1e3 * steps.max():.3g} mm", float(np.sqrt(np.sum(steps**2) / 12.0)))}
    if (angles := data.joints.get("q")) is not None and not np.isnan(angles).any():
        steps = np.array([step_of_quantisation(column) for column in angles.T])
        levers = np.sqrt(np.mean(np.sum(robot.jacobian(angles)[:, :3] ** 2, axis=1), axis=0))
        found["joint angles"] = (f"{np.degrees(steps.max()):.3g} degrees",
                                 float(np.sqrt(np.sum((steps * levers) ** 2) / 12.0)))
    for name, (step, alone) in found.items():
        if ROUNDED[0] * left_m < alone < ROUNDED[1] * left_m:
            yield (f"{name} are rounded to {step}, which alone leaves {1e3 * alone:.2g} of the "
                   f"{1e3 * left_m:.2g} mm (RMS): are there more digits?")


def far_from_drawing(declared: Robot, found: Robot) -> Iterator[str]:
    """The length that is farthest from the robot file's, where no arm is so far off its drawing."""
    lengths = [(abs(getattr(new, name) - getattr(old, name)), f"{name}_{i}", getattr(old, name))
               for i, (old, new) in enumerate(zip(declared.joints, found.joints), start=1) for name in "ad"]
    off, name, old = max(lengths)
    if off > FAR_FROM_DRAWING * reach(found):
        yield (f"{name} comes out {1e3 * off:.3g} mm from the {1e3 * old:.5g} mm of the robot file, more "
               "than an arm is off its drawing: is it the file of this arm, and its table right?")
