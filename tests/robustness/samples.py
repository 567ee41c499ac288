"""Small valid files, one of every sort that exactarm reads, to be spoiled: name -> bytes. Made from shipped
data, the same every time."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd

from exactarm.files.examples import data_path
from exactarm.plan.path_file import SHIPPED as PATHS
from exactarm.robot.urdf import urdf_text
from exactarm.robot.writer import robot_text
from exactarm.robot_file import load_robot
from robustness.virtual_samples import virtual_samples

ROWS = 40
FIXTURE = """\
[[distances]]
contact = "socket"
between = [0, 1]
length_mm = 50.0
[[radii]]
contact = "sphere"
number = 0
radius_mm = 12.7
"""
BOARD = """\
[board]
squares = [6, 5]
square_mm = 30
marker_mm = 22
dictionary = "DICT_4X4_50"
"""
PATH = """\
kind = "points"
points_m = [[0.9, 0.1, 0.6], [0.95, -0.1, 0.65], [0.9, -0.2, 0.7]]
times_s = [0.0, 1.0, 2.0]
rate_hz = 40
nu = 1e-10
orientation_wxyz = [0, 0, 1, 0]
"""
KRL = """\
DEF PART()
BAS(#INITMOV,0)
$BASE=BASE_DATA[1]
PTP XHOME
LIN {X 700.0, Y 10.0, Z 600.0, A 0.0, B 90.0, C 0.0}
LIN XP1
END
"""
KRL_DATA = """\
DEFDAT PART
DECL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL E6POS XP1={X 750.0,Y 0.0,Z 650.0,A 0.0,B 90.0,C 0.0,S 2,T 10}
ENDDAT
"""
URSCRIPT = """\
def part():
  movej([0.1, -1.2, 1.3, -0.4, 1.5, 0.2], a=1.4, v=1.05)
  movel(p[0.5, 0.2, 0.4, 0.0, 3.14, 0.0], a=1.2, v=0.25)
end
"""

DRAFT = """\
[[effects]]
effect = "expression"
title = "axis 5 is off by a square"
station = "GEAR"
joint = 5
of = ["q_4", "q_6"]
form = "a*(q_4 + q_6)^2"
values = { a = 3.1e-4 }
plausible = { a = 3e-4 }
"""
MANIFEST = """\
name,command,robot,files
one,evaluate,ur10,poses.csv
two,calibrate,ur10,poses.csv
"""
JOINT_LOG = "name,q_1_deg,q_2_deg,q_3_deg,q_4_deg,q_5_deg,q_6_deg\np1,1,2,3,4,5,6\np2,6,5,4,3,2,1\n"
POINTS = "// points\nmonday p1 1000.0 20.0 300.0\nmonday p2 900.0 10.0 310.5\n"


def _rows(frame: pd.DataFrame) -> bytes:
    return frame.to_csv(index=False).encode()


def _parquet(frame: pd.DataFrame) -> bytes:
    stream = io.BytesIO()
    frame.to_parquet(stream, index=False)
    return stream.getvalue()


def samples() -> dict[str, bytes]:
    """File name -> content."""
    poses = pd.read_csv(data_path("ur10/series_B.csv")).iloc[:: 1495 // ROWS][:ROWS]
    motion = pd.read_parquet(data_path("tx40/motion.parquet")).iloc[::20][:1200]
    runs = pd.read_parquet(data_path("kr300/run_A.parquet"))[:1500:3]
    closures = poses.drop(columns=["x_mm", "y_mm", "z_mm", "qw", "qx", "qy",
                                   "qz"]).assign(socket=np.arange(len(poses)) % 3)
    time = np.arange(60) / 50.0
    trajectory = pd.DataFrame({"time_s": time}
                              | {f"theta_{i}_rad": 3.0 * np.sin(time + i) for i in range(1, 7)})
    return {
        "poses.csv": _rows(poses),
        "day.csv": _rows(poses[:5]),
        "poses.parquet": _parquet(poses),
        "motion.csv": _rows(motion),
        "runs.csv": _rows(runs),
        "closures.csv": _rows(closures),
        "trajectory.csv": _rows(trajectory),
        "racer.toml": robot_text(load_robot("racer-7-1.4")).encode(),
        "ur10.toml": robot_text(load_robot("ur10")).encode(),
        "ur10.urdf": urdf_text(load_robot("ur10")).encode(),
        "path.toml": PATH.encode(),
        "line.toml": Path(PATHS / "line.toml").read_bytes(),
        "fixture.toml": FIXTURE.encode(),
        "board.toml": BOARD.encode(),
        "board.png": (Path(__file__).parent / "board.png").read_bytes(),
        "joints.csv": "\n".join(line.partition(",")[2] for line in JOINT_LOG.splitlines()[:2]).encode(),
        "part.src": KRL.encode(),
        "part.dat": KRL_DATA.encode(),
        "part.script": URSCRIPT.encode(),
        "draft.toml": DRAFT.encode(),
        "manifest.csv": MANIFEST.encode(),
        "log.csv": JOINT_LOG.encode(),
        "points.txt": POINTS.encode(),
    } | virtual_samples()
