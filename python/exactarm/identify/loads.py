"""Where the load of an arm at rest comes from: declared or generic masses, measured torques, known payloads.

An arm without declared masses gets generic ones (robot/generic_masses.py), so that causes that need a load
can be looked for. Where drive torques were measured at rest, these masses are scaled to them: with g the
gravity of the generic links, g_t that of a tenth of their mass at the flange, and tau the measured torques
of all axes together,

    tau = s g + t g_t,   s, t >= 0   (least squares)

so that a compliance found under measured loads keeps its size where no torque is measured.
"""

from dataclasses import replace

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import kind_of
from exactarm.rest_load import TIP_SHARE, RestLoad
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.generic_masses import with_declared_masses, with_generic_masses
from exactarm.robot.robot import Robot
from exactarm.view import motor_angles

LEAST_SHARE = 0.5  # of the square sum of measured torques that gravity must explain, to size the masses


def with_loads(robot: Robot, data: Dataset) -> Robot:
    """The robot to analyse data with: generic masses where a place is measured, else declared ones alone."""
    if not kind_of(data.kind).shows_generic_loads:
        return with_declared_masses(robot)
    guessed = with_generic_masses(robot)
    return _as_measured(guessed, data) if guessed is not robot and guessed.generic_masses else robot


def _as_measured(robot: Robot, data: Dataset) -> Robot:
    """Generic links scaled to the torques that were measured, where gravity explains them."""
    load = RestLoad.of(robot, data)
    if not load.fixed.any():
        return robot
    q = joint_angles(robot, data)
    parts = load.parts(q)
    carried = replace(load, measured=np.full_like(load.measured, np.nan)).torque(q) - parts["own"][0]
    measured = (load.measured - carried)[load.fixed]
    columns = np.stack([parts[name][0][load.fixed] for name in ("own", "tip")], axis=1)
    (own, tip), left = scipy.optimize.nnls(columns, measured)
    if own <= 0.0 or left**2 > (1.0 - LEAST_SHARE) * float(measured @ measured):
        return robot
    total = sum(link.mass for link in robot.links)
    links = [replace(link, mass=own * link.mass) for link in robot.links]
    last, added = links[-1], tip * TIP_SHARE * total
    centre = last.centre_of_mass * last.mass / (last.mass + added)
    links[-1] = replace(last, mass=last.mass + added, centre_of_mass=centre)
    return replace(robot, links=tuple(links))


def joint_angles(robot: Robot, data: Dataset) -> np.ndarray:
    """(N, n) nominal joint angles of the rows."""
    return motor_angles(robot, data) / robot.ratios + robot.offsets


def kept_masses(result: Robot, declared: Robot) -> Robot:
    """The result with the masses that it needs: generic ones stay only where an effect needs a load."""
    if declared.generic_masses:
        if result.links is not None:
            return result
        return replace(result, links=declared.links, generic_masses=True)
    needed = any(effect.by_load for effect in result.effects)
    return result if needed else with_declared_masses(result)


def load_lines(robot: Robot, data: Dataset) -> tuple[str, ...]:
    """In words: loads that were measured, and payloads that are known; `robot` as `with_loads` gives it."""
    load, lines = RestLoad.of(robot, data), []
    axes = np.flatnonzero(load.fixed.all(axis=0))
    if axes.size:
        lines.append(f"the load of {axes_in_words(axes)} is the torque that was measured")
    if load.payload:
        masses = ", ".join(f"{mass:.3g}" for mass in np.unique(data.payload[0])[:8])
        lines.append(f"the flange carries the payload of each row ({masses} kg) beside the links")
    return tuple(lines)


def guess_line(robot: Robot, data: Dataset) -> str | None:
    """In words: loads that are those of generic masses; None where there are none."""
    load = RestLoad.of(robot, data)
    measured = load.fixed.all(axis=0)
    if not robot.generic_masses or measured.all():
        return None
    by = "of the mass that it declares, less its base" if robot.mass else "by its lengths"
    by = "scaled to the measured torques" if measured.any() else by
    total = sum(link.mass for link in robot.links)
    other = "other " if measured.any() else ""
    sizes = ("stiffness has its size by the known payloads, which differ" if load.payload_varies else
             "what depends on a load has its size by it, and a diagnosis an interval as wide as arms differ: "
             "declare [[links]] or give measured torques to make it absolute")
    return (f"the robot file declares no link masses: {other}loads are those of a generic "
            f"distribution of {total:.3g} kg ({by}); {sizes}")


def load_json(robot: Robot, data: Dataset) -> dict:
    """For result.json: source of the load of every axis, and the mass of the links."""
    load = RestLoad.of(robot, data)
    links = None if robot.links is None else "generic" if robot.generic_masses else "declared"
    total = None if robot.links is None else sum(link.mass for link in robot.links)
    sources = ["measured" if fixed else links for fixed in load.fixed.all(axis=0)]
    return {"source": sources, "links_kg": total, "payload": bool(load.payload)}

