"""The conditions of bench/blind do to the data what they say, and leave today's cases as they were."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "bench"))

from blind import gear_scenario, motion_scenario, pose_scenario, tracked_scenario  # noqa: E402
from blind.arm import output_angle, posture, read_arm, spring_deflection  # noqa: E402
from blind.conditions import OF_KIND, Conditions, draw_conditions  # noqa: E402
from blind.motion import excitation, play  # noqa: E402
from blind.noise import component_noise, draw_noise  # noqa: E402
from blind.passage import passed  # noqa: E402
from blind.pose_sets import in_a_cube  # noqa: E402
from exactarm.data.dataset import read_dataset  # noqa: E402
from exactarm.robot_file import load_robot  # noqa: E402

ROBOTS = TOP / "python" / "exactarm" / "data" / "robots"
SCENARIOS = {
    "poses": pose_scenario,
    "gear_run": gear_scenario,
    "motion": motion_scenario,
    "tracked_motion": tracked_scenario,
}
EACH = [(kind, name) for kind, names in OF_KIND.items() for name in names]


@pytest.mark.parametrize("kind", OF_KIND)
def test_today_is_without_conditions_and_draws_plain_noise(kind):
    assert draw_conditions("today", kind, 7) == Conditions()
    one, two = (np.random.default_rng(3) for _ in range(2))
    np.testing.assert_array_equal(draw_noise(Conditions(), (20, 3), one), two.normal(size=(20, 3)))
    np.testing.assert_array_equal(component_noise(Conditions(), 3, one), np.ones(3))
    assert one.random() == two.random()  # not one number more was drawn


def test_wide_draws_every_condition_of_its_kind_and_no_other():
    for kind, names in OF_KIND.items():
        seen = {name for seed in range(60) for name in draw_conditions("wide", kind, seed).truth()}
        assert seen == set(names)


@pytest.mark.slow
@pytest.mark.parametrize("kind", OF_KIND)
def test_wide_cases_are_repeatable(tmp_path, kind):
    one, two = (SCENARIOS[kind].draw_case(tmp_path / name, 23, ROBOTS, "clean", "wide") for name in "ab")
    assert one.truth == two.truth
    assert one.data.read_bytes() == two.data.read_bytes()
    assert one.robot.read_bytes() == two.robot.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("kind, name", EACH)
def test_cases_under_a_condition_can_be_read(tmp_path, kind, name):
    case = SCENARIOS[kind].draw_case(tmp_path, 24, ROBOTS, "clean", name)
    assert set(case.truth["conditions"]) == {name}
    assert read_dataset([str(case.data)], load_robot(str(case.robot))).kind == kind


def test_condition_of_another_kind_is_refused():
    with pytest.raises(ValueError, match="poses has no condition 'cut'"):
        draw_conditions("cut", "poses", 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "conditions", [Conditions(freedom=5.0), Conditions(memory=4.0), Conditions(freedom=6.0, memory=3.0)]
)
def test_noise_has_unit_variance(conditions):
    noise = draw_noise(conditions, (200_000, 3), np.random.default_rng(1))
    np.testing.assert_allclose(noise.std(axis=0), 1.0, rtol=0.03)


def test_student_noise_has_the_tails_of_its_degrees_of_freedom():
    noise = draw_noise(Conditions(freedom=10.0), (400_000, 1), np.random.default_rng(2))
    assert np.mean(noise**4) == pytest.approx(3.0 + 6.0 / (10.0 - 4.0), rel=0.05)


@pytest.mark.slow
def test_coloured_noise_forgets_within_its_memory():
    noise = draw_noise(Conditions(memory=4.0), (200_000, 1), np.random.default_rng(3))[:, 0]
    for lag in (1, 4, 8):
        assert np.mean(noise[lag:] * noise[:-lag]) == pytest.approx(0.5 * np.exp(-lag / 4.0), abs=0.01)


def test_unequal_components_keep_the_mean_noise():
    share = component_noise(Conditions(spread=5.0), 3, np.random.default_rng(4))
    assert np.mean(share**2) == pytest.approx(1.0) and share.max() / share.min() == pytest.approx(5.0)


def test_passage_leaves_at_the_reversal_and_arrives_after_its_time():
    sign = np.repeat([0.0, 1.0, 0.0, -1.0], (10, 40, 10, 60))[:, None]
    out = passed(sign, np.ones(len(sign)), 1e-3, 0.02)[:, 0]
    np.testing.assert_array_equal(out[:60], 1.0)  # until the axis turns back, and in the rest before it
    assert np.all(np.diff(out[59:81]) <= 0.0) and abs(out[69] - 0.0) < 0.2
    np.testing.assert_allclose(out[79:], -1.0, atol=1e-12)


def gyroscope_runs(**conditions):
    arm = read_arm(ROBOTS / "racer-7-1.4.toml")
    return arm, gear_scenario._gyroscope_runs(arm, np.random.default_rng(8), Conditions(**conditions))


@pytest.mark.parametrize("cut", [(True, False), (False, True), (True, True)])
def test_runs_are_cut_in_motion(cut):
    arm, runs = gyroscope_runs(cut=cut)
    for number in np.unique(runs.run):
        own = (runs.run == number) & runs.logged
        rate = np.abs(np.diff(runs.theta[own, runs.moved[own][0]]))
        assert tuple(rate[[0, -1]] > 0.99 * np.median(rate)) == cut


def test_gear_runs_with_a_passage_turn_back_within_a_run():
    arm, runs = gyroscope_runs(passage_s=0.1, cut=(True, True))
    own = (runs.run == 1) & runs.logged
    axis = runs.moved[own][0]
    step = np.diff(runs.theta[own, axis])
    assert step.max() > 0.0 > step.min()
    between = np.abs(runs.direction[own, axis]) < 1.0
    assert np.count_nonzero(between) * runs.step == pytest.approx(
        0.1, abs=3.0 * runs.step
    )  # both ends belong to a table


def test_motion_with_gear_tables_is_turned_back_by_the_gears():
    arm = read_arm(ROBOTS / "racer-7-1.4.toml")
    random = np.random.default_rng(6)
    middle = 0.5 * (arm.lower + arm.upper)
    drive = excitation(arm, middle, 4.0, 2e-3, 1, random)
    direction = passed(np.sign(drive.rate) * np.sign(arm.motor_per_output), drive.run, 2e-3, 0.05)
    drive = type(drive)(
        *(getattr(drive, name) for name in ("time", "run", "q", "rate", "acceleration", "temperature")),
        direction,
    )
    still = arm.with_values(rotor=np.zeros(arm.axes), coulomb=np.zeros(arm.axes), viscous=np.zeros(arm.axes))
    played = play(still, drive, ())
    delivered = drive.q - arm.offset + spring_deflection(arm, played.link)
    np.testing.assert_allclose(output_angle(arm, played.theta, direction), delivered, atol=1e-12)
    # Virtual work, where one table holds: motor torque d theta = link torque d phi.
    axis, step = 1, 1e-6
    one = np.abs(direction[:, axis]) == 1.0
    moved = played.theta.copy()
    moved[:, axis] += step * arm.ratio[axis]
    turn = (output_angle(arm, moved, direction) - output_angle(arm, played.theta, direction))[:, axis] / step
    np.testing.assert_allclose(
        played.tau[one, axis], (played.link[:, axis] * turn)[one], rtol=1e-6, atol=1e-6
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["poses", "motion", "tracked_motion"])
def test_some_axes_stand_still(tmp_path, kind):
    case = SCENARIOS[kind].draw_case(tmp_path, 31, ROBOTS, "clean", "still")
    data = pd.read_csv(case.data)
    moved = [
        np.ptp(data[name]) > 1e-6 for name in data if name.startswith(("theta_", "q_")) and name[-1] in "dg"
    ]
    assert 0 < np.count_nonzero(moved) < len(moved)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["poses", "motion"])
def test_arm_without_masses_in_its_file_weighs_all_the_same(tmp_path, kind):
    case = SCENARIOS[kind].draw_case(
        tmp_path, 33, ROBOTS, {"poses": "joint_compliance", "motion": "gravity_compensator"}[kind], "massless"
    )
    arm = read_arm(case.robot)
    assert arm.mass is None and not np.any(arm.linear)
    assert case.truth["raised"] > 1.02  # what the load does shows


def test_poses_in_a_cube_stay_there():
    arm = read_arm(ROBOTS / "ur10.toml")
    flange = posture(arm, in_a_cube(arm, 200, np.random.default_rng(5)) + arm.offset).flange
    assert len(flange) == 200 and np.all(np.ptp(flange, axis=0) < 0.7)


def test_few_poses_are_sixty_and_geometry_is_off_by_millimetres(tmp_path):
    few = pose_scenario.draw_case(tmp_path / "few", 35, ROBOTS, "clean", "few")
    assert few.truth["rows"] == len(pd.read_csv(few.data)) == 60
    arm = read_arm(ROBOTS / "ur10.toml")
    true = pose_scenario.draw_set_up(
        arm, np.random.default_rng(1), 1, draw_conditions("geometry", "poses", 1)
    ).arm
    assert 2e-3 < np.std(true.a - arm.a) < 1e-2
