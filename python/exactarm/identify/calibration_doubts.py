"""What a calibration shows of its data and its robot file that no arm does: files that contradict each other,
more left over than arms miss by, readings that are rounded as coarsely, a length or zero far from the file's.

    rounding to a step s leaves s / sqrt(12); of an angle: times the lever of its axis
"""

from collections.abc import Callable, Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.errors import ComputationError, InputError
from exactarm.identify.calibrate import Calibration
from exactarm.identify.closure_scale import gravity_alone
from exactarm.identify.judged_rows import judged_rows
from exactarm.identify.wild_rows import single_wild
from exactarm.numerics.signals import step_of_quantisation
from exactarm.robot.robot import Robot

Calibrated = Callable[[Dataset], Calibration]

# Of the reach, after calibration: arms miss by 0.001 to 0.003 of it before, by a tenth of that after.
MOST_LEFT = 0.004
ROUNDED = 0.5, 2.0  # of what is left: a grid of the commanded poses would leave far more than there is
FEWEST_ROWS = 20  # of which a grid is told
LEAST_ROUNDED_M = 2e-4  # what is left by trackers and controllers as they are
MIXED_UP = ("are rows, columns or files mixed up, angles rounded, a column not measured, or is the device as "
            "coarse?")
TOUCHED = ("did the fixture move within a session, has a contact another number, does the robot file lack a "
           "coupling of its motors, or is a length of the fixture another one?")
FAR_FROM_DRAWING = 0.02  # of the reach: ten times what arms miss by
FAR_ZERO_RAD = 0.05  # five times what is plausible, twice the most of the arms that ship (25 mrad)


def doubts(declared: Robot, result: Calibration, calibrated: Calibrated) -> tuple[str, ...]:
    """One line each. calibrated: the same calibration of some of the rows."""
    data, reached = result.data, result.robot.reach
    left = _left_m(result)
    told = list(contradicting(data, left, MOST_LEFT * reached, lambda rows: _left_m(calibrated(rows))))
    if not data.contacts:
        told = [*(told or much_left(left, reached, MIXED_UP)), *rounded(result.robot, data, left)]
    elif not told and not gravity_alone(data):
        told = list(much_left(left, reached, TOUCHED))
    return (*told, *far_from_drawing(declared, result.robot))


def with_contradiction(error: InputError, robot: Robot, data: Dataset, calibrated: Calibrated) -> InputError:
    """The refusal of all rows, with the reason where each file alone is none to refuse."""
    most = MOST_LEFT * robot.reach
    for line in contradicting(data, np.inf, most, lambda rows: _left_m(calibrated(rows))):
        return InputError(f"{line}. Of all together: {error.message}", file=error.file)
    return error


def _left_m(result: Calibration) -> float:
    """RMS of what is left, m, a few wild rows aside."""
    error = result.error_after
    if result.data.contacts and (judged := judged_rows(result.data)).any():
        error = error[judged]
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(error[~single_wild(error)] ** 2)))


def _mm(length_m: float) -> str:
    """Two digits, and no power of ten."""
    return f"{float(f'{1e3 * length_m:.2g}'):g} mm"


def contradicting(data: Dataset, left_m: float, most_m: float,
                  left_alone: Callable[[Dataset], float]) -> Iterator[str]:
    """Files, or sessions of one file, that together leave more than an arm misses by (`most_m`), while none
    of them does alone. left_alone: rows -> what their own calibration leaves, m."""
    files = len(np.unique(data.file_index)) > 1
    groups = data.file_index if files else data.session
    numbers = np.unique(groups)
    if left_m <= most_m or len(numbers) < 2:
        return
    try:
        alone = max(left_alone(data.select(groups == number)) for number in numbers)
    except (InputError, ComputationError):  # too few rows to tell what the arm is by them alone
        return
    if alone <= most_m:
        what = "files" if files else "sessions"
        pairs = np.unique(np.stack([data.file_index, data.session]), axis=1)
        same = "do sessions of one number in two files mean two set-ups, " if (
            pairs.shape[1] > len(np.unique(data.session))) else ""
        together = f", {_mm(left_m)} of all together" if np.isfinite(left_m) else ""
        yield (f"the {len(numbers)} {what} contradict each other: at most {_mm(alone)} (RMS) are left "
               f"after a calibration of each alone{together}; {same}are they of different arms, or was the "
               "arm mastered anew, repaired or hit in between? Calibrate each alone")


def much_left(left_m: float, reach_m: float, causes: str) -> Iterator[str]:
    """Data that no arm gives: columns or rows that do not belong together, whichever they are."""
    if left_m > MOST_LEFT * reach_m:
        yield (f"{_mm(left_m)} (RMS) are left after calibration, more than an arm that reaches "
               f"{reach_m:.2g} m misses by: {causes}")


def rounded(robot: Robot, data: Dataset, left_m: float) -> Iterator[str]:
    """Readings on a grid that alone leaves about as much."""
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
    """The length and the zero that are farthest from the robot file's, where no arm is so far off its
    drawing. They are estimated, and right where the data are; the file may be another arm's."""
    lengths = [(abs(getattr(new, name) - getattr(old, name)), f"{name}_{i}", getattr(old, name))
               for i, (old, new) in enumerate(zip(declared.joints, found.joints), start=1) for name in "ad"]
    off, name, old = max(lengths)
    if off > FAR_FROM_DRAWING * found.reach:
        yield (f"{name} comes out {1e3 * off:.3g} mm from the {1e3 * old:.5g} mm of the robot file, more "
               "than an arm is off its drawing: is it the file of this arm, and its table right?")
    zeros = [(new.q_offset - old.q_offset, i)
             for i, (old, new) in enumerate(zip(declared.joints, found.joints), start=1)
             if old.type == "revolute"]
    turned, axis = max(zeros, key=lambda zero: abs(zero[0]), default=(0.0, 0))
    if abs(turned) > FAR_ZERO_RAD:
        yield (f"the zero of axis {axis} comes out {np.degrees(turned):+.3g} degrees from the robot file's "
               f"(q_offset_{axis}), more than arms are mastered apart: is the file of another arm, or was "
               "the axis mastered anew? It is estimated; the written file has it")
