"""Do a robot file and a pose file belong together? Asked before anything is fitted but the frames.

With base and tool fitted, every joint zero of an assembled robot off by a degree moves the target by less
than 3 % of the reach; what is further off is another robot, other columns or another unit. Which of them,
first aid tries (`exactarm.first_aid.first_aid`).
"""

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.frames import FoundFrames
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import Robot

WORST_SHARE = 0.03  # of the reach, RMS with the frames fitted


class Mismatch(InputError):
    """Robot and data do not match. refusal: the line without its question; the others: what was compared."""

    def __init__(self, refusal: str, robot: Robot, rows: Dataset, carried: Layout, seed: int):
        super().__init__(f"{refusal}: {_question(rows)}", file=rows.first_file)
        self.refusal, self.robot, self.rows, self.carried, self.seed = refusal, robot, rows, carried, seed


def _question(rows: Dataset) -> str:
    angles = rows.joints.get("q", rows.joints.get("theta"))
    still = np.flatnonzero(np.ptp(angles, axis=0) == 0.0)
    if still.size:
        return f"is it another robot, or an angle that was not measured ({axes_in_words(still)} never moves)?"
    return "is it another robot, or are angles and positions in different orders?"


def require_match(robot: Robot, data: Dataset, found: list[tuple[int, FoundFrames]], carried: Layout,
                  seed: int = DEFAULT_SEED) -> None:
    """Raises Mismatch where the robot cannot have moved the target so; `found`: frames by session."""
    for session, frames in found:
        if frames.rms > WORST_SHARE * robot.reach:
            refusal = (
                f"robot and data do not match: with the best base and tool of session {session}, "
                f"{robot.name} misses the measured points by {frames.rms:.3g} m (RMS), expected less than "
                f"{WORST_SHARE * robot.reach:.2g} m")
            raise Mismatch(refusal, robot, data.select(data.session == session), carried, seed)
