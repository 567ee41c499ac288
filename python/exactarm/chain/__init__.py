"""The measurement chain: predicts what a device measures, with the derivative, from robot and effects.

    theta --gear--> phi --spring--> q --geometry--> target --device--> measured

Every step of the program (identification, simulation, diagnosis, planning, reports) predicts through here.
"""

from exactarm.chain.layout import Layout
from exactarm.chain.poses import PosePrediction, predict_poses
from exactarm.chain.view import View

__all__ = ["Layout", "PosePrediction", "View", "predict_poses"]
