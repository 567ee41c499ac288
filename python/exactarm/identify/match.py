"""Do a robot file and a pose file belong together? Asked before anything is fitted but the frames.

With base and tool fitted, every joint zero of an assembled robot off by a degree moves the target by less than 3 %
of the reach; what is further off is another robot, other columns or another unit. The reach is that of the
stretched arm, sum_i sqrt(a_i^2 + d_i^2), with the stroke of sliding axes. A free tool point can follow points of any
spread, so a wrong unit is told by trying the others: the one with which the robot fits is named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.dataset import Dataset
from exactarm.errors import InputError
from exactarm.identify.frames import FoundFrames, find_frames
from exactarm.robot import Robot
from exactarm.split import DEFAULT_SEED

WORST_SHARE = 0.03  # of the reach, RMS with the frames fitted
_DEGREE = np.pi / 180.0
_OTHER_LENGTHS = ((1e-3, "millimetres labelled as metres"), (1e3, "metres labelled as millimetres"))
_OTHER_ANGLES = ((_DEGREE, "degrees labelled as radians"), (1.0 / _DEGREE, "radians labelled as degrees"))
_ANGLES = ("theta", "q")


def reach(robot: Robot) -> float:
    """Length of the stretched arm, m."""
    strokes = [abs(bound or 0.0) for joint in robot.joints if joint.type == "prismatic" for bound in (joint.q_min, joint.q_max)]
    return float(sum(np.hypot(joint.a, joint.d) for joint in robot.joints) + sum(strokes))


def require_match(robot: Robot, data: Dataset, found: list[tuple[int, FoundFrames]], carried: Layout, seed: int = DEFAULT_SEED) -> None:
    """Raises InputError where the robot cannot have moved the target as measured; `found`: frames by session."""
    for session, frames in found:
        if frames.rms <= WORST_SHARE * reach(robot):
            continue
        rows = data.select(data.session == session)
        meant = _unit_that_fits(robot, rows, carried, seed)
        cause = f"were {meant}?" if meant else "is it another robot, or are axes exchanged or signs turned?"
        raise InputError(
            f"robot and data do not match: with the best base and tool of session {session}, {robot.name} misses the measured "
            f"points by {frames.rms:.3g} m (RMS), expected less than {WORST_SHARE * reach(robot):.2g} m: {cause}",
            file=rows.first_file,
        )


def _unit_that_fits(robot: Robot, data: Dataset, carried: Layout, seed: int) -> str | None:
    trials = [(replace(data, position=factor * data.position), words) for factor, words in _OTHER_LENGTHS]
    for factor, words in _OTHER_ANGLES:
        turned = {name: factor * data.joints[name] for name in _ANGLES if name in data.joints}
        trials.append((replace(data, joints=data.joints | turned), words))
    for trial, words in trials:
        try:
            fits = find_frames(robot, trial, carried, seed).rms <= WORST_SHARE * reach(robot)
        except InputError:
            continue
        spread = np.sqrt(np.mean(np.sum((trial.position - trial.position.mean(0)) ** 2, axis=1)))
        if fits and spread > WORST_SHARE * reach(robot):  # points shrunk to a dot would fit any robot
            return words
    return None
