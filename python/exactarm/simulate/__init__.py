"""The virtual robot: a robot file plus declared or hidden effects, measured as the real one would be.

It predicts through the same chain and effect objects as everything else, lets the joint springs swing under
the motors' motion (plant.py), and reads the result with noisy, counting, late and warming sensors
(sensors.py).
`independent.py` is another plant, by another engine, so that the model is never judged only by itself.
"""

from exactarm.simulate.measure import measure_gear_runs, measure_motion, measure_poses, measure_tracked_motion
from exactarm.simulate.sensors import Sensors
from exactarm.simulate.virtual_robot import VirtualRobot, deviated, parse_effect

__all__ = [
    "Sensors",
    "VirtualRobot",
    "deviated",
    "measure_gear_runs",
    "measure_motion",
    "measure_poses",
    "measure_tracked_motion",
    "parse_effect",
]
