"""Dynamic identification: the truth within its intervals, base parameters, honest intervals, the real arm."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain import Layout, motion_record, predict_motion
from exactarm.cli import main
from exactarm.data.dataset import read_dataset, write_dataset
from exactarm.diagnose.problems import problem_for
from exactarm.effects.link_inertia import LinkInertia
from exactarm.files.examples import data_path
from exactarm.identify.base_parameters import base_parameters
from exactarm.identify.dynamics import DynamicsOptions, identify_dynamics
from exactarm.noise.autocorrelation import autocorrelation, uncertainty
from exactarm.numerics.regression import bounded_interval
from exactarm.robot.robot import Link
from exactarm.robot_file import load_robot, write_robot
from exactarm.simulate import Sensors, VirtualRobot, deviated, measure_motion
from exactarm.simulate.profiles import excitation
from motions import fourier_motion, motion_data
from six_axis import six_axis

NOISE_NM = np.array([2.0, 3.0, 1.5, 0.5, 0.3, 0.2])


def true_arm(seed=4):
    """The robot with every mass, rotor and friction away from what is declared."""
    random = np.random.default_rng(seed)
    robot = six_axis()
    off = lambda: 1.0 + random.uniform(-0.3, 0.3)
    links = tuple(
        Link(link.mass * off(), link.centre_of_mass + random.normal(0.0, 0.01, 3), link.inertia * off())
        for link in robot.links
    )
    joints = tuple(
        replace(j, coulomb=j.coulomb * off(), viscous=j.viscous * off(),
                rotor_inertia=j.rotor_inertia * off())
        for j in robot.joints
    )
    return replace(robot, links=links, joints=joints)


def log_of(robot, seconds, seed, rate_hz=250.0, noise=1.0):
    """A motion log of the robot with white noise on its torques, no filter in it; noise: times NOISE_NM, of
    the same draws."""
    time, angle, _, _ = fourier_motion(robot, seconds, rate_hz, seed, base_hz=0.1, amplitude=0.9)
    clean = motion_record(robot, motion_data(robot, time, angle), rate_hz)
    torque = predict_motion(robot, Layout.of(()), clean, tangents=False).torque
    off = np.random.default_rng(100 + seed).normal(0.0, noise * NOISE_NM, torque.shape)
    return motion_data(robot, time, angle, torque + off)


def base_values(robot, base):
    """(b,) base parameters of a robot's tables."""
    pi = np.concatenate([_core.inertial_parameters(robot.core),
                         [joint.rotor_inertia or 0.0 for joint in robot.joints]])
    return pi[base.kept] + base.K @ pi[base.dropped]


def misses(truth, result):
    """(P,) estimate less truth in standard deviations, base parameters as their sums."""
    found, base = dict(zip(result.fit.layout.names, result.fit.intervals)), result.base
    pairs = [(base.names[c], a - b)
             for c, a, b in zip(base.kept, base_values(result.robot, base), base_values(truth, base))]
    for i, (a, b) in enumerate(zip(result.robot.joints, truth.joints), start=1):
        pairs += [(f"coulomb_{i}_Nm", a.coulomb - b.coulomb), (f"viscous_{i}_Nm_s", a.viscous - b.viscous)]
    assert {name for name, _ in pairs} == set(found)
    return np.array([2.0 * error / (found[name][1] - found[name][0]) for name, error in pairs])


def test_base_parameters_make_the_same_torque():
    robot = six_axis()
    base = base_parameters(robot)
    assert len(base.kept) == 40  # 36 of six rotary axes, and the rotors of the four that are no part of them
    assert base.rotors == (2, 3, 4, 5)
    random = np.random.default_rng(2)
    q, q_dot, q_ddot = (random.normal(0.0, 2.0, (9, 6)) for _ in range(3))
    regressor = _core.dynamics_regressor(robot.core, q, q_dot, q_ddot)
    pi = random.normal(0.0, 1.0, 60)
    links = [k for k, c in enumerate(base.kept) if c < 60]
    dropped = [k for k, c in enumerate(base.dropped) if c < 60]
    sums = pi[base.kept[links]] + base.K[np.ix_(links, dropped)] @ pi[base.dropped[dropped]]
    np.testing.assert_allclose(regressor[:, :, base.kept[links]] @ sums, regressor @ pi, rtol=1e-9, atol=1e-9)


def test_groups_read_as_sums():
    base = base_parameters(six_axis())
    first = base.group([base.names[c] for c in base.kept].index("mx_2_kg_m"))
    assert first.startswith("mx_2_kg_m + 0.59 m_2_kg + 0.59 m_3_kg")


@pytest.mark.slow
def test_truth_within_the_intervals():
    """Masses, rotors and friction 30 % off: all come back, and 95 % intervals hold about 95 % of them."""
    truth = true_arm()
    errors = []
    for seed in range(4):
        result = identify_dynamics(six_axis(), log_of(truth, 20.0, seed), DynamicsOptions())
        errors.append(misses(truth, result))
        rms = lambda e: np.sqrt(np.mean(e["validation"] ** 2, axis=0))
        assert np.all(rms(result.after) < 0.6 * NOISE_NM)  # white noise behind the low-pass
        assert np.all(rms(result.before) > 2.0 * rms(result.after))
        np.testing.assert_allclose(result.fit.sigma, rms(result.after), rtol=0.25)
    errors = np.concatenate(errors)
    assert 0.90 <= np.mean(np.abs(errors) <= 1.0) <= 0.995
    assert np.max(np.abs(errors)) < 2.5


@pytest.mark.slow
def test_friction_that_jumps_at_a_reversal():
    """Exact Coulomb friction, no smooth sign: what the reversals show is told from viscous friction and
    masses."""
    truth = true_arm()
    time, angle, rate, acceleration = fourier_motion(truth, 20.0, 250.0, 5, base_hz=0.1, amplitude=0.9)
    of_joints = lambda name: np.array([getattr(joint, name) for joint in truth.joints])
    torque = _core.inverse_dynamics(truth.core, angle + truth.offsets, rate, acceleration)
    torque += of_joints("rotor_inertia") * truth.ratios**2 * acceleration
    torque += of_joints("coulomb") * np.sign(rate) + of_joints("viscous") * rate
    torque += np.random.default_rng(11).normal(0.0, NOISE_NM, rate.shape)
    result = identify_dynamics(six_axis(), motion_data(truth, time, angle, torque), DynamicsOptions())
    errors = misses(truth, result)
    assert np.mean(np.abs(errors) <= 1.0) > 0.85
    assert np.max(np.abs(errors)) < 2.5
    assert np.all(np.sqrt(np.mean(result.after["validation"] ** 2, axis=0)) < 0.6 * NOISE_NM)


@pytest.mark.slow
def test_shipped_arm_with_springs_and_gear_errors():
    """The Racer, its springs swinging under its gear errors: masses and friction 10 % off come back in their
    intervals."""
    nominal, random = load_robot("racer-7-1.4"), np.random.default_rng(3)
    virtual = VirtualRobot.of(nominal, true=deviated(nominal, 1.0, random, geometry=False, frames=False))
    time, q = excitation(nominal, 15.0, 500.0, random)
    data = measure_motion(virtual, time, virtual.motor_angles(q), Sensors(), random, damping_s=1e-3)
    result = identify_dynamics(nominal, data, DynamicsOptions())
    found = misses(virtual.true, result)
    assert np.mean(np.abs(found) <= 1.0) > 0.85  # what is left of the gears' shaking is no white noise
    assert np.max(np.abs(found)) < 3.5
    rms = lambda residual: np.sqrt(np.mean(residual["validation"] ** 2, axis=0))
    assert np.all(rms(result.after) < 0.6 * rms(result.before))


@pytest.mark.slow
def test_robot_without_masses_moves_as_the_true_one():
    """Nothing declared but the geometry: the identified tables make the true torque."""
    truth = true_arm()
    bare = replace(six_axis(), links=None)
    bare = replace(bare,
                   joints=tuple(replace(j, coulomb=None, viscous=None, rotor_inertia=None)
                                for j in bare.joints))
    result = identify_dynamics(bare, log_of(truth, 20.0, 7), DynamicsOptions())
    random = np.random.default_rng(3)
    q, q_dot, q_ddot = (random.normal(0.0, s, (50, 6)) for s in (0.8, 1.0, 2.0))
    rotor = lambda robot: np.array([j.rotor_inertia or 0.0 for j in robot.joints]) * robot.ratios**2 * q_ddot
    a, b = (_core.inverse_dynamics(r.core, q, q_dot, q_ddot) + rotor(r) for r in (result.robot, truth))
    assert np.sqrt(np.mean((a - b) ** 2)) < 0.02 * np.sqrt(np.mean(b**2))


def test_friction_only_keeps_the_masses():
    truth = true_arm()
    result = identify_dynamics(six_axis(), log_of(truth, 8.0, 1), DynamicsOptions(inertial=False))
    assert {name.split("_")[0] for name in result.fit.layout.names} == {"coulomb", "viscous"}
    assert result.robot.links[3].mass == six_axis().links[3].mass


@pytest.mark.parametrize(("declared", "words"), [
    ((), "no torque constant of axes 1, 2, 3, 4, 5 and 6 is declared"),
    (range(5), "no torque constant of axis 6 is declared"), (range(6), None),
])
@pytest.mark.slow
def test_currents_are_said_to_lack_a_constant_where_they_do(declared, words):
    """It was said of every log of currents, whatever the robot file declares."""
    truth = true_arm()
    data = log_of(truth, 8.0, 1)
    current = {"current": data.joints["tau"] / truth.ratios / 0.3}
    robot = six_axis()
    for axis in declared:
        robot = robot.with_joint(axis, torque_constant=0.3)
    joints = {name: values for name, values in data.joints.items() if name != "tau"} | current
    data = replace(data, joints=joints)
    told = identify_dynamics(robot, data, DynamicsOptions(inertial=False)).warnings
    about = [line for line in told if "torque constant" in line]
    assert (about == []) if words is None else (len(about) == 1 and words in about[0])
    problem = problem_for(robot, data, data.select(np.zeros(len(data), bool)), 1, 0)
    assert list(problem.doubts(None)) == about  # a diagnosis said nothing


@pytest.mark.slow
def test_axis_that_stands_still_has_no_friction_to_tell():
    robot = six_axis()
    data = log_of(robot, 8.0, 2)
    theta = data.joints["theta"].copy()
    theta[:, 5] = 3.0
    result = identify_dynamics(robot, replace(data, joints=data.joints | {"theta": theta}), DynamicsOptions())
    assert "coulomb_6_Nm" not in result.fit.layout.names and "coulomb_5_Nm" in result.fit.layout.names


def test_intervals_count_correlated_samples():
    """A mean of moving averages over k samples is worth 1 / k of its samples."""
    random = np.random.default_rng(5)
    wide, spans = [], []
    for _ in range(60):
        white = random.normal(0.0, 1.0, 4000 + 24)
        moving = np.convolve(white, np.ones(25) / 25.0, "valid")
        jacobian = np.ones((4000, 1, 1))
        mean = moving.mean()
        found = uncertainty(jacobian, (moving - mean)[:, None], moving.std(keepdims=True), [np.arange(4000)],
                            0.01)
        low, high = bounded_interval(np.array([mean]), np.sqrt(np.diag(found.covariance)),
                                     np.array([[-np.inf], [np.inf]]), found.freedom)[0]
        spans.append(low <= 0.0 <= high)
        wide.append(found.effective[0])
    assert 4000 / 40 < np.mean(wide) < 4000 / 18
    assert np.mean(spans) > 0.85
    np.testing.assert_allclose(autocorrelation(moving - mean, [np.arange(4000)], 2)[1], 24 / 25, atol=0.02)


@pytest.mark.slow
def test_real_arm():
    """Staubli TX40, first 60 % fitted: what a plain study with the right friction reaches on the last 40
    %."""
    robot = load_robot("tx40")
    data = read_dataset([data_path("tx40/motion.parquet")], robot)
    result = identify_dynamics(robot, data, DynamicsOptions(share=0.6))
    rms = np.sqrt(np.mean(result.after["validation"] ** 2, axis=0))
    assert np.all(rms < [2.26, 4.4, 1.2, 1.0, 1.16, 1.06])


@pytest.mark.slow
def test_command(tmp_path):
    truth = true_arm()
    robot = six_axis()
    write_robot(tmp_path / "arm.toml", robot)
    write_dataset(tmp_path / "log.parquet", log_of(truth, 10.0, 3), robot)
    out = tmp_path / "out"
    assert main(["identify", str(tmp_path / "arm.toml"), str(tmp_path / "log.parquet"), "--out", str(out),
                 "--quiet"]) == 0
    result = json.loads((out / "result.json").read_text())
    after = result["after"]["validation"]
    assert after["rms"] < 0.5 * result["before"]["validation"]["rms"]
    assert [axis["joint"] for axis in after["axes"]] == [1, 2, 3, 4, 5, 6]
    low, high = result["parameters"]["coulomb_2_Nm"]["ci95"]
    assert low < truth.joints[1].coulomb < high
    assert load_robot(out / "robot.toml").joints[1].coulomb == pytest.approx(
        result["parameters"]["coulomb_2_Nm"]["value"]
    )
    base, links = base_parameters(truth), LinkInertia.of(truth, range(60)).values
    held = []
    for k, column in enumerate(base.kept):
        told = result["base_values"].get(base.names[column])
        if told is not None:
            low, high = told["ci95"]
            held.append(low < links[column] + base.borne(k, truth) < high)
            assert result["base_parameters"][base.names[column]] != base.names[column]
    assert len(held) > 10 and np.mean(held) > 0.8
    again = tmp_path / "again"
    words = ["identify", str(out / "robot.toml"), str(tmp_path / "log.parquet"), "--out", str(again),
             "--quiet"]
    assert main(words) == 0
    before = json.loads((again / "result.json").read_text())["before"]["validation"]["rms"]
    assert before == pytest.approx(after["rms"], rel=1e-6)


@pytest.mark.parametrize("option", [["--bandwidth", "-3"], ["--share", "1.5"]])
def test_command_refuses(tmp_path, option, capsys):
    log = str(data_path("tx40/motion.parquet"))
    assert main(["identify", "tx40", log, "--out", str(tmp_path / "out"), *option]) == 2
    assert option[0] in capsys.readouterr().err
