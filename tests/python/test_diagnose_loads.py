"""Sag of arms without masses is found as compliance; payloads and measured torques give its true size."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from three_arms import puma

SAG = "joint_compliance joint=2 linear_rad_per_Nm=5e-6 cubic_rad_per_Nm3=0"
TRUE = 5e-6
NOISE_M = 3e-5
POSES = 80


def bare(robot):
    return replace(robot, links=None)


def measured(robot, *effects, **options):
    options = {"count": POSES, "deviation": 1, "seed": 3, "noise": NOISE_M} | options
    return ea.simulate(robot, effects=effects, **options).data


def found(result):
    return [(effect["effect"], effect["joint"]) for effect in result["effects"]]


def covers(result, value):
    low, high = result["effects"][0]["parameters"]["linear_rad_per_Nm"]["ci95"]
    return low <= value <= high


def with_payloads(robot, masses, folder):
    """Poses in as many sessions as masses, each with its payload 80 mm off the flange."""
    low, high = ([getattr(joint, name) for joint in robot.joints] for name in ("q_min", "q_max"))
    q = np.random.default_rng(5).uniform(low, high, (POSES, robot.axes))
    session = np.arange(POSES) % len(masses)
    columns = {"session": session + 1, "payload_kg": np.array(masses)[session]}
    columns["payload_z_m"] = np.full(POSES, 0.08)
    columns |= {f"q_{i + 1}_rad": q[:, i] for i in range(robot.axes)}
    path = folder / "poses.csv"
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values()))]
    path.write_text("\n".join(lines) + "\n")
    return ea.simulate(robot, path, measure="poses", effects=[SAG], deviation=1, seed=3, noise=NOISE_M).data


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur10", "puma"])
def test_sag_without_masses_is_compliance_of_the_axis_and_nothing_else(name):
    robot = puma() if name == "puma" else ea.load_robot(name)
    result = ea.diagnose(bare(robot), measured(robot, SAG), seed=3, threads=1)
    assert found(result) == [("joint_compliance", 2)] and result["verdict"] == "explained"
    assert result["load"]["source"] == ["generic"] * robot.axes
    assert any("generic distribution" in line for line in result["warnings"])
    assert "generic" in result["effects"][0]["evidence"]
    assert result.robot.generic_masses


@pytest.mark.slow
def test_clean_data_of_an_arm_without_masses_give_no_effect_and_no_masses():
    robot = ea.load_robot("ur10")
    result = ea.diagnose(bare(robot), measured(robot), seed=3, threads=1)
    assert result["verdict"] == "no_undeclared_effect" and found(result) == []
    assert result.robot.links is None


@pytest.mark.slow
def test_run_out_of_a_gear_is_still_run_out():
    robot = ea.load_robot("ur10")
    run_out = "gear_eccentricity joint=2 first_cos_rad=2e-4 first_sin_rad=1e-4 "
    run_out += "second_cos_rad=0 second_sin_rad=0"
    result = ea.diagnose(bare(robot), measured(robot, run_out), seed=3, threads=1)
    assert found(result) == [("gear_eccentricity", 2)]


@pytest.mark.slow
def test_measured_torques_give_the_true_stiffness_to_an_arm_without_masses():
    robot = ea.load_robot("ur10")
    data = measured(robot, SAG, torques=0.5)
    result = ea.diagnose(bare(robot), data, seed=3, threads=1)
    assert found(result) == [("joint_compliance", 2)] and covers(result, TRUE)
    assert result["load"]["source"] == ["measured"] * 6
    unmeasured = replace(data, joints={name: values for name, values in data.joints.items() if name != "tau"})
    with_torque, without = (ea.evaluate(result.robot, rows)["error"]["mean"] for rows in (data, unmeasured))
    assert without < 1.5 * with_torque


@pytest.mark.slow
@pytest.mark.parametrize("masses", [True, False], ids=["declared", "generic"])
def test_three_payloads_in_three_sessions_give_one_stiffness(tmp_path, masses):
    robot = ea.load_robot("ur10")
    data = with_payloads(robot, (0.0, 5.0, 10.0), tmp_path)
    result = ea.diagnose(robot if masses else bare(robot), data, seed=3, threads=1)
    assert found(result) == [("joint_compliance", 2)] and covers(result, TRUE)
    calibrated = ea.calibrate(robot if masses else bare(robot), data, compliance=(2,), threads=1)
    low, high = calibrated["parameters"]["joint_compliance_2.linear_rad_per_Nm"]["ci95"]
    assert low <= TRUE <= high
    again = ea.evaluate(calibrated.robot, data)
    assert again["error"]["mean"] < 3.0 * NOISE_M and again["load"]["payload"]


@pytest.mark.slow
def test_play_without_masses_is_backlash_though_the_generic_load_changes_its_sign_elsewhere():
    """Masses that no link length tells of move the angle at which the flank changes."""
    robot = puma()
    link = robot.links[2]
    moved = replace(link, centre_of_mass=tuple(np.add(link.centre_of_mass, (0.0, 0.0, 0.25))))
    real = replace(robot, links=(*robot.links[:2], moved, *robot.links[3:]))
    data = measured(real, "backlash joint=3 width_rad=6e-4 friction_Nm=1.0", count=120)
    result = ea.diagnose(bare(robot), data, seed=3, threads=1)
    assert found(result)[0] == ("backlash", 3)
    assert result["effects"][0]["parameters"]["width_rad"]["value"] == pytest.approx(6e-4, rel=0.4)
    assert result["after"]["validation"]["rms"] < 0.8 * result["before"]["validation"]["rms"]


@pytest.mark.slow
def test_gravity_that_points_up_is_asked_after():
    """Springs that would have to give way against their load are no cause: what is left follows the load."""
    robot = replace(puma(), gravity=-np.asarray(puma().gravity))
    springs = [f"joint_compliance joint={axis} linear_rad_per_Nm={size}"
               for axis, size in ((2, 1.5e-5), (3, 3e-5))]
    data = measured(puma(), *springs)
    asked = lambda result: any("gravity_m_s2" in line for line in result["warnings"])
    assert asked(ea.diagnose(robot, data, threads=1)) and not asked(ea.diagnose(puma(), data, threads=1))
