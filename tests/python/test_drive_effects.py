"""Effects of drive, load, structure and measuring device: what they add, and every derivative of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, View, predict_poses
from exactarm.commands.effect_sections import _size
from exactarm.data.dataset import Dataset
from exactarm.effects import Station, effect_from_table, library
from exactarm.effects.frames import Frames
from exactarm.effects.outliers import Outliers
from exactarm.effects.payload import Payload, inertial
from exactarm.effects.slow_driver import drivers, slow_signal
from exactarm.effects.thermal_drift import ThermalDrift
from six_axis import six_axis

ROWS, AXES = 40, 6
MOTION = (
    "coulomb_friction viscous_friction stribeck_friction asymmetric_friction load_friction "
    "shear_thinning_friction "
    "torque_ripple torque_constant rotor_inertia gravity_compensator motor_link_coupling payload "
    "thermal_drift"
).split()
POSES = "payload link_compliance base_compliance thermal_drift tracker_scale tracker_drift outliers".split()


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(20240611)


def bare(robot):
    """The robot without declared friction, so that friction is a candidate."""
    return replace(robot, joints=tuple(replace(joint, coulomb=None) for joint in robot.joints))


def motion_view(random, robot=None) -> View:
    robot = robot or six_axis()
    temperature = {"temperature_degC": np.linspace(20.0, 45.0, ROWS)}
    theta = random.normal(0.0, 60.0, (ROWS, AXES))
    data = Dataset.of_arrays("motion", {"theta": theta}, time=0.01 * np.arange(ROWS), covariates=temperature)
    view = View(robot, data, "motion")
    scale = {"theta_dot": 30.0, "theta_ddot": 200.0, "q_dot": 1.0, "q_ddot": 5.0, "torque": 300.0,
             "measured": 300.0}
    view.signals |= {name: random.normal(0.0, size, (ROWS, AXES)) for name, size in scale.items()}
    view.signals |= {"theta": theta, "phi": theta / robot.ratios, "q": theta / robot.ratios + robot.offsets}
    view.tangents["theta"] = np.zeros((ROWS, AXES, 0))
    return view


def pose_data(random, robot, **more) -> Dataset:
    q = random.uniform(-1.5, 1.5, (ROWS, AXES))
    zero = np.zeros((ROWS, 3))
    data = Dataset.of_arrays("poses", {"q": q}, position=zero, time=60.0 * np.arange(ROWS), **more)
    return replace(data, position=predict_poses(robot, Layout.of(()), data, tangents=False).position)


def plausible(effect, random):
    """The effect at random values of plausible size."""
    values = []
    for parameter, value in zip(effect.parameters(), effect.values):
        drawn = value or parameter.plausible * random.uniform(0.5, 1.0) * random.choice([-1.0, 1.0])
        values.append(np.clip(abs(drawn) if parameter.lower == 0.0 else drawn, parameter.lower,
                              parameter.upper))
    return effect.with_values(values)


def check_by_signal(effect, view):
    """Each claimed slope by an upstream signal, one column of it at a time."""
    change = effect.change(view)
    for name, factor in change.by_signal.items():
        if name == "displacement":
            continue  # stands for the target, whose tangent it is; checked through the chain
        original = view.signals[name]

        def shifted(x, name=name, original=original):
            view.signals[name] = original + x
            return effect.change(view).value

        step = 1e-4 * np.sqrt(np.mean(original**2))
        if name == "theta_dot":
            step = 1e-2  # the smoothed sign is narrow
        assert_derivative(shifted, np.zeros(original.shape[1]), factor, step, relative=2e-5)
        view.signals[name] = original


@pytest.mark.parametrize("name", MOTION)
@pytest.mark.slow
def test_motion_effect_derivatives(name, random):
    robot = bare(six_axis())
    view = motion_view(random, robot)
    if name == "viscous_friction":
        robot = replace(robot, joints=tuple(replace(joint, viscous=None) for joint in robot.joints))
    view.signals["theta_dot"] *= 0.1  # some rows within the smoothed sign
    candidates = list(library()[name].candidates(robot, view))
    assert candidates
    for effect in candidates:
        assert "motion" in effect.kinds
        effect = plausible(effect, random)
        if isinstance(effect, Payload):
            continue  # lives in the tables: checked below
        steps = [1e-3 * parameter.plausible for parameter in effect.parameters()]
        if name == "torque_ripple":
            steps[0] = 1e-5  # many cycles: the phase turns quickly with the order
        change = lambda x, effect=effect: effect.with_values(x).change(view).value
        assert_derivative(change, np.array(effect.values), effect.change(view).by_parameters, steps)
        check_by_signal(effect, view)


def test_drive_friction_opposes_motion(random):
    """All friction takes power from the motor, whatever the sign of the gear ratio."""
    robot = bare(six_axis())
    robot = replace(robot, joints=tuple(replace(joint, viscous=None) for joint in robot.joints))
    view = motion_view(random, robot)
    rate = view.signals["theta_dot"] / robot.ratios
    for name in ("coulomb_friction", "viscous_friction", "stribeck_friction", "load_friction",
                 "shear_thinning_friction"):
        for effect in library()[name].candidates(robot, view):
            values = [value or parameter.plausible
                      for parameter, value in zip(effect.parameters(), effect.values)]
            change = effect.with_values(values).change(view)
            assert np.all(change.value[:, 0] * rate[:, change.columns[0]] >= 0.0)


def test_payload_torque_is_that_of_a_point_mass(random):
    """Baked into the last link, it changes the inverse dynamics as the regressor says, and as a real mass
    would."""
    robot, values = six_axis(), np.array([4.0, 0.2, -0.4, 0.6])
    q, q_dot, q_ddot = (random.normal(0.0, 1.0, (5, AXES)) for _ in range(3))
    torque = lambda x: _core.inverse_dynamics(Payload(None, tuple(x)).bake(robot).core, q, q_dot, q_ddot)
    regressor = _core.dynamics_regressor(robot.core, q, q_dot, q_ddot)[:, :, -10:]
    pi, slope = inertial(values)
    np.testing.assert_allclose(torque(values) - torque(np.zeros(4)), regressor @ pi, atol=1e-9)
    assert_derivative(torque, values, regressor @ slope, 1e-2)
    assert_derivative(lambda x: inertial(x)[0], values, slope, 1e-3)
    assert_derivative(lambda x: inertial(x)[0], np.array([1e-4, 0.01, 0.0, 0.0]),
                      inertial([1e-4, 0.01, 0, 0])[1], 1e-6)
    np.testing.assert_allclose(pi[4:], [0.13, 0.02, -0.03, 0.1, 0.06, 0.05], rtol=1e-6)


def test_a_body_adds_its_own_inertia_to_that_of_the_point():
    point = np.array([4.0, 0.2, -0.4, 0.6])
    body = np.concatenate([point, [0.3, 0.01, -0.02, 0.4, 0.03, 0.2]])
    np.testing.assert_allclose(inertial(body)[0] - inertial(point)[0], [0.0] * 4 + [*body[4:]], atol=1e-15)
    assert_derivative(lambda x: inertial(x)[0], body, inertial(body)[1], 1e-3)
    payload = Payload(None, tuple(body))
    assert Payload.from_table(payload.to_table()) == payload
    assert len(Payload.from_table(Payload(None, tuple(point)).to_table()).values) == 4
    assert payload.possible(six_axis(), np.zeros(10))
    assert not payload.with_values([*body[:-1], -0.2]).possible(six_axis(), np.full(10, 0.05))


def test_a_payload_is_told_by_its_mass_where_that_is_certain():
    """Its centre had stood as the size of a payload, though that of any mass may be the flange's."""
    def told(low: float):
        payload = Payload(None, (2.0, 0.0, 0.0, 0.2))
        intervals = np.array([[low, 4.0 - low], [-1e-4, 1e-4], [-1e-4, 1e-4], [0.19, 0.21]])
        centre = {"com_x_m": (0.0, -1e-4, 1e-4)}
        finding = SimpleNamespace(effect=payload, intervals=intervals, derived=centre)
        return _size(finding, None, six_axis())[0]

    assert told(1.9) == "mass" and told(-1.0) == "com x"


def test_centre_of_mass_follows_with_its_uncertainty():
    """The delta method against draws of mass and moments; where the mass is not certain there is no
    centre."""
    spread = np.random.default_rng(8).normal(size=(4, 4)) * 0.02
    payload, covariance = Payload(None, (5.0, 0.5, -0.25, 1.0)), spread @ spread.T
    draws = np.random.default_rng(9).multivariate_normal(payload.values, covariance, 40_000)
    found = payload.derived(covariance)
    assert [name for name, _, _ in found] == ["com_x_m", "com_y_m",
                                              "com_z_m"] and payload.caveat(covariance) == ""
    np.testing.assert_allclose([value for _, value, _ in found], [0.1, -0.05, 0.2])
    np.testing.assert_allclose([sigma for _, _, sigma in found], np.std(draws[:, 1:] / draws[:, :1], axis=0),
                               rtol=0.05)
    vague = np.diag([4.0**2, 0.01, 0.01, 0.01])
    assert payload.derived(vague) == () and "mass" in payload.caveat(vague)


@pytest.mark.parametrize("name", POSES)
def test_pose_effect_derivatives(name, random):
    """Through the whole chain: prediction against its Jacobian, with the effect alone free."""
    robot = six_axis(springs=True)
    data = pose_data(random, robot, covariates={"temperature_degC": random.uniform(20.0, 40.0, ROWS)})
    broken = data.position.copy()
    broken += random.normal(0.0, 1e-4, broken.shape)
    broken[3] += 0.01
    view = predict_poses(robot, Layout.of(()), replace(data, position=broken)).view
    candidates = list(library()[name].candidates(robot, view))
    assert candidates
    for effect in candidates:
        assert "poses" in effect.kinds
        layout = Layout.of((plausible(effect, random),))
        steps = np.array([0.1 * parameter.plausible for parameter in layout.parameters])
        position = lambda x, layout=layout: predict_poses(robot, layout.at(x), data, tangents=False).position
        prediction = predict_poses(robot, layout, data)
        if layout.size:
            assert np.max(np.abs(prediction.position - data.position)) > 1e-7
            assert_derivative(position, layout.values, prediction.jacobian[:, :3], steps, relative=2e-4)


@pytest.mark.parametrize("name", ["link_compliance", "base_compliance"])
def test_bending_slope_by_joint_angles(name, random):
    robot = six_axis()
    data = pose_data(random, robot)
    view = predict_poses(robot, Layout.of((Frames.of(1, robot.base, robot.tool, False),)), data).view
    for effect in library()[name].candidates(robot, view):
        effect = effect.with_values((1e-6,))

        def value(x, effect=effect):
            moved = replace(data, joints={"q": data.joints["q"] + x})
            return effect.change(predict_poses(robot, Layout.of(()), moved, tangents=False).view).value

        assert_derivative(value, np.zeros(AXES), effect.change(view).by_signal["q"], 1e-3)


def test_base_tilts_towards_the_load():
    """A stretched arm pulls its base down on its own side."""
    robot = six_axis(placed=False)
    data = Dataset.of_arrays("poses", {"q": np.array([[0.3, 0.1, 0.2, 0.0, 0.0, 0.0]])},
                             position=np.zeros((1, 3)))
    effect = library()["base_compliance"](None, (1e-5,))
    stiff, soft = (predict_poses(robot, Layout.of(e), data, tangents=False).position[0]
                   for e in ((), (effect,)))
    assert stiff[0] > 0.5
    assert soft[2] < stiff[2] - 1e-4


def test_tracker_scale_is_per_axis(random):
    robot = six_axis()
    data = pose_data(random, robot)
    effect = library()["tracker_scale"](None, (0.0, 0.0, 1e-3))
    moved = predict_poses(robot, Layout.of((effect,)), data, tangents=False).position
    np.testing.assert_allclose(moved, data.position * [1.0, 1.0, 1.001], rtol=1e-12)


def test_outliers_leave_out_broken_rows_only(random):
    robot = six_axis()
    clean = pose_data(random, robot)
    noisy = replace(clean, position=clean.position + random.normal(0.0, 1e-4, (ROWS, 3)))
    view = predict_poses(robot, Layout.of(()), noisy).view
    assert not list(Outliers.candidates(robot, view))
    position = noisy.position.copy()
    position[[4, 17]] += 0.01
    view = predict_poses(robot, Layout.of(()), replace(noisy, position=position)).view
    (effect,) = Outliers.candidates(robot, view)
    assert sorted(np.flatnonzero(~effect.keep(view))) == [4, 17]


def test_drift_follows_temperature_else_time_else_rows(random):
    robot = six_axis()
    data = pose_data(random, robot)
    assert drivers(data) == ["time"]
    assert drivers(replace(data, time=None)) == ["row"]
    warm = replace(data, covariates={"gear_temp_degC": np.arange(40.0), "load_kg": np.arange(40.0)})
    assert drivers(warm) == ["gear_temp_degC"]
    view = predict_poses(robot, Layout.of(()), warm).view
    found = {(effect.form, effect.driver) for effect in ThermalDrift.candidates(robot, view)}
    assert {driver for form, driver in found if form == "zero"} == {"gear_temp_degC", "time"}
    assert {driver for form, driver in found if form != "zero"} == {"gear_temp_degC"}
    part = np.arange(7, 40, 3)
    assert np.array_equal(slow_signal(data.select(part), "time"), slow_signal(data, "time")[part])


def test_every_effect_survives_the_robot_file(random):
    """to_table and back: the same effect, from numbers and words alone."""
    robot = bare(six_axis())
    views = [motion_view(random, robot)]
    data = pose_data(random, robot, covariates={"temperature_degC": random.uniform(20.0, 40.0, ROWS)})
    views.append(predict_poses(robot, Layout.of(()), data).view)
    seen = set()
    for view in views:
        for name in MOTION + POSES:
            if view.kind not in library()[name].kinds:
                continue
            for effect in library()[name].candidates(robot, view):
                effect = plausible(effect, random)
                back = effect_from_table(effect.to_table())
                assert type(back) is type(effect) and back.joint == effect.joint
                assert back.values == pytest.approx(effect.values)
                assert back.label == effect.label and back.describe() == effect.describe()
                seen.add(name)
    assert seen >= set(MOTION + POSES) - {"viscous_friction", "outliers"}


def test_thermal_forms_act_at_their_own_station():
    stations = {form.form: form.station for form in ThermalDrift.__subclasses__()}
    assert stations["growth"] == stations["target"] == Station.GEOMETRY
    assert stations["sensor"] == Station.DEVICE and stations["lubricant"] == Station.DRIVE


def test_one_axis_may_warm_up_alone(random):
    """The fall of one axis is its part of the fall of all."""
    view = motion_view(random)
    candidates = library()["thermal_drift"].candidates(None, view)
    forms = {(effect.form, effect.joint): effect.with_values((0.02,)) for effect in candidates}
    whole, alone = forms["friction", None].change(view), forms["friction_of_axis", 3].change(view)
    assert alone.columns == (2,)
    assert np.array_equal(alone.value[:, 0], whole.value[:, 2]) and np.any(alone.value)


def test_a_clock_that_starts_anew_with_each_run_goes_on_in_its_file():
    """Two runs of a minute, each from zero; the second alone, as held-out rows are, has the same time."""
    run, time = np.repeat([1, 2], 600), np.tile(0.1 * np.arange(600.0), 2)
    q = np.zeros((1200, AXES))
    data = Dataset.of_arrays("motion", {"q": q}, time=time, run=run, row=1 + np.arange(1200))
    assert slow_signal(data, "time") * 3600.0 == pytest.approx(0.1 * np.arange(1200.0))
    second = data.select(run == 2)
    assert slow_signal(second, "time") * 3600.0 == pytest.approx(0.1 * np.arange(600.0, 1200.0))
    assert slow_signal(second.select(np.arange(0, 600, 3)), "time")[0] * 3600.0 == pytest.approx(60.0)


def test_a_clock_that_goes_on_is_taken_as_it_is():
    """With a pause of a day between two runs."""
    run, time = np.repeat([1, 2], 600), np.concatenate([np.arange(600.0), 86400.0 + np.arange(600.0)])
    data = Dataset.of_arrays("motion", {"q": np.zeros((1200, AXES))}, time=time, run=run)
    assert np.array_equal(slow_signal(data, "time") * 3600.0, time / 3600.0 * 3600.0)
