"""The chain for tracked motions: motor angles over time in, path of the target (N, 3) in m out.

Motor angles, gears and loads as for any motion (chain/motion.py): the springs carry the torque of the inverse
dynamics, gravity and acceleration (quasi-static: they do not ring). From the joints on it is the chain of
static poses: geometry, base and tool frames, device.
"""

from exactarm.chain.layout import Layout
from exactarm.chain.motion import motion_view
from exactarm.chain.motion_record import MotionRecord, full_record
from exactarm.chain.poses import PosePrediction, predict_target
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.robot.robot import Robot


def predict_tracked_motion(robot: Robot, layout: Layout, data: Dataset, *, record: MotionRecord | None = None,
                           tangents: bool = True, threads: int = 1, bent=None) -> PosePrediction:
    """Prediction of every row of `data`; `record`: of the same data (`full_record`), to save its
    preparation; bent: `MotionView.bent` of the same motion, where that is known."""
    record = full_record(robot, data) if record is None else record
    view = motion_view(robot, layout, record, tangents=tangents, threads=threads, kind=TRACKED_MOTION.name,
                       bent=bent)
    view.predict = lambda robot, layout, record, threads, bent: predict_tracked_motion(
        robot, layout, record.data, record=record, threads=threads, bent=bent)
    return predict_target(view, layout, tangents)
