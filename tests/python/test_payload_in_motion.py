"""A payload that is known from row to row of a motion (payload_kg): part of the dynamics, not a covariate."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from central_difference import assert_derivative
from exactarm.chain import Layout, motion_record, predict_motion
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import NOTHING
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.effects.payload import Payload
from exactarm.errors import InputError
from exactarm.identify.dynamics import identify_dynamics
from exactarm.measurement.session_payload import SessionPayloadInMotion
from motions import fourier_motion, motion_data
from six_axis import six_axis

MASS, CENTRE = 4.0, np.array([0.02, -0.01, 0.08])
NOISE_NM = np.array([2.0, 3.0, 1.5, 0.5, 0.3, 0.2])


def with_payload(data: Dataset, mass: np.ndarray) -> Dataset:
    columns = {f"payload_{axis}_m": np.full(len(data), CENTRE[k]) for k, axis in enumerate("xyz")}
    return replace(data, covariates={"payload_kg": mass} | columns)


def test_a_known_payload_moves_like_one_that_the_robot_declares():
    """Torque and all derivatives, springs of axes 2 and 3 and their tangents included."""
    robot = six_axis()
    time, angle, _, _ = fourier_motion(robot, 3.0, 100.0, 3)
    data = motion_data(robot, time, angle)
    record = motion_record(robot, with_payload(data, np.full(len(data), MASS)))
    layout = Layout.of((JointCompliance(2, (5e-6, 0.0)), GearHarmonics(3, (2.0, 1e-3, 5e-4))))
    found = predict_motion(robot, layout, record)
    baked = Payload(None, (MASS, *(MASS * CENTRE))).bake(robot)
    expected = predict_motion(baked, layout, motion_record(robot, data))
    np.testing.assert_allclose(found.torque, expected.torque, atol=1e-9)
    np.testing.assert_allclose(found.jacobian, expected.jacobian, atol=1e-9 * np.abs(expected.jacobian).max())


def test_derivatives_agree_with_differences_where_rows_carry_different_payloads():
    robot = six_axis()
    time, angle, _, _ = fourier_motion(robot, 2.0, 60.0, 5)
    data = motion_data(robot, time, angle)
    record = motion_record(robot, with_payload(data, np.where(time < 1.0, 0.0, MASS)))
    estimated = SessionPayloadInMotion(None, (2.0, 0.1, -0.05, 0.3), 1)
    layout = Layout.of((JointCompliance(2, (5e-6, 0.0)), estimated))
    found = predict_motion(robot, layout, record)
    at = lambda x: predict_motion(robot, layout.at(x), record, tangents=False).torque
    assert_derivative(at, layout.values, found.jacobian, 1e-7, relative=1e-3)


def two_runs(robot) -> Dataset:
    """One run bare and one with the payload, and which is which."""
    parts = []
    for run, mass in ((1, 0.0), (2, MASS)):
        time, angle, _, _ = fourier_motion(robot, 14.0, 100.0, run, base_hz=0.1, amplitude=0.9)
        data = with_payload(motion_data(robot, time, angle), np.full(time.size, mass))
        record = motion_record(robot, data, 100.0)
        torque = predict_motion(robot, Layout.of(()), record, tangents=False).torque
        noise = np.random.default_rng(run).normal(0.0, NOISE_NM, torque.shape)
        parts.append((time, angle, torque + noise, np.full(time.size, run), np.full(time.size, mass)))
    time, angle, torque, run, mass = (np.concatenate(each) for each in zip(*parts))
    return with_payload(motion_data(robot, time, angle, torque, run=run), mass)


@pytest.mark.slow
def test_identification_takes_a_known_payload_out_of_the_torque():
    """The links that are found are those without it: held-out torques are met to the noise, and with the
    payload unsaid they are not."""
    robot = six_axis()
    data = two_runs(robot)
    rms = lambda result: np.sqrt(np.mean(result.after["validation"] ** 2))
    known = rms(identify_dynamics(robot, data))
    unsaid = rms(identify_dynamics(robot, replace(data, covariates={})))
    assert known < 1.1 * np.sqrt(np.mean(NOISE_NM**2)) < 0.8 * unsaid


@pytest.mark.slow
def test_a_known_payload_is_no_cause():
    result = diagnose(six_axis(), two_runs(six_axis()))
    assert result.verdict == NOTHING and result.findings == ()


MASSES = {1: 0.0, 2: 4.0, 3: 9.0}


def three_sessions(robot) -> Dataset:
    """A run of each session, with its payload in the torques and nowhere else."""
    parts = []
    for session, mass in MASSES.items():
        time, angle, _, _ = fourier_motion(robot, 14.0, 100.0, session, base_hz=0.1, amplitude=0.9)
        loaded = with_payload(motion_data(robot, time, angle), np.full(time.size, mass))
        record = motion_record(robot, loaded, 100.0)
        torque = predict_motion(robot, Layout.of(()), record, tangents=False).torque
        torque += np.random.default_rng(session).normal(0.0, NOISE_NM, torque.shape)
        parts.append((time, angle, torque, np.full(time.size, session)))
    time, angle, torque, session = (np.concatenate(each) for each in zip(*parts))
    return motion_data(robot, time, angle, torque, run=session, session=session)


def table(tmp_path, *lines: str):
    (tmp_path / "sessions.csv").write_text("\n".join(("session,payload_kg", *lines)) + "\n")
    return tmp_path / "sessions.csv"


def assert_payloads(found: list[dict], weighed: set[int]) -> None:
    assert [each["session"] for each in found] == list(MASSES)
    for each in found:
        low, high = each["mass_kg"]["ci95"]
        true = MASSES[each["session"]]
        assert each["estimated"] == (each["session"] not in weighed)
        assert low - 0.02 <= true <= high + 0.02 and high - low < 0.6
        if each["estimated"]:
            np.testing.assert_allclose(each["centre_m"], CENTRE, atol=6e-3)


@pytest.mark.slow
def test_payloads_that_nobody_weighed_are_found_in_torques_beside_the_links(tmp_path):
    """Masses of the links are estimated with them, from the session that was weighed."""
    robot = six_axis()
    made = ea.identify(replace(robot, links=None), three_sessions(robot),
                       sessions=table(tmp_path, "1,0", "2,", "3,"))
    assert_payloads(made["payloads"], {1})
    assert made["after"]["validation"]["rms"] < 1.1 * np.sqrt(np.mean(NOISE_NM**2))
    assert made.tables["payloads.csv"]["session"] == [1, 2, 3]


@pytest.mark.slow
def test_only_sums_of_links_and_payloads_are_refused_by_name(tmp_path):
    robot = six_axis()
    with pytest.raises(InputError, match="the torques show their sum alone; expected the payload_kg of one"):
        ea.identify(robot, three_sessions(robot), sessions=table(tmp_path, "1,", "2,", "3,"))


@pytest.mark.slow
def test_masses_that_are_held_tell_every_payload(tmp_path):
    robot = six_axis()
    made = ea.identify(robot, three_sessions(robot), friction_only=True,
                       sessions=table(tmp_path, "1,0", "2,", "3,"))
    assert_payloads(made["payloads"], {1})


@pytest.mark.slow
def test_diagnosis_takes_payloads_that_nobody_weighed_for_no_cause(tmp_path):
    robot = six_axis()
    made = ea.diagnose(robot, three_sessions(robot), sessions=table(tmp_path, "1,0", "2,", "3,"))
    assert made["verdict"] == NOTHING and not made["effects"]
    assert_payloads(made["payloads"], {1})
