"""The virtual robot: its plant against another engine, its data against the program to explain them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain import (
    Layout,
    motion_record,
    predict_gear_run,
    predict_motion,
    predict_poses,
    predict_tracked_motion,
)
from exactarm.cli import main
from exactarm.data.dataset import Dataset, read_dataset
from exactarm.effects import library
from exactarm.errors import InputError
from exactarm.identify.calibrate import calibrate
from exactarm.identify.dynamics import DynamicsOptions, identify_dynamics
from exactarm.robot.robot import GearTable
from exactarm.robot_file import load_robot, write_robot
from exactarm.simulate import (
    Sensors,
    VirtualRobot,
    deviated,
    measure_gear_runs,
    measure_motion,
    measure_poses,
    measure_tracked_motion,
    parse_effect,
)
from exactarm.simulate.independent import gear_outputs, independent_path
from exactarm.simulate.measure import true_path
from exactarm.simulate.plant import swing
from exactarm.simulate.profiles import excitation, gear_run, limit
from six_axis import six_axis

EXACT = Sensors(position_m=0.0, orientation_rad=0.0, gyro_rad_s=0.0, torque_Nm=0.0, counts=0)


def geared(robot):
    """The robot with gears whose tables do not depend on the direction."""
    table = GearTable(np.array([2.0, 40.0]), np.array([1e-3, 1e-3]), np.array([2e-3, -1e-3]))
    return replace(robot, joints=tuple(replace(joint, cw=table, ccw=table) for joint in robot.joints))


def rest_to_rest(robot, seconds=1.0, rate_hz=1000.0, seed=2):
    return excitation(robot, seconds, rate_hz, np.random.default_rng(seed))


@pytest.mark.slow
@pytest.mark.parametrize("gears", [False, True])
def test_plant_agrees_with_an_independent_engine(gears):
    """Springs swinging under the same motor motion: other kinematics, dynamics, gear inverse and
    integrator."""
    robot = six_axis(springs=True)
    virtual = VirtualRobot.of(geared(robot) if gears else robot)
    time, q = rest_to_rest(robot)
    theta = virtual.motor_angles(q)
    data = Dataset.of_arrays("tracked_motion", {"theta": theta}, time=time)
    ours, other = true_path(virtual, data), independent_path(virtual, time, theta)
    still = true_path(virtual, data, quasi_static=True)
    assert np.max(np.abs(ours - other)) < (1e-6 if gears else 1e-7)
    assert np.max(np.abs(still - other)) > 20.0 * np.max(np.abs(ours - other))  # it swings, and both know how


def test_plant_keeps_the_energy_of_a_free_swing():
    """Motors held still, links let go: kinetic, gravity and spring energy stay together what they were."""
    robot = six_axis(springs=True)
    held = np.tile(np.array([0.2, 0.4, 1.0, 0.1, 0.3, 0.0]), (400, 1))
    time = 1e-4 * np.arange(400)
    kick = held.copy()
    kick[:, 1] += 2e-3 * np.exp(-((time - 0.005) / 0.001) ** 2)
    links = swing(robot, time, kick)
    linear = np.array([joint.spring_linear for joint in robot.joints])
    kinetic = 0.5 * np.einsum("ni,nij,nj->n", links.q_dot, _core.mass_matrix(robot.core, links.q),
                              links.q_dot)
    gravity = _core.gravity_torque(robot.core, links.q)
    middle = 0.5 * (gravity[1:] + gravity[:-1])
    height = np.concatenate([[0.0], np.cumsum(np.sum(middle * np.diff(links.q, axis=0), axis=1))])
    energy = kinetic + height + 0.5 * np.sum(linear * (kick - links.q) ** 2, axis=1)
    after = energy[time > 0.012]
    assert np.ptp(after) < 1e-3 * np.max(kinetic[time > 0.012])


def test_damping_calms_the_links():
    robot = six_axis(springs=True)
    time = 1e-3 * np.arange(600)
    output = np.tile(robot.offsets, (600, 1))
    output[:, 0] += 0.05 * np.clip((time - 0.02) / 0.03, 0.0, 1.0)
    late = time > 0.3
    swings = [np.ptp(swing(robot, time, output, damping).q[late, 0]) for damping in (0.0, 5e-3)]
    assert swings[1] < 0.5 * swings[0]


def test_creeping_plant_is_a_series_of_static_poses():
    robot = six_axis(springs=True)
    virtual = VirtualRobot.of(robot)
    time = np.arange(200) / 50.0
    s = np.clip((time - 0.5) / 3.0, 0.0, 1.0)
    q = np.array([0.1, 0.2, 0.3, 0.1, 0.4,
                  0.2]) + 0.01 * (s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3))[:, None]
    data = Dataset.of_arrays("tracked_motion", {"theta": virtual.motor_angles(q)}, time=time,
                             position=np.zeros((200, 3)))
    static = predict_poses(robot, Layout.of(()), data, tangents=False).position
    assert np.max(np.abs(true_path(virtual, data) - static)) < 2e-6


def test_calibration_recovers_a_deviated_robot():
    random = np.random.default_rng(4)
    nominal = six_axis(placed=False)
    virtual = VirtualRobot.of(nominal, true=deviated(nominal, 1.0, random))
    q = random.uniform(limit(nominal, "q_min"), limit(nominal, "q_max"), (80, 6))
    data = measure_poses(virtual, q, Sensors(position_m=1e-4), random)
    result = calibrate(nominal, data)
    assert result.before["validation"].rms > 1e-3
    assert result.after["validation"].rms < 1.6 * np.sqrt(3.0) * 1e-4


@pytest.mark.slow
def test_identification_recovers_masses_and_friction():
    """Swinging springs and all: the friction and masses that moved the virtual robot come back."""
    random = np.random.default_rng(6)
    nominal = six_axis()
    virtual = VirtualRobot.of(nominal, true=deviated(nominal, 2.0, random, geometry=False, frames=False))
    time, q = excitation(nominal, 20.0, 200.0, random)
    data = measure_motion(virtual, time, virtual.motor_angles(q), Sensors(), random)
    result = identify_dynamics(nominal, data, DynamicsOptions())
    rms = lambda part: np.sqrt(np.mean(part["validation"] ** 2))
    assert rms(result.after) < 0.2 * rms(result.before)
    found = dict(zip(result.fit.layout.names, result.fit.intervals))
    for i, joint in enumerate(virtual.true.joints, start=1):
        low, high = found[f"coulomb_{i}_Nm"]
        assert low - 0.5 * (high - low) < joint.coulomb < high + 0.5 * (high - low)


def test_gear_runs_may_begin_and_end_in_motion():
    """Cut at constant speed, at both ends: the same samples as of the whole run, none of a ramp."""
    robot = geared(six_axis(springs=True))
    virtual = VirtualRobot.of(robot)
    whole, cut = (
        measure_gear_runs(virtual, [1], [0.5], 1, EXACT, np.random.default_rng(9), in_motion=in_motion)
        for in_motion in (False, True)
    )
    for run in (1, 2):
        mine, all_rows = (data.select(data.run == run) for data in (cut, whole))
        steps = np.abs(np.diff(mine.joints["theta"][:, 1])) / np.abs(robot.ratios[1])
        assert np.all(np.abs(steps / 0.5e-3 - 1.0) < 1e-6)
        first = np.searchsorted(all_rows.time, mine.time[0])
        assert 0.1 < mine.time[0] and mine.time[-1] < all_rows.time[-1] - 0.1
        np.testing.assert_array_equal(mine.gyro, all_rows.gyro[first : first + len(mine)])


def test_true_model_leaves_nothing_but_noise():
    """What is simulated is what the chain predicts: poses, gear runs, motions and tracks, effects and all."""
    robot, random = geared(six_axis(springs=True)), np.random.default_rng(9)
    effects = [parse_effect(text, 6) for text in ("gear_ratio joint=2 scale=1e-3", "joint_compliance joint=3 "
                                                                                   "linear_rad_per_Nm=4e-6")]
    virtual = VirtualRobot.of(robot, effects)
    q = random.uniform(-1.0, 1.0, (20, 6))
    poses = measure_poses(virtual, q, EXACT, random)
    assert np.max(
        np.abs(predict_poses(virtual.true, virtual.layout, poses, tangents=False).residual())
    ) < 1e-12
    runs = measure_gear_runs(virtual, [1], [0.5], 1, EXACT, random)
    gear = predict_gear_run(virtual.true, virtual.layout, runs, tangents=False)
    assert np.max(np.abs(gear.residual()[gear.keep])) < 1e-9
    time, angles = rest_to_rest(robot, 1.5, 500.0)
    theta = virtual.motor_angles(angles)
    motion = measure_motion(virtual, time, theta, EXACT, random, quasi_static=True)
    record = motion_record(virtual.true, motion)
    left = predict_motion(virtual.true, virtual.layout, record, tangents=False).residual()[record.keep]
    assert np.sqrt(np.mean(left**2)) < 0.02 * np.sqrt(np.mean(motion.joints["tau"] ** 2))
    track = measure_tracked_motion(virtual, time, theta, EXACT, random, quasi_static=True)
    path = predict_tracked_motion(virtual.true, virtual.layout, track, tangents=False)
    assert np.max(np.abs(path.residual())) < 1e-12


HIDDEN = {
    "poses": [
        "backlash joint=2 width_rad=4e-4", "hysteresis joint=2 size_rad=3e-4",
        "gear_ratio joint=1 scale=1e-3",
        "joint_compliance joint=2 linear_rad_per_Nm=5e-6", "link_compliance joint=2 rad_per_Nm=2e-6",
        "base_compliance rad_per_Nm=1e-6",
        "payload mass_kg=4 moment_x_kg_m=0 moment_y_kg_m=0 moment_z_kg_m=0.4",
        "thermal_drift form=growth driver=temperature_degC growth_1_per_degC=1e-5",
        "tracker_scale x_scale=0 y_scale=0 z_scale=1e-4",
        "tracker_drift driver=time x_m_per_h=1e-3 y_m_per_h=0 z_m_per_h=0",
        "joint_coupling joint=6 motor=5 coupling_rad_per_rad=0.02",
    ],
    "motion": [
        "coulomb_friction joint=2 torque_Nm=10", "viscous_friction joint=2 coefficient_Nm_s=8",
        "stribeck_friction joint=1 breakaway_Nm=15 velocity_rad_s=0.2",
        "asymmetric_friction joint=3 coulomb_Nm=3 viscous_Nm_s=0",
        "load_friction joint=2 coefficient=0.1", "torque_ripple joint=1 order=2 cosine_Nm=3 sine_Nm=0",
        "torque_constant joint=2 scale=0.1", "rotor_inertia joint=4 inertia_kg_m2=1e-4",
        "gravity_compensator joint=2 stiffness_Nm_per_rad=100 preload_Nm=20 cosine_Nm=0 sine_Nm=0",
        "motor_link_coupling share=1", "thermal_drift form=lubricant driver=temperature_degC "
                                       "fall_1_per_degC=0.02",
        "time_delay delay_s=5e-3", "joint_coupling joint=6 motor=5 coupling_rad_per_rad=0.5",
        "payload mass_kg=4 moment_x_kg_m=0 moment_y_kg_m=0 moment_z_kg_m=0.4",
    ],
    "gear": ["gyro_scale scale=1e-3", "time_delay delay_s=5e-3", "gear_ratio joint=2 scale=1e-3"],
}


@pytest.mark.parametrize("measure, text",
                         [(measure, text) for measure, texts in HIDDEN.items() for text in texts])
def test_hidden_effect_is_in_the_data(measure, text):
    robot = six_axis(springs=measure == "poses")
    sensors = replace(EXACT, temperature_degC=(20.0, 45.0))
    time, q = rest_to_rest(robot, 1.0, 200.0)

    def take(virtual):
        random = np.random.default_rng(3)
        if measure == "poses":
            return measure_poses(virtual, q[::10], sensors, random).position
        if measure == "gear":
            return measure_gear_runs(virtual, [1], [1.0], 1, sensors, random, 200.0).gyro
        return measure_motion(virtual, time, virtual.motor_angles(q), sensors, random).joints["tau"]

    plain, hidden = take(VirtualRobot.of(robot)), take(VirtualRobot.of(robot, [parse_effect(text, 6)]))
    floor = {"poses": 5e-6, "motion": 5e-3, "gear": 1e-6}[measure]
    assert np.max(np.abs(hidden - plain)) > floor


def test_sensors_are_as_bad_as_declared():
    robot, random = six_axis(), np.random.default_rng(2)
    virtual = VirtualRobot.of(robot)
    q = np.tile([[0.3, 0.2, 0.5, 0.1, 0.2, 0.3]], (2000, 1))
    sensors = Sensors(position_m=2e-4, counts=4096, wrong_rows=0.02)
    data = measure_poses(virtual, q, sensors, random)
    off = data.position - np.median(data.position, axis=0)
    assert np.median(np.abs(off)) / 0.6745 == pytest.approx(2e-4, rel=0.1)
    assert 0.01 < np.mean(np.linalg.norm(off, axis=1) > 2e-3) < 0.03
    steps = data.joints["theta"] / (2.0 * np.pi / 4096)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_profiles_stay_within_the_limits():
    robot = six_axis()
    low, high = limit(robot, "q_min"), limit(robot, "q_max")
    for seed in range(5):
        time, q = rest_to_rest(robot, 5.0, 500.0, seed)
        rate, acceleration = np.gradient(q, time,
                                         axis=0), np.gradient(np.gradient(q, time, axis=0), time, axis=0)
        assert np.all(q >= low) and np.all(q <= high)
        assert np.all(np.abs(rate) < limit(robot, "q_dot_max")) and np.all(
            np.abs(acceleration) < limit(robot, "q_ddot_max")
        )
        assert np.max(np.abs(rate[[0, -1]])) < 1e-5
    time, q = gear_run(robot, 2, 0.8, False, 1000.0)
    assert q[0, 2] > q[-1, 2] and np.ptp(np.delete(q, 2, axis=1), axis=0).max() == 0.0
    assert np.max(np.abs(np.gradient(q[:, 2], time))) == pytest.approx(0.8, rel=1e-6)


def test_simulated_gyroscope_follows_the_corners_of_the_motion():
    """The motors' commands are exact: no filter against an encoder rounds the rate of a gear run."""
    robot = load_robot("racer-7-1.4")
    runs = measure_gear_runs(VirtualRobot.of(robot), [5], [3.0], 1, EXACT, np.random.default_rng(1))
    up = runs.run == 1
    time, q = gear_run(robot, 5, 3.0, True, 1000.0)
    rate = np.gradient(q[:, 5], time)
    assert np.max(np.abs(rate - runs.gyro[up, 2])) < 0.02  # half a sample of the ramp


def test_gear_inverse_of_the_independent_plant():
    robot = geared(six_axis())
    phi = np.linspace(-2.0, 2.0, 50)
    table = robot.joints[0].cw.core()
    theta = np.tile(_core.gear_motor_angle(84.0, table, phi)[:, None], (1, 6))
    found = gear_outputs(replace(robot, joints=(robot.joints[0],) * 6), np.arange(50.0), theta)
    np.testing.assert_allclose(found[:, 0], phi, atol=1e-12)


@pytest.mark.parametrize("text, expected", [
    ("blacklash joint=2", "unknown effect"), ("backlash width_rad=1", "joint=1 to joint=6"),
    ("backlash joint=7 width_rad=1", "joint=1"), ("backlash joint=2", "no width_rad"),
    ("backlash joint=2 depth=3", "depth; expected width_rad"), ("payload mass_kg", "words like"),
    ("backlash joint=2 widht_rad=1", "did you mean width"), ("declared_friction joint=1", "unknown effect"),
])  # fmt: skip
def test_wrong_effects_are_refused(text, expected):
    with pytest.raises(InputError, match=expected):
        parse_effect(text, 6)


# -- the command -------------------------------------------------------------------------------------
@pytest.fixture
def arm(tmp_path):
    write_robot(tmp_path / "arm.toml", six_axis(springs=True, placed=False))
    return str(tmp_path / "arm.toml")


def simulate(arm, out, *words):
    assert main(["simulate", arm, "--out", str(out), "--quiet", *words]) == 0
    return json.loads((out / "result.json").read_text())


@pytest.mark.parametrize("measure, file, kind, words", [
    ("poses", "measured.csv", "poses", ["--count", "20", "--visits", "2", "--temperature", "20", "40"]),
    ("gear", "gear_runs.parquet", "gear_run", ["--joint", "2", "--repeats", "1", "--rate", "250"]),
    pytest.param("motion", "motion.parquet", "motion", ["--runs", "2", "--seconds", "1.5", "--rate", "250"],
                 marks=pytest.mark.slow),
])  # fmt: skip
def test_command_measures_and_keeps_its_truth_apart(arm, tmp_path, measure, file, kind, words):
    hidden = ["--effect", "gear_ratio joint=2 scale=1.25e-3", "--deviation", "1"]
    result = simulate(arm, tmp_path / "a", "--measure", measure, *hidden, *words)
    again = simulate(arm, tmp_path / "b", "--measure", measure, *hidden, *words)
    data = read_dataset(tmp_path / "a" / file, load_robot(arm))
    assert data.kind == kind and len(data) == result["rows"] and result["seed"] == again["seed"]
    assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    truth = load_robot(tmp_path / "a" / "truth.toml")
    assert [effect.label for effect in truth.effects] == ["gear_ratio_2"]
    for text in ((tmp_path / "a" / "result.json").read_text(), (tmp_path / "a" / "report.html").read_text()):
        assert "gear_ratio" not in text and "0.00125" not in text


@pytest.mark.slow
def test_command_plays_a_trajectory(arm, tmp_path):
    """A rigid plan misses by what the springs give; both engines say so alike."""
    robot = load_robot(arm)
    time, q = rest_to_rest(robot, 1.0, 500.0)
    path, _ = _core.forward_kinematics(robot.core, q)
    columns = {"time_s": time} | {f"theta_{i + 1}_rad": v
                                  for i, v in enumerate(VirtualRobot.of(robot).motor_angles(q).T)}
    columns |= {f"{axis}_m": path[:, k] for k, axis in enumerate("xyz")}
    text = ",".join(columns) + "\n" + "\n".join(",".join(repr(float(v)) for v in row)
                                                for row in zip(*columns.values()))
    (tmp_path / "trajectory.csv").write_text(text)
    results = [simulate(arm, tmp_path / engine, str(tmp_path / "trajectory.csv"), "--engine", engine)
               for engine in ("own", "pinocchio")]
    errors = [result["tracking"]["position_rms_m"] for result in results]
    assert errors[0] > 1e-4
    assert errors[1] == pytest.approx(errors[0], rel=1e-4)
    fine = simulate(arm, tmp_path / "fine", str(tmp_path / "trajectory.csv"), "--rate", "2000")
    assert fine["rows"] > 3.9 * results[0]["rows"]
    assert fine["tracking"]["position_rms_m"] == pytest.approx(errors[0], rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["motion", "cw"])
def test_command_plays_a_plan_as_the_planner_meant_it(direction, tmp_path):
    """Reversals are those of q_desired; a plan that keeps one table is played on a robot that does."""
    words = ["racer-7-1.4", "spiral", "--rate", "250", "--gear-direction", direction, "--out",
             str(tmp_path / "plan")]
    assert main(["plan", *words]) == 0
    trajectory = str(tmp_path / "plan" / "trajectory.csv")
    robot = ["racer-7-1.4", "--frames", "declared", "--gear-direction", direction]
    played = simulate(robot[0], tmp_path / "played", trajectory, *robot[1:])
    fine = simulate(robot[0], tmp_path / "fine", trajectory, *robot[1:], "--rate", "1000")
    other = simulate(robot[0], tmp_path / "other", trajectory, *robot[1:], "--engine", "pinocchio")
    for result in (played, fine, other):
        assert result["tracking"]["position_rms_m"] < 1e-5


@pytest.mark.parametrize("words, expected", [
    (["--measure", "tracked"], "trajectory.csv"), (["--measure", "gear", "--joint", "9"], "--joint 9"),
    (["--count", "0"], "--count 0"), (["--noise", "-1"], "--noise"),
    (["--effect", "nothing"], "unknown effect"),
])  # fmt: skip
def test_command_refuses(arm, tmp_path, words, expected, capsys):
    assert main(["simulate", arm, "--out", str(tmp_path / "out"), *words]) == 2
    assert expected in capsys.readouterr().err
    assert not (tmp_path / "out" / "result.json").exists()


def test_robot_without_gears_has_no_gear_runs(tmp_path, capsys):
    assert main(["simulate", "ur10", "--measure", "gear", "--out", str(tmp_path / "out")]) == 2
    assert "declares no gear ratio" in capsys.readouterr().err


def test_robot_without_masses_cannot_be_simulated_in_motion(tmp_path, capsys):
    assert main(["simulate", "tx40", "--measure", "motion", "--out", str(tmp_path / "out")]) == 2
    assert "link masses" in capsys.readouterr().err


def test_library_names_are_all_understood():
    """Every effect that may be hidden has a form that the command line can say."""
    for name in library():
        if library()[name].declared:
            with pytest.raises(InputError):
                parse_effect(name, 6)


def test_a_robot_without_gears_reports_exact_angles_unless_counts_are_asked_for():
    """65,536 counts of the output would be 96 urad: structure that a diagnosis finds in clean data."""
    random, robot = np.random.default_rng(3), load_robot("ur10")
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (6, 6))
    exact = measure_poses(VirtualRobot.of(robot), q, Sensors(), random).joints["theta"]
    counted = measure_poses(VirtualRobot.of(robot), q, Sensors(counts=2**16), random).joints["theta"]
    np.testing.assert_array_equal(exact, q - robot.controller_offsets)
    step = 2.0 * np.pi / 2**16
    np.testing.assert_allclose(counted / step, np.round(counted / step), atol=1e-6)
    theta = measure_poses(VirtualRobot.of(load_robot("racer-7-1.4")), q, Sensors(), random).joints["theta"]
    np.testing.assert_allclose(theta / step, np.round(theta / step), atol=1e-5)
