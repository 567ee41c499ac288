"""What to do next after a fit (the same sentences for every command that gives a robot file), and after a
judgement."""

from __future__ import annotations

from exactarm.kinds.base import Device, Kind
from exactarm.report import Text
from exactarm.robot import Robot

ENOUGH_FALL = 0.9  # of the error before: less is no success worth a new robot file
_FITTED_BY = {Device.GEAR: "gear", Device.DRIVES: "identify"}  # else calibrate


def to_improve(kind: Kind) -> Text:
    """After a judgement."""
    fit = _FITTED_BY.get(kind.device, "calibrate")
    return Text("What to do next", (
        f"If this is more than your work allows, `exactarm {fit}` and `exactarm diagnose` with other "
        f"{kind.rows} lower it; keep these to judge by.",
    ))


def next_steps(robot: Robot, kind: Kind, before: float, after: float) -> Text:
    """before, after: errors of the rows that judge."""
    lines = []
    if after < ENOUGH_FALL * before:
        lines.append("Use `robot.toml` of this folder in place of your robot file"
                     + (": `exactarm compensate` (programs) and `exactarm plan` (paths) calculate with it."
                        if robot.has_geometry else "."))
        lines.append(f"{kind.anew} and run `exactarm evaluate robot.toml NEW.csv`: the error there is the "
                     "one to trust.")
    else:
        lines.append("Keep your robot file: what was estimated hardly lowers the error.")
    lines.append("`exactarm diagnose` with the same robot and files looks for the causes of what is left.")
    return Text("What to do next", tuple(lines))
