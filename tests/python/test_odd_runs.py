"""Mistakes in one of several runs of a motion, with torques or under a tracker: told with the run and the
guess; right runs are not suspected, though friction and declared payloads differ between them."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import Dataset, read_dataset
from exactarm.effects.payload import Payload
from exactarm.files.examples import data_path
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.odd_runs import odd_runs
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_tracked_motion
from exactarm.simulate.profiles import excitation
from six_axis import six_axis
from test_first_aid import column, order, scaled, shifted
from test_first_aid_units import later
from test_identify_dynamics import log_of, true_arm

SECONDS, RATE_HZ = 8.0, 100.0
PAYLOAD_KG, CENTRE_M = 5.0, 0.1  # along z of the flange


def joined(*parts: Dataset) -> Dataset:
    rows = [len(part) for part in parts]
    stack = lambda pick: np.concatenate([pick(part) for part in parts])
    names = {name for part in parts for name in part.covariates}
    return Dataset.of_arrays(
        "motion", {name: stack(lambda part: part.joints[name]) for name in parts[0].joints},
        time=stack(lambda part: part.time), run=np.repeat(np.arange(1, len(parts) + 1), rows),
        covariates={name: stack(lambda part: part.covariates.get(name, np.zeros(len(part))))
                    for name in names})


def both(change):
    return lambda data: column(column(data, "theta", change), "tau", change)


def carrying(mass_kg: float, seed: int, said_kg: float) -> Dataset:
    """A run of the arm with a payload at the flange that the file says to be `said_kg`."""
    arm = Payload(None, (mass_kg, 0.0, 0.0, mass_kg * CENTRE_M)).bake(true_arm(5))
    data = log_of(arm, SECONDS, seed, RATE_HZ)
    said = {"payload_kg": said_kg, "payload_z_m": CENTRE_M}
    return replace(data, covariates={name: np.full(len(data), value) for name, value in said.items()})


@pytest.fixture(scope="module")
def runs():
    return [log_of(true_arm(5), SECONDS, seed, RATE_HZ) for seed in (10, 11, 12)]


MISTAKES = {
    "mNm": (lambda d: column(d, "tau", lambda v: 1e3 * v), "mNm labelled as Nm"),
    "lbf ft": (lambda d: column(d, "tau", lambda v: v / 1.355818), "lbf ft labelled as Nm"),
    "negated torques": (lambda d: column(d, "tau", lambda v: -v), "torques of the opposite sign"),
    "a negated axis": (both(scaled(1, -1.0)), "the opposite sign of axis 2 (angle and torque)"),
    "a negated torque": (lambda d: column(d, "tau", scaled(2, -1.0)),
                         "the opposite sign of the torque of axis 3"),
    "a negated angle": (lambda d: column(d, "theta", scaled(1, -1.0)),
                        "the opposite sign of the angle of axis 2"),
    "exchanged axes": (both(order(1, 3, 2, 4, 5, 6)), "axes 2 and 3 exchanged"),
    "exchanged torques": (lambda d: column(d, "tau", order(1, 2, 3, 4, 6, 5)),
                          "the torques of axes 5 and 6 exchanged"),
    "degrees": (lambda d: column(d, "theta", np.degrees), "degrees labelled as radians"),
    "radians as degrees": (lambda d: column(d, "theta", np.radians), "radians labelled as degrees"),
    "torques of the motors": (lambda d: column(d, "tau", lambda v: v / np.abs(six_axis().ratios)),
                              "torques of the motors labelled as those behind the gears"),
    "a lost zero": (lambda d: column(d, "theta", shifted(1, 0.5 * np.pi * six_axis().ratios[1])),
                    "another zero of axis 2 (by -90 degrees)"),
    "another clock": (lambda d: column(d, "tau", later(5)), "the torques logged 0.049 s later"),
    "another time": (lambda d: replace(d, time=1.5 * d.time), "all times 1.5 times shorter"),
}


# Those that take over half a second.
LONG = {"another time", "degrees", "lbf ft", "a lost zero", "a negated axis", "exchanged axes",
        "torques of the motors", "exchanged torques", "millimetres"}


def names_of(mistakes):
    return [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in mistakes]


@pytest.mark.slow
@pytest.mark.parametrize("name", names_of(MISTAKES))
def test_a_mistake_in_one_run_is_told_with_the_run(runs, name):
    change, words = MISTAKES[name]
    said = first_aid(six_axis(), joined(runs[0], change(runs[1]), runs[2]))
    assert len(said) == 1 and f"with {words} in run 2 (row 801 to row 1600)" in said[0], said


@pytest.mark.slow
def test_of_two_runs_either_may_be_the_wrong_one(runs):
    said = odd_runs(six_axis(), joined(runs[0], MISTAKES["mNm"][0](runs[1])))
    assert "in run" in said[0].text and "(or the reverse in the other run)" in said[0].text
    said = odd_runs(six_axis(), joined(runs[0], MISTAKES["negated torques"][0](runs[1])))
    assert "in run 2" in said[0].text and "reverse" not in said[0].text  # friction would drive in the other


@pytest.mark.slow
def test_a_payload_that_no_file_declares_is_told(runs):
    unsaid = replace(carrying(PAYLOAD_KG, 11, 0.0), covariates={})
    said = first_aid(six_axis(), joined(runs[0], unsaid, runs[2]))
    assert len(said) == 1 and "other masses (payload, tool or robot) in run 2" in said[0], said


@pytest.mark.slow
@pytest.mark.parametrize("said_kg, words", [
    (PAYLOAD_KG, ""), (PAYLOAD_KG / 0.45359237, "a payload in lb labelled as kg in run 2"),
    (1e3 * PAYLOAD_KG, "a payload in g labelled as kg in run 2"),
])
def test_a_declared_payload_is_no_mistake_and_its_unit_is_told(runs, said_kg, words):
    said = [each.text for each in odd_runs(six_axis(), joined(runs[0], carrying(PAYLOAD_KG, 11, said_kg),
                                                              runs[2]))]
    assert (words in said[0]) if words else said == []


@pytest.mark.slow
def test_friction_that_differs_between_runs_is_not_suspected(runs):
    """Cold grease: half as much friction again as in the others."""
    joints = tuple(replace(j, coulomb=1.5 * j.coulomb, viscous=1.5 * j.viscous) for j in true_arm(5).joints)
    cold = log_of(replace(true_arm(5), joints=joints), SECONDS, 11, RATE_HZ)
    assert first_aid(six_axis(), joined(cold, *runs[1:])) == ()


@pytest.mark.slow
@pytest.mark.parametrize("count", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_right_runs_are_not_suspected(runs, count):
    assert first_aid(six_axis(), joined(*runs[:count])) == ()


@pytest.mark.slow
@pytest.mark.parametrize("parts", [2, 4])
def test_the_shipped_motion_in_parts_is_not_suspected(parts):
    robot = load_robot("tx40")
    data = read_dataset(data_path("tx40/motion.parquet"), robot)
    assert first_aid(robot, replace(data, run=1 + parts * np.arange(len(data)) // len(data))) == ()


@pytest.fixture(scope="module")
def tracked():
    """Three runs of 10 s under a tracker."""
    robot = load_robot("racer-7-1.4")
    virtual = VirtualRobot.of(robot)
    parts = [excitation(robot, 10.0, 100.0, np.random.default_rng(6 + k)) for k in range(3)]
    time, q = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    run = np.repeat([1, 2, 3], [len(part[0]) for part in parts])
    return robot, measure_tracked_motion(virtual, time, virtual.motor_angles(q), Sensors(),
                                         np.random.default_rng(7), run=run, quasi_static=True)


TRACKED = {
    "degrees": (np.degrees, None, "degrees labelled as radians from about row"),
    "a negated axis": (scaled(1, -1.0), None, "the opposite sign of axis 2 from about row"),
    "millimetres": (None, lambda p: 1e3 * p, "millimetres labelled as metres from about row"),
    "half a second": (None, lambda p: np.roll(p, 50, axis=0), "run 2: the tracker lags by"),
    "a tenth of a second": (None, lambda p: np.roll(p, 10, axis=0), "s later than in the other runs"),
}


@pytest.mark.slow
def test_right_runs_under_a_tracker_are_not_suspected(tracked):
    assert first_aid(*tracked) == ()


@pytest.mark.parametrize("name", names_of(TRACKED))
@pytest.mark.slow
def test_a_mistake_in_one_run_under_a_tracker_is_told_with_its_rows(tracked, name):
    robot, data = tracked
    angles, positions, words = TRACKED[name]
    rows = np.flatnonzero(data.run == 2)
    theta, position = data.joints["theta"].copy(), data.position.copy()
    theta[rows] = angles(theta[rows]) if angles else theta[rows]
    position[rows] = positions(position[rows]) if positions else position[rows]
    said = first_aid(robot, replace(data, joints=data.joints | {"theta": theta}, position=position))
    assert any(words in each for each in said), said
