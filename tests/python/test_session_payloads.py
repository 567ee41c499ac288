"""Payloads that nobody has weighed: their mass by session, one stiffness for all, against the truth."""

import json
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.cli import main
from exactarm.data.dataset import Dataset, dataset_columns
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.errors import InputError
from exactarm.files.table import write_table
from exactarm.measurement.session_payload import SessionPayload
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, deviated, measure_poses

UR10 = load_robot("ur10")
STIFF = {2: 6e-6, 3: 9e-6}  # rad/Nm
MASSES, CENTRE, NOISE_M = (0.0, 4.0, 8.0), (0.0, 0.0, 0.08), 3e-5


@pytest.mark.parametrize("centre", [None, CENTRE])
def test_derivatives_by_mass_and_moment_agree_with_differences(centre):
    values = (3.0,) if centre else (3.0, 0.05, -0.02, 0.2)
    springs = (JointCompliance(2, (6e-6, 0.0)), JointCompliance(3, (9e-6, 0.0)))
    layout = Layout.of(springs, estimate=False).joined(Layout.of((SessionPayload(None, values, 2, centre),)))
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (8, 6))
    data = Dataset.of_arrays("poses", {"q": q}, position=np.zeros((8, 3)),
                             session=np.array([1, 1, 2, 2, 2, 2, 2, 2]))
    found = predict_poses(UR10, layout, data)
    at = lambda x: predict_poses(UR10, layout.at(x), data, tangents=False).position
    # the load's own change with the arm's deflection is left out of the tangent: below 1 %
    assert_derivative(at, layout.values, found.jacobian[:, :3], 1e-2, relative=1e-2)
    np.testing.assert_array_equal(found.jacobian[:2], 0.0)


def three_sessions(seed: int = 4) -> dict[str, np.ndarray]:
    """Columns of poses of an arm that deviates from its drawing, weighs what it declares, and whose axes 2
    and 3 give way, under three payloads that the columns do not tell."""
    random = np.random.default_rng(seed)
    springs = tuple(JointCompliance(axis, (size, 0.0)) for axis, size in STIFF.items())
    true = replace(deviated(UR10, 1.0, random), links=UR10.links)
    q, session = random.uniform(-2.2, 2.2, (150, 6)), np.repeat([1, 2, 3], 50)
    carried = {"payload_kg": np.repeat(MASSES, 50), "payload_z_m": np.full(150, CENTRE[2])}
    sensors = Sensors(position_m=NOISE_M, counts=0)
    data = measure_poses(VirtualRobot.of(UR10, springs, true), q, sensors, random, session=session,
                         payload=carried)
    return dataset_columns(replace(data, covariates={}), UR10)


@pytest.mark.slow
@pytest.mark.parametrize(("header", "lines"), [
    ("session,payload_kg,payload_x_m,payload_y_m,payload_z_mm", ("1,0,0,0,80", "2,,0,0,80", "3,,0,0,80")),
    ("session,payload_kg", ("1,0", "2,", "3,")),
])
def test_three_payloads_in_three_sessions_have_one_stiffness_and_their_own_mass(tmp_path, header, lines):
    write_table(tmp_path / "measured.csv", three_sessions())
    (tmp_path / "sessions.csv").write_text("\n".join((header, *lines)) + "\n")
    out = tmp_path / "out"
    assert main(["calibrate", "ur10", str(tmp_path / "measured.csv"), "--sessions",
                 str(tmp_path / "sessions.csv"), "--compliance", "2,3", "--out", str(out), "--quiet"]) == 0
    made = json.loads((out / "result.json").read_text())
    assert made["converged"] and made["after"]["validation"]["mean"] < 2.0 * NOISE_M
    for axis, size in STIFF.items():
        low, high = made["parameters"][f"joint_compliance_{axis}.linear_rad_per_Nm"]["ci95"]
        assert low - 0.5 * (high - low) <= size <= high + 0.5 * (high - low)
    assert [p["estimated"] for p in made["payloads"]] == [False, True, True]
    for found, true in zip(made["payloads"][1:], MASSES[1:]):
        low, high = found["mass_kg"]["ci95"]
        assert low - 0.5 * (high - low) <= true <= high + 0.5 * (high - low)
        assert found["mass_kg"]["value"] == pytest.approx(true, rel=0.15)
    effects = load_robot(out / "robot.toml").effects
    assert [effect.label for effect in effects] == ["joint_compliance_2", "joint_compliance_3"]
    # the table that it wrote is one for the other commands, and without it they refuse
    assert main(["evaluate", str(out / "robot.toml"), str(tmp_path / "measured.csv"), "--sessions",
                 str(out / "payloads.csv"), "--out", str(tmp_path / "judged"), "--quiet"]) == 0
    judged = json.loads((tmp_path / "judged" / "result.json").read_text())
    assert judged["error"]["mean"] < 2.0 * NOISE_M
    with pytest.raises(InputError, match="session 2: no mass; expected one"):
        ea.diagnose("ur10", tmp_path / "measured.csv", sessions=tmp_path / "sessions.csv")


def test_a_payload_of_a_rigid_arm_is_dropped_with_the_reason(tmp_path):
    write_table(tmp_path / "measured.csv", three_sessions())
    (tmp_path / "sessions.csv").write_text("session,payload_kg\n1,0\n2,\n3,0\n")
    made = ea.calibrate(UR10, tmp_path / "measured.csv", sessions=tmp_path / "sessions.csv", compliance=())
    assert "payload_session2.mass_kg" in {entry["parameter"] for entry in made["dropped"]}
    assert [p["session"] for p in made["payloads"]] == [1, 3]


def test_a_mass_that_poses_cannot_tell_is_said():
    rows = ea.simulate("ur10", count=60, deviation=1.0, noise=NOISE_M, seed=1).data  # the default, said
    found = ea.calibrate("ur10", rows, sessions={"session": [1], "payload_kg": [np.nan]}, threads=1)
    assert any("session 1: its payload stays unknown" in line for line in found.warnings)
    mass = next(entry for entry in found.json["dropped"] if entry["parameter"].endswith("mass_kg"))
    assert " kg only, plausible is 5 kg" in mass["why"]
