"""A station script for RoboDK: Python on its public API (robolink, robomath), units mm and degrees.

It adds the identified chain beside a robot of the station: a frame on each identified axis at reported zero,
and one at the flange; and it compares RoboDK's own flange with the identified one at some joint angles. It
uses calls that the API documents: Item, ItemUserPick, Valid, Parent, AddFrame, setPose, SolveFK; their names
and arguments were compared with the package robodk 6.0.2. BuildMechanism, the only documented call that gives
a robot lengths, takes seven of them and angles between axes that are exactly parallel or square, in the order
of a dialog, with the bodies of all links: the deviations of an identified arm have no place in it. So the
script shows and measures, and changes no kinematics. Not run against RoboDK itself here.
"""

from __future__ import annotations

import json

import numpy as np

from exactarm.errors import InputError
from exactarm.export.chain import ReportedChain, reported_chain
from exactarm.robot.robot import Placement, Robot

POSES, SEED, LARGEST_RAD = 20, 1, 1.5  # joint angles of the comparison, drawn within the limits

_SCRIPT = '''"""Station script of exactarm: the identified axes of {name} beside a robot of RoboDK, and how
far its model is off.

Run it in RoboDK (Tools, Run script) or with its Python package. Frames and numbers are in mm and degrees.
It changes no kinematics. The base of RoboDK's robot has to be that of the controller.
"""

from robodk.robolink import ITEM_TYPE_ROBOT, Robolink
from robodk.robomath import Mat

AXES = {axes}
FLANGE = {flange}
JOINTS_DEG = {joints}
POINTS_MM = {points}


def main():
    station = Robolink()
    robot = station.Item({name_text}, ITEM_TYPE_ROBOT)
    if not robot.Valid():
        robot = station.ItemUserPick("Robot that was identified", ITEM_TYPE_ROBOT)
    if not robot.Valid():
        raise SystemExit("no robot was picked")
    base = robot.Parent()
    for number, pose in enumerate(AXES, start=1):
        station.AddFrame("identified axis %d at zero" % number, base).setPose(Mat(pose))
    station.AddFrame("identified flange at zero", base).setPose(Mat(FLANGE))
    away = []
    for joints, point in zip(JOINTS_DEG, POINTS_MM):
        own = robot.SolveFK(joints).Pos()
        away.append(sum((a - b) ** 2 for a, b in zip(own, point)) ** 0.5)
    print("RoboDK's flange is off the identified one by %.3f mm on average, %.3f mm at most" % (
        sum(away) / len(away), max(away)))


if __name__ == "__main__":
    main()
'''


def station_script(robot: Robot) -> str:
    """The script's text."""
    if any(joint.type != "revolute" for joint in robot.joints):
        raise InputError(
            f"robot {robot.name} has a sliding axis; expected turning ones alone", file=robot.file
        )
    chain = reported_chain(robot)
    joints = _joints(robot)
    points = 1e3 * chain.poses(joints).position
    return _SCRIPT.format(
        name=robot.name.replace("\\", " ").replace('"', "'"),
        name_text=json.dumps(robot.name),
        axes=_list(_axes(chain)),
        flange=_matrix(chain.end),
        joints=_list(np.degrees(joints).round(6).tolist()),
        points=_list(points.round(6).tolist()),
    )


def _axes(chain: ReportedChain) -> list[list[list[float]]]:
    """Frames with z along positive turning."""
    flipped = np.diag([1.0, -1.0, -1.0])
    return [
        _matrix(Placement(start.rotation if sign > 0 else start.rotation @ flipped, start.position))
        for start, sign in zip(chain.starts, chain.signs, strict=True)
    ]


def _joints(robot: Robot) -> np.ndarray:
    """(POSES, n) rad, rounded to what the script holds."""
    low = [-LARGEST_RAD if joint.q_min is None else max(joint.q_min, -LARGEST_RAD) for joint in robot.joints]
    high = [LARGEST_RAD if joint.q_max is None else min(joint.q_max, LARGEST_RAD) for joint in robot.joints]
    drawn = np.random.default_rng(SEED).uniform(low, high, (POSES, robot.axes))
    return np.radians(np.degrees(drawn).round(6))


def _matrix(place: Placement) -> list[list[float]]:
    """4 x 4, mm."""
    matrix = place.matrix
    matrix[:3, 3] *= 1e3
    return (matrix + 0.0).tolist()


def _list(rows: list) -> str:
    return "[\n" + "".join(f"    {row!r},\n" for row in rows) + "]"
