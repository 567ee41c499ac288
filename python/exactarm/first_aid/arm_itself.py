"""What poses leave where no mistake of the user is in them: what leaves as much is none.

Of the millimetres that a drawing leaves, a mistake that lets go of one axis (its angles in another unit,
where the target lies near it) may take most, and yet less than an arm that is not as drawn. Where the file is
that of another arm, one that hardly turns leaves less than the arm itself, and explains nothing.
"""

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.errors import InputError
from exactarm.identify.calibrate import CalibrationOptions, fit_identifiable
from exactarm.identify.declared import frames_layout, geometry_layout
from exactarm.robot.robot import Robot


def left_by_geometry(robot: Robot, carried: Layout, data: Dataset, seed: int) -> float:
    """RMS in m of the position error that the calibrated arm leaves, for the degrees of freedom that it has
    taken; infinite where the poses are too few for it."""
    frames, _ = frames_layout(robot, data, orientation=False, seed=seed)
    layout = frames.joined(carried).joined(geometry_layout(robot))
    try:
        fitted, _ = fit_identifiable(robot, layout, data, False, CalibrationOptions(seed=seed))
    except InputError:
        return np.inf
    return float(np.sqrt(3.0) * fitted.sigma_position)


def left_standing(data: Dataset) -> float:
    """RMS in m of the points about the mean of their session: what an arm that stands still leaves."""
    session = np.unique(data.session, return_inverse=True)[1]
    means = np.stack([np.bincount(session, weights=column) for column in data.position.T], axis=1)
    about = data.position - (means / np.bincount(session)[:, None])[session]
    return float(np.sqrt(np.mean(np.sum(about**2, axis=1))))
