"""Do a robot file and a pose file belong together? Asked before anything is fitted but the frames.

With base and tool fitted, every joint zero of an assembled robot off by a degree moves the target by less
than 3 % of the reach; what is further off is another robot, other columns or another unit. A free tool point
can follow points of any spread, so what is meant is found by trying the usual mistakes: the one without which
the robot fits is named.
"""

from __future__ import annotations

from exactarm.chain import Layout
from exactarm.dataset import Dataset
from exactarm.errors import InputError
from exactarm.identify.frames import FoundFrames
from exactarm.identify.pose_mistakes import pose_mistakes
from exactarm.identify.reach import reach
from exactarm.robot import Robot
from exactarm.split import DEFAULT_SEED

WORST_SHARE = 0.03  # of the reach, RMS with the frames fitted


class Mismatch(InputError):
    """Robot and data do not match. refusal: the line without its question; cause: the usual mistake that the
    rows themselves show, None where they show none."""

    def __init__(self, refusal: str, cause: str | None, file: object):
        super().__init__(f"{refusal}: {cause or 'is it another robot?'}", file=file)
        self.refusal, self.cause = refusal, cause


def require_match(robot: Robot, data: Dataset, found: list[tuple[int, FoundFrames]], carried: Layout,
                  seed: int = DEFAULT_SEED) -> None:
    """Raises InputError where the robot cannot have moved the target as measured; `found`: frames by
    session."""
    for session, frames in found:
        if frames.rms <= WORST_SHARE * reach(robot):
            continue
        rows = data.select(data.session == session)
        meant = pose_mistakes(robot, rows, carried, seed)
        cause = None
        if meant:
            cause = meant[0].text if meant[0].sentence else f"is it {meant[0].words}?"
        raise Mismatch(
            f"robot and data do not match: with the best base and tool of session {session}, {robot.name} "
            f"misses the measured points by {frames.rms:.3g} m (RMS), expected less than "
            f"{WORST_SHARE * reach(robot):.2g} m", cause, rows.first_file,
        )
