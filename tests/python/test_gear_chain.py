"""The chain for gear runs: what it predicts, and its derivatives against central differences."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, gear_record, predict_gear_run
from exactarm.data.dataset import Dataset
from exactarm.effects.backlash import Backlash
from exactarm.effects.declared_harmonics import DeclaredHarmonics
from exactarm.effects.direction_dependence import DirectionDependence
from exactarm.effects.encoder_offset import EncoderOffset
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.gear_ratio import GearRatio
from exactarm.effects.gyro_alignment import GyroAlignment, aligning_angles, tilt
from exactarm.effects.gyro_bias import GyroBias
from exactarm.effects.gyro_g_sensitivity import GyroGSensitivity
from exactarm.effects.gyro_misalignment import GyroMisalignment
from exactarm.effects.gyro_scale import GyroScale
from exactarm.effects.hysteresis import Hysteresis
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.effects.load_dependence import LoadDependence, WeightDependence
from exactarm.effects.speed_dependence import SpeedDependence
from exactarm.effects.time_delay import TimeDelay
from exactarm.robot_file import load_robot
from gear_simulation import DEGREE, GearRuns, simulate

EFFECTS = (
    GearHarmonics(2, (50.3, 1e-3, 3e-3, -5e-4, 2e-4)),
    DirectionDependence(2, (40.2, 2e-3, -1e-3)),
    SpeedDependence(2, (0.3,)),
    SpeedDependence(2, (83.0, 1e-3, 2e-3)),
    LoadDependence(2, (1e-5,)),
    LoadDependence(2, (2e-3,), of_declared=True),
    LoadDependence(2, (83.0, 1e-5, 2e-5)),
    WeightDependence(2, (1e-5, 2e-6)),
    GearEccentricity(2, (1e-4, -2e-4, 5e-5, 1e-4)),
    GearRatio(2, (1e-3,)),
    Backlash(2, (4e-4, 60.0)),
    Hysteresis(2, (3e-4, 0.05)),
    JointCoupling(1, (2.0, 0.02)),
    TimeDelay(None, (2.3e-3,)),
    GyroScale(None, (2e-3,)),
    GyroBias(None, (1e-3, -2e-3, 5e-4)),
    GyroGSensitivity(None, (1e-3, 2e-3, -5e-4, 4e-4, -1e-3, 3e-4, 2e-4, 6e-4, -7e-4)),
    GyroMisalignment(None, (2.0, 0.01, -0.02, 0.015)),
    GyroAlignment(2, (0.02, -0.03)),
    GyroAlignment(2, (0.02, -0.03), flipped=True),
)
IDS = [f"{effect.name}-{len(effect.values)}" for effect in EFFECTS]


@pytest.fixture(scope="module")
def racer():
    return load_robot("racer-7-1.4")


@pytest.fixture(scope="module")
def run_of_axis_2(racer):
    case = GearRuns(joint=2, speed=60.0 * DEGREE, rate_hz=125.0, counts=0, tilt=(0.0, 0.0))
    return simulate(racer, case)


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
@pytest.mark.slow
def test_derivatives(racer, run_of_axis_2, effect):
    declared = DeclaredHarmonics.of(racer, 1, "ccw")
    layout = Layout.of((declared, effect, GyroAlignment(2, (0.01, 0.02))))
    layout = layout.without({name for name in layout.names[3:] if name.startswith("gear_2_ccw")})
    data, record = run_of_axis_2, gear_record(racer, run_of_axis_2)
    predict = lambda x: predict_gear_run(racer, layout.at(x), data, record=record, tangents=False).measured
    jacobian = predict_gear_run(racer, layout, data, record=record).jacobian
    step = np.maximum(1e-3 * np.abs(layout.values), 1e-6)
    assert_derivative(predict, layout.values, jacobian, step, relative=5e-6)


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
@pytest.mark.slow
def test_response_is_the_first_order_of_the_jacobian(racer, run_of_axis_2, effect):
    """What the diagnosis sees of an effect outside the model: the same but for the feedback of the load."""
    data = run_of_axis_2
    inside = predict_gear_run(racer, Layout.of((effect,)), data)
    outside = predict_gear_run(racer, Layout.of(()), data).view.response(effect.with_values(effect.values))
    zero = [0.0 if not p.fixed and "order" not in p.name and "reach" not in p.name else v
            for p, v in zip(effect.parameters(), effect.values)]
    start = effect.with_values(zero)
    inside = predict_gear_run(racer, Layout.of((start,)), data).jacobian
    free = ~np.array([p.fixed for p in effect.parameters()])
    outside = predict_gear_run(racer, Layout.of(()), data).view.response(start)[:, :, free]
    scale = np.abs(inside).max(axis=(0, 1))
    assert np.all(np.abs(inside - outside).max(axis=(0, 1)) <= 0.03 * scale + 1e-12)


def test_predicts_what_the_simulation_measures(racer):
    case = GearRuns(joint=1, speed=88.0 * DEGREE, noise=0.0, counts=0, tilt=(0.0, 0.0))
    data = simulate(racer, case)
    prediction = predict_gear_run(racer, Layout.of(()), data, tangents=False)
    cruising = np.abs(prediction.view.signals["theta_dot"][:, 0]) > 0.999 * 88.0 * DEGREE * 84.86
    cruising &= prediction.keep
    residual = prediction.residual()[cruising, 2]
    assert np.sqrt(np.mean(residual**2)) < 1e-5
    constant = racer.with_joint(0, cw=None, ccw=None)
    rough = predict_gear_run(constant, Layout.of(()), data, tangents=False).residual()[cruising, 2]
    # E5: 0.269 deg/s of kinematic error clockwise; both directions together.
    assert_allclose(np.sqrt(np.mean(rough**2)) / DEGREE, 0.27, atol=0.03)


def test_gravity_bends_axis_2(racer):
    core = racer.core
    soft = racer.with_joint(1, spring_linear=2e4, spring_cubic=0.0, cw=None, ccw=None)
    case = GearRuns(joint=2, speed=40.0 * DEGREE, noise=0.0, counts=0, tilt=(0.0, 0.0))
    data = simulate(soft, case, gravity=lambda q: _core.gravity_torque(core, q), rest=np.zeros(6))
    bent = predict_gear_run(soft, Layout.of(()), data, tangents=False)
    rigid = predict_gear_run(soft.with_joint(1, spring_linear=None), Layout.of(()), data, tangents=False)
    cruising = np.abs(bent.view.signals["theta_dot"][:, 1]) > 0.999 * 40.0 * DEGREE * 82.84
    rms = lambda p: np.sqrt(np.mean(p.residual()[cruising, 2] ** 2))
    assert rms(rigid) > 5e-3
    assert rms(bent) < 0.02 * rms(rigid)


@pytest.mark.slow
def test_encoder_quantisation_adds_little_noise(racer):
    for counts in (2**12, 2**16):
        case = GearRuns(joint=1, speed=88.0 * DEGREE, counts=counts, tilt=(0.0, 0.0))
        data = simulate(racer, case)
        prediction = predict_gear_run(racer, Layout.of(()), data, tangents=False)
        judged = np.einsum("ij,ij->i", prediction.residual(), prediction.along)[prediction.keep]
        rms = np.sqrt(np.mean(judged**2))
        assert rms < 1.05 * case.noise


def test_judged_rows_leave_the_reversal_out(racer):
    case = GearRuns(joint=1, speed=60.0 * DEGREE, noise=0.0, counts=0)
    parts = simulate(racer, case)
    turn = np.flatnonzero(parts.run == 2)
    time = parts.time.copy()
    time[turn] += time[turn[0] - 1] + 1e-3
    there_and_back = replace(parts, run=np.ones(len(parts), int), time=time)
    prediction = predict_gear_run(racer, Layout.of(()), there_and_back, tangents=False)
    assert not prediction.keep[turn[0]]
    assert prediction.keep.mean() > 0.9
    direction = prediction.view.direction[:, 0]
    assert np.all(direction[: turn[0] - 60] == 1.0) and np.all(direction[turn[0] + 60 :] == -1.0)


def test_link_encoders(racer):
    random = np.random.default_rng(2)
    time = np.arange(0.0, 4.0, 0.004)
    q = 0.5 * np.sin(time)[:, None] * np.array([1.0, 0.7, -0.4, 0.0, 0.0, 0.0])
    theta = q * racer.ratios
    measured = q + 0.3 + random.normal(0.0, 1e-6, q.shape)
    measured[:, 3:] = np.nan
    data = Dataset.of_arrays("gear_run", {"theta": theta, "q": measured}, time=time)
    plain = load_robot("kr300")
    for i, joint in enumerate(racer.joints):
        plain = plain.with_joint(i, ratio=joint.ratio)
    layout = Layout.of((EncoderOffset(1, (0.3,), 1, 0), EncoderOffset(2, (0.3,), 1, 1),
                        EncoderOffset(3, (0.3,), 1, 2)))
    prediction = predict_gear_run(plain, layout, data)
    assert prediction.along is None and prediction.residual().shape == (time.size, 3)
    assert np.abs(prediction.residual()[prediction.keep]).max() < 1e-5
    assert_allclose(prediction.jacobian, np.broadcast_to(np.eye(3), (time.size, 3, 3)))


def test_closed_form_of_the_alignment():
    random = np.random.default_rng(4)
    for _ in range(20):
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        assert_allclose(tilt(*aligning_angles(axis)) @ axis, [0.0, 0.0, 1.0], atol=1e-14)


@pytest.mark.parametrize("effect", EFFECTS[:-2], ids=IDS[:-2])
def test_table_gives_the_effect_back(effect):
    from exactarm.effects import effect_from_table

    assert effect_from_table(effect.to_table()) == effect
