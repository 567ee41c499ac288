"""Joint offsets, base and tool as the pendants of KUKA and ABB show frames: to be typed in by a person, never
written into a controller.

Changed link lengths belong into no controller (older ones refuse to start with them, and options of absolute
accuracy are closed): they are corrected in the programs. An offset is the angle of the real axis where the
controller reports zero.
"""

from __future__ import annotations

import numpy as np

from exactarm.compensate.angles import to_quaternion, to_zyx
from exactarm.robot.controller_frames import base_in_device, target_on_flange
from exactarm.robot.robot import Placement, Robot
from exactarm.robot.urdf import reported_shift

_W_FIRST = np.array([1.0, 0.0, 0.0, 0.0])


def offsets_text(robot: Robot) -> str:
    """A page of text."""
    lines = [
        f"Offsets of {robot.name}, identified",
        "",
        "Angle of the real axis where the controller reports zero",
    ]
    for index, joint in enumerate(robot.joints):
        shift = reported_shift(robot, index)
        lines.append(
            f"  axis {index + 1}: {1e3 * shift:+.4f} mm"
            if joint.type == "prismatic"
            else f"  axis {index + 1}: {np.degrees(shift):+.6f} deg"
        )
    lines += [
        "",
        "A mastering that is changed by such an angle moves every taught point of the robot. Check the sign "
        "on one axis first.",
    ]
    for title, placement in (
        ("Robot base in the frame of the measuring device", base_in_device(robot.base, robot.controller)),
        ("Measured target at the flange", target_on_flange(robot.tool, robot.controller)),
    ):
        lines += ["", title, *_frame(placement)]
    return "\n".join(lines) + "\n"


def _frame(placement: Placement) -> list[str]:
    x, y, z = 1e3 * placement.position
    a, b, c = np.degrees(to_zyx(placement.rotation, np.zeros(3)))
    q = to_quaternion(placement.rotation, _W_FIRST)
    return [
        f"  KUKA  {{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.6f},B {b:.6f},C {c:.6f}}}",
        f"  ABB   [[{x:.4f},{y:.4f},{z:.4f}],[{q[0]:.9f},{q[1]:.9f},{q[2]:.9f},{q[3]:.9f}]]",
    ]
