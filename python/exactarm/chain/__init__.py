"""The measurement chain: predicts what a device measures, with the derivative, from robot and effects.

    theta --gear--> phi --spring--> q --geometry--> target --device--> measured

Every step of the program (identification, simulation, diagnosis, planning, reports) predicts through here.
"""

from exactarm.chain.gear_record import GearRecord, gear_record
from exactarm.chain.gear_run import GearRunPrediction, predict_gear_run
from exactarm.chain.layout import Layout
from exactarm.chain.motion import MotionPrediction, predict_motion
from exactarm.chain.motion_record import MotionRecord, motion_record
from exactarm.chain.passage import motion_clear_of_reversals, reversals_left_out, track_clear_of_reversals
from exactarm.chain.poses import PosePrediction, predict_poses
from exactarm.chain.tracked_motion import predict_tracked_motion
from exactarm.view import View

__all__ = ["GearRecord", "GearRunPrediction", "Layout", "MotionPrediction", "MotionRecord", "PosePrediction",
           "View", "gear_record", "motion_clear_of_reversals", "motion_record", "predict_gear_run",
           "predict_motion", "predict_poses", "predict_tracked_motion", "reversals_left_out",
           "track_clear_of_reversals"]
