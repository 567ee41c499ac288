"""Tables of d, a, alpha alone, as data sheets have them: axes that should be parallel lean all the same."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects.geometry import Geometry
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.robot.robot import Joint, Robot
from exactarm.robot.writer import write_robot
from exactarm.robot_file import load_robot
from set_ups import at_random_place, joints_in_limits, measured

LEAN_RAD, NOISE_M, ROWS = 8e-4, 2e-5, 100
RIGHT = np.pi / 2
OPTIONS = CalibrationOptions(orientation=False, compliance=())


def sheet() -> Robot:
    """Axes 2, 3 and 4 parallel, with a d between them; no frame has a beta."""
    rows = [(0.15, 0.0, RIGHT), (0.03, 0.3, 0.0), (-0.02, 0.25, np.pi), (0.1, 0.0, RIGHT), (0.1, 0.0, -RIGHT),
            (0.08, 0.0, 0.0)]
    return Robot("of a data sheet", tuple(Joint(d=d, a=a, alpha=alpha, q_min=-2.6, q_max=2.6)
                                          for d, a, alpha in rows))


@pytest.fixture(scope="module")
def leaning():
    """Robot file and what an arm shows whose axes 3 and 4 lean against the one before."""
    rng, robot = np.random.default_rng(8), sheet()
    built = robot.with_joint(1, beta=LEAN_RAD).with_joint(2, beta=-LEAN_RAD, alpha=np.pi + LEAN_RAD)
    place, q = at_random_place(built, rng), joints_in_limits(robot, ROWS, rng)
    return robot, measured(robot, [place], [q], NOISE_M, rng)


def test_a_frame_between_parallel_axes_has_a_beta_and_no_other():
    names = [Geometry.of(sheet(), index).names for index in range(6)]
    assert ["beta_rad" in each for each in names] == [False, True, True, False, False, False]
    assert all("d_m" in each for each in names)


def test_a_d_on_record_stays_beside_beta():
    robot = sheet().with_joint(1, beta=0.0)
    assert "d_m" not in Geometry.of(robot, 1).names
    known = replace(robot, intervals={"d_2_m": (0.029, 0.031)})
    assert {"d_m", "beta_rad"} <= set(Geometry.of(known, 1).names)


def test_the_lean_is_estimated(leaning):
    result = calibrate(*leaning, OPTIONS)
    built = {"beta_2_rad": LEAN_RAD, "beta_3_rad": -LEAN_RAD, "alpha_3_rad": np.pi + LEAN_RAD}
    for name, true in built.items():
        low, high = result.intervals[result.names.index(name)]
        assert low < true < high and high - low < LEAN_RAD
    assert result.after["validation"].rms < 1.5 * np.sqrt(3.0) * NOISE_M


@pytest.mark.slow
def test_a_lean_is_no_cause_that_the_model_lacks(leaning):
    result = diagnose(*leaning)
    assert result.verdict == "no_undeclared_effect" and not result.findings


def test_the_calibrated_file_with_d_beside_beta_reads_as_it_was_written(leaning, tmp_path):
    robot = calibrate(*leaning, OPTIONS).robot
    assert robot.joints[1].beta and robot.joints[1].d
    write_robot(tmp_path / "robot.toml", robot)
    again = load_robot(tmp_path / "robot.toml")
    assert again.joints == robot.joints
    q = joints_in_limits(robot, 5, np.random.default_rng(3))
    np.testing.assert_array_equal([again.fk(each).position for each in q],
                                  [robot.fk(each).position for each in q])


@pytest.mark.parametrize("axis", [3, 4])
def test_a_second_calibration_finds_a_zero_that_has_moved(leaning, axis):
    """In the calibrated file the axes are no longer parallel to the last digit: d of both and the zero of the
    second collide, the noise hides d, and the zero was given up with it."""
    first = calibrate(*leaning, OPTIONS).robot
    theta = leaning[1].joints["theta"].copy()
    theta[:, axis - 1] -= 2e-3
    again = calibrate(first, replace(leaning[1], joints={"theta": theta}), OPTIONS)
    assert f"q_offset_{axis}_rad" in again.names
    assert again.after["validation"].rms < 1.5 * np.sqrt(3.0) * NOISE_M


def gantry() -> Robot:
    """Three sliding axes, square by the drawing, and a wrist."""
    slides = [Joint(type="prismatic", zero=zero, alpha=alpha, q_min=0.0, q_max=travel)
              for zero, alpha, travel in ((-RIGHT, -RIGHT, 3.0), (-RIGHT, -RIGHT, 2.0), (0.0, 0.0, 1.0))]
    wrist = [Joint(d=d, alpha=alpha, q_min=-1.8, q_max=1.8)
             for d, alpha in ((0.2, RIGHT), (0.0, -RIGHT), (0.15, 0.0))]
    return Robot("gantry", (*slides, *wrist))


def test_guides_that_are_not_square_are_geometry():
    """What turns axis 3 about axis 2 is no zero of a sliding axis. Seed 4 was the first tried; of 0 to 11
    one, 10, is among the 5 % whose interval misses."""
    rng, robot = np.random.default_rng(4), gantry()
    assert ["beta_rad" in Geometry.of(robot, index).names for index in range(3)] == [False, True, True]
    built = robot.with_joint(1, zero=robot.joints[1].zero + LEAN_RAD)
    data = measured(robot, [at_random_place(built, rng)], [joints_in_limits(robot, ROWS, rng)], NOISE_M, rng)
    result = calibrate(robot, data, OPTIONS)
    low, high = result.intervals[result.names.index("beta_2_rad")]
    assert low < -LEAN_RAD < high
    assert result.after["validation"].rms < 1.2 * np.sqrt(3.0) * NOISE_M
