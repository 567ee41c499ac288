"""More usual mistakes: angles in turns, lengths in inches, a unit that changes halfway, columns a row beside
the others, wrapped angles, clocks that differ, a lost target; and a target that is turned on its flange,
a wrapped angle of a joint, and a turn more, which are none."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import exactarm as ea
from exactarm.first_aid.clock_drift import lags
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.pose_candidates import MIRRORED
from exactarm.identify.evaluate import evaluate_poses
from exactarm.identify.match import Mismatch
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_poses
from exactarm.simulate.profiles import limit
from set_ups import at_random_place, joints_in_limits, measured
from test_first_aid import (  # noqa: F401
    column,
    kr300,
    order,
    position,
    scaled,
    shifted,
    tracked,
    tx40,
    ur10,
)

HALFWAY = 700  # of 1,495 rows
MISTAKES = {
    "turns as radians": (
        lambda d: column(d, "q", scaled(slice(None), 0.5 / np.pi)), "whole turns labelled as radians",
    ),
    "inches as millimetres": (
        lambda d: position(d, lambda p: p / 25.4), "an arm 25.4 times as large as the measured one",
    ),
    "halfway another unit": (
        lambda d: position(d, lambda p: np.where(np.arange(len(p))[:, None] > HALFWAY, 1e-3 * p, p)),
        "labelled as",
    ),
    "one column of angles a row late": (
        lambda d: column(d, "q", rolled(2, 1)),
        "the angles of axis 3 one row later than the others",
    ),
    "one column of angles two rows late": (
        lambda d: column(d, "q", rolled(4, 2)), "the angles of axis 5 two rows later than the others",
    ),
    "z a row late": (lambda d: position(d, rolled(2, 1)), "column z one row later than the others"),
    "the device two rows late": (
        lambda d: replace(d, position=np.roll(d.position, 2, axis=0),
                          rotation=np.roll(d.rotation, 2, axis=0)),
        "positions two rows later than the angles",
    ),
    "a lost target": (
        lambda d: position(d, lambda p: np.where(np.arange(len(p))[:, None] > 1300, p[1300], p)),
        "had the device lost its target?",
    ),
    "lost targets written as 0": (
        lambda d: position(d, lambda p: np.where(np.arange(len(p))[:, None] % 13 == 5, 0.0, p)),
        "x, y and z are exactly 0 in row 6 of",
    ),
    "a left-handed device": (
        lambda d: replace(d, position=d.position * [1, -1, 1],
                          rotation=np.diag([1.0, -1.0, 1.0]) @ d.rotation @ np.diag([1.0, -1.0, 1.0])),
        "one of x, y, z with the opposite sign, or two",
    ),
}


def rolled(column, rows):
    def change(values):
        values[:, column] = np.roll(values[:, column], rows)
        return values

    return change


def wrapped(values):
    return (values + np.pi) % (2.0 * np.pi) - np.pi


def later(samples):
    return lambda values: np.roll(values, samples, axis=0)


def on_a_clock(share):
    def change(values):
        rows = np.arange(len(values))
        return np.stack([np.interp(share * rows, rows, one) for one in values.T], axis=1)

    return change


def test_the_names_of_the_targets_axes_mean_nothing(ur10):  # noqa: F811
    """A target turned by half a turn on its flange is another tool frame, which the set-up fits."""
    robot, data = ur10
    part = data.select(np.arange(0, len(data), 20))
    turned = replace(part, rotation=part.rotation @ np.diag([-1.0, -1.0, 1.0]))
    one, other = (evaluate_poses(robot, each).overall for each in (part, turned))
    assert other.rms == pytest.approx(one.rms, rel=1e-6)


MOTION = {
    "whole turns": (
        lambda d: column(d, "theta", scaled(slice(None), 0.5 / np.pi)), "whole turns labelled as radians",
    ),
    "both columns of two axes exchanged": (
        lambda d: column(column(d, "theta", order(1, 3, 2, 4, 5, 6)), "tau_motor", order(1, 3, 2, 4, 5, 6)),
        "with axes 2 and 3 exchanged",
    ),
    "both signs of one axis": (
        lambda d: column(column(d, "theta", scaled(1, -1)), "tau_motor", scaled(1, -1)),
        "the opposite sign of axis 2",
    ),
    "another zero": (
        lambda d: column(d, "theta", shifted(1, 0.5 * np.pi * load_robot("tx40").joints[1].ratio)),
        "another zero of axis 2 (by -90 degrees)",
    ),
    "torques of the links labelled as the motors'": (
        lambda d: column(d, "tau_motor", lambda tau: tau * np.abs(load_robot("tx40").ratios)),
        "or at the motor's shaft",
    ),
    "microseconds as seconds": (lambda d: replace(d, time=1e6 * d.time), "is the time in microseconds"),
    "torques late": (lambda d: column(d, "tau_motor", later(100)), "with the torques logged 0.02 s later"),
    "a clock that drifts": (
        lambda d: column(d, "tau_motor", on_a_clock(1.01)), "% faster than that of the angles",
    ),
    "wrapped angles": (lambda d: column(d, "theta", wrapped), "are the angles wrapped"),
    "absolute torques": (lambda d: column(d, "tau_motor", np.abs), "are they absolute values?"),
}


MADE = {"ur10": MISTAKES, "tx40": MOTION}


@pytest.mark.slow
@pytest.mark.parametrize("arm, name", [(arm, name) for arm in MADE for name in MADE[arm]])
def test_a_mistake_in_shipped_data_is_told(request, arm, name):
    robot, data = request.getfixturevalue(arm)
    change, words = MADE[arm][name]
    found = first_aid(robot, change(data))
    assert found and words in found[0], found


def of_the_link_before(robot):
    """The table as Craig writes it: a and alpha in the row of the next axis."""
    before = (robot.joints[0], *robot.joints[:-1])
    rows = zip(robot.joints, before, range(robot.axes))
    return replace(robot, joints=tuple(
        replace(joint, a=other.a if i else 0.0, alpha=other.alpha if i else 0.0, beta=None)
        for joint, other, i in rows))


@pytest.mark.parametrize("name", ["racer-7-1.4", "ur10"])
def test_a_table_of_the_other_convention_is_told(name):
    """An arm of another table altogether ("another robot") was all that was said. Any seed: the error falls
    a thousandfold."""
    robot, random = load_robot(name), np.random.default_rng(2)
    data = measured(robot, [at_random_place(robot, random)], [joints_in_limits(robot, 60, random)], 1e-4,
                    random)
    assert first_aid(robot, data) == ()
    found = first_aid(of_the_link_before(robot), data)
    assert found and "a table whose rows hold a and alpha of the link before" in found[0], found


def test_a_left_handed_device_before_an_arm_that_its_mirror_image_matches_is_told():
    """With the signs of axes 1, 4 and 6, which alone were named: of a wrist without offsets they do the
    same, orientations included. Any seed: both leave the noise."""
    robot, random = load_robot("racer-7-1.4"), np.random.default_rng(3)
    data = measured(robot, [at_random_place(robot, random)], [joints_in_limits(robot, 60, random)], 1e-4,
                    random, noise_rad=1e-4)
    mirror = np.array([1.0, -1.0, 1.0])
    left = replace(data, position=data.position * mirror, rotation=data.rotation * np.outer(mirror, mirror))
    found = first_aid(robot, left)
    assert "the opposite sign of axes 1, 4 and 6" in found[0] and MIRRORED in found[0], found


def test_a_motion_of_another_robot_is_told_by_name(tx40):  # noqa: F811
    found = first_aid(load_robot("racer-7-1.4"), tx40[1])
    assert found and "with data of tx40" in found[0], found


def test_a_clock_that_drifts_between_encoders_is_told(kr300):  # noqa: F811
    robot, data = kr300
    found = first_aid(robot, column(data, "q", on_a_clock(1.01)))
    assert found and "the encoder behind the gear lags" in found[0], found
    assert "are the angles wrapped" in first_aid(robot, column(data, "theta", wrapped))[0]


@pytest.mark.slow
def test_a_tracker_that_starts_a_second_late_is_told(tracked):  # noqa: F811
    robot, data = tracked
    assert "the tracker lags by" in first_aid(robot, position(data, later(100)))[0]


@pytest.mark.parametrize("late", [0, 7, -20, 60])
def test_a_lag_between_long_plateaus_is_found(late):
    time = 0.004 * np.arange(1500)
    speed = np.interp(time, [0.0, 0.3, 0.6, 5.4, 5.7, 6.0], [0.0, 0.0, 0.6, 0.6, 0.0, 0.0])
    found = lags(time, speed, np.roll(speed, late))
    assert [found.first, found.last] == pytest.approx([0.004 * late] * 2, abs=5e-4) and not found.drifts


def test_a_lag_between_encoders_is_told_with_its_size(kr300):  # noqa: F811
    """Each run has ramps and plateaus: the size of the two over all samples hid four fifths of the lag."""
    robot, data = kr300
    late = column(data, "q", lambda q: np.concatenate([q[15:16].repeat(15, axis=0), q[:-15]]))
    (line,) = first_aid(robot, late.select(np.flatnonzero(data.time > 0.1)))
    told_s = float(line.partition("lags by ")[2].partition(" s ")[0])
    assert line.startswith("run 1: the encoder behind the gear lags by ")
    assert told_s == pytest.approx(0.06, abs=5e-3)


def test_stamps_that_do_not_rise_tell_no_lag():
    assert lags(np.zeros(100), np.arange(100.0), np.arange(100.0)) is None


@pytest.mark.slow
def test_wrapped_motor_angles_of_poses_are_told():
    robot, random = load_robot("racer-7-1.4"), np.random.default_rng(3)
    q = random.uniform(0.6 * limit(robot, "q_min"), 0.6 * limit(robot, "q_max"), (40, 6))
    data = measure_poses(VirtualRobot.of(robot), q, Sensors(position_m=3e-5, counts=0), random)
    assert first_aid(robot, data) == ()
    told = first_aid(robot, column(data, "theta", wrapped))
    assert "motor angles of all axes lie within one turn" in told[0]


@pytest.mark.parametrize("change", [wrapped, shifted(5, 2.0 * np.pi)])
def test_a_joint_angle_and_a_turn_more_are_the_same(ur10, change):  # noqa: F811
    robot, data = ur10
    part = data.select(np.arange(0, len(data), 20))
    one, other = (evaluate_poses(robot, each).overall for each in (part, column(part, "q", change)))
    assert other.rms == pytest.approx(one.rms, rel=1e-6)


@pytest.mark.slow
def test_what_no_candidate_explains_is_said_after_the_calibration(ur10):  # noqa: F811
    robot, data = ur10
    data = data.select(np.arange(0, len(data), 10))
    told = lambda d: [x for x in ea.calibrate(robot, d).warnings if "are left after calibration" in x]
    assert told(data) == [] and len(told(column(data, "q", lambda q: np.round(q, 1)))) == 1


TURNED = Rotation.from_rotvec([0.0, 0.0, np.pi / 2.0]).as_matrix()


@pytest.mark.parametrize("axis, degrees", [(2, 30.0), (3, -120.0), (1, 7.0)])
@pytest.mark.slow
def test_another_zero_by_any_angle_is_told_with_it(ur10, axis, degrees):  # noqa: F811
    """By 30 degrees it was refused with "is it another robot?"."""
    robot, data = ur10
    part = data.select(np.arange(0, len(data), 20))
    found = first_aid(robot, column(part, "q", shifted(axis, np.deg2rad(degrees))))
    assert found and f"another zero of axis {axis + 1} (by {-degrees:+.0f} degrees)" in re.sub(
        r"\(by ([+-][\d.]+)", lambda by: f"(by {float(by[1]):+.0f}", found[0]), found


@pytest.mark.parametrize("change, words", [
    (lambda rotation: TURNED @ rotation,
     "with orientations that count from axes turned by 90 degrees about (0, 0, -1) against x, y, z"),
    (lambda rotation: quaternions(rotation, [0, 3, 1, 2]), "that count from axes turned by 120 degrees"),
    (lambda rotation: np.swapaxes(TURNED @ rotation, 1, 2), "that count from axes turned by 132 degrees"),
])
@pytest.mark.slow
def test_orientations_in_other_axes_than_positions_are_told(ur10, change, words):  # noqa: F811
    """They went through without a word, or tore the positions off by half a metre."""
    robot, data = ur10
    part = data.select(np.arange(0, len(data), 20))
    found = first_aid(robot, replace(part, rotation=change(part.rotation)))
    assert found and words in found[0], found


def quaternions(rotation, order):
    w_first = Rotation.from_matrix(rotation).as_quat()[:, [3, 0, 1, 2]][:, order]
    return Rotation.from_quat(w_first[:, [1, 2, 3, 0]]).as_matrix()


def test_orientations_of_poses_on_a_line_are_not_suspected_of_other_axes(ur10):  # noqa: F811
    """Where points lie on a line, positions do not know how the base is turned about it."""
    robot, data = ur10
    part = data.select(np.arange(12))
    rotation = np.random.default_rng(1).permutation(part.rotation)
    position = part.position[0] + np.outer(np.arange(12), [1e-4, 0.0, 0.0])
    found = first_aid(robot, replace(part, position=position, rotation=rotation))
    assert not any("count from axes" in line for line in found)


def test_angles_over_another_turn_are_no_degrees(ur10):  # noqa: F811
    robot, data = ur10
    wrist = replace(robot.joints[5], q_min=-np.pi, q_max=np.pi)
    robot, part = replace(robot, joints=(*robot.joints[:5], wrist)), data.select(np.arange(0, len(data), 20))
    found = first_aid(robot, column(part, "q", shifted(5, 2.0 * np.pi)))
    assert found == (found[0],) and "as 0 to 360 degrees" in found[0], found


def test_a_refusal_names_an_axis_that_never_moves(ur10):  # noqa: F811
    robot, data = ur10
    part = data.select(np.arange(0, len(data), 20))
    with pytest.raises(Mismatch, match=r"not measured \(axis 2 never moves\)"):
        evaluate_poses(robot, column(part, "q", scaled(1, 0.0)))
