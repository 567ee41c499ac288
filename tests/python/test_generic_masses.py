"""Generic masses: the law has the shape of real arms' gravity, and is never taken for a declaration."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain import Layout, predict_tracked_motion
from exactarm.data.dataset import Dataset
from exactarm.effects.gravity_compensator import GravityCompensator
from exactarm.effects.joint_compliance import RelativeCompliance
from exactarm.errors import InputError
from exactarm.rest_load import RestLoad
from exactarm.robot.generic_masses import (
    DISTRIBUTION,
    MOVING_SHARE,
    SPREAD,
    SPREAD_BY_MASS,
    SPREAD_OF_SHAPE,
    generic_links,
    spread_of_load,
    with_declared_masses,
    with_generic_masses,
    with_unknown_load,
)
from exactarm.robot.robot import Joint, Robot
from exactarm.robot.urdf import urdf_text
from exactarm.robot_file import load_robot, write_robot
from motions import fourier_motion
from three_arms import puma, three_arms

ALONE, WITH_TIP = 0.15, 0.09  # RMS of what the shape leaves of the gravity of axes 2 and 3, of the whole
ROWS = 300


def bare(robot):
    return replace(robot, links=None)


def left(torque, *columns):
    """RMS of what a combination of the columns leaves, of the whole."""
    found = np.stack(columns, axis=1)
    rest = torque - found @ np.linalg.lstsq(found, torque, rcond=None)[0]
    return np.sqrt(np.sum(rest**2) / np.sum(torque**2))


@pytest.mark.parametrize("robot", three_arms(), ids=lambda robot: robot.name)
def test_the_law_has_the_shape_of_the_gravity_of_real_arms(robot):
    q = np.random.default_rng(0).uniform(-2.5, 2.5, (ROWS, robot.axes))
    real = _core.gravity_torque(robot.core, q, 1)
    guessed = with_generic_masses(bare(robot))
    parts = RestLoad.of(guessed, Dataset.of_arrays("poses", {"q": q})).parts(q)
    for axis in (1, 2):
        own, tip = parts["own"][0][:, axis], parts["tip"][0][:, axis]
        assert left(real[:, axis], own) < ALONE
        assert left(real[:, axis], own, tip) < WITH_TIP


def test_first_moments_make_up_for_what_is_left_within_their_prior():
    """Gravity of axes 2 and 3: the smallest moments that bring it from the law to the real arm's, in units of
    the law's own; many combinations of them show nothing, and are not counted."""
    squares = []
    for robot in three_arms():
        q = np.random.default_rng(0).uniform(-2.5, 2.5, (ROWS, robot.axes))
        real = _core.gravity_torque(robot.core, q, 1)
        load = RestLoad.of(with_generic_masses(bare(robot)), Dataset.of_arrays("poses", {"q": q}))
        parts = load.parts(q)
        for axis in (1, 2):
            law = np.stack([parts[name][0][:, axis] for name in ("own", "tip")], axis=1)
            moments = load.moments(q, axis)
            basis = np.linalg.qr(law)[0]
            beside = lambda values, basis=basis: values - basis @ (basis.T @ values)
            shares = np.linalg.pinv(beside(moments), rcond=1e-6) @ beside(real[:, axis])
            scale = np.linalg.lstsq(law, real[:, axis] - moments @ shares, rcond=None)[0][0]
            rank = np.linalg.matrix_rank(beside(moments), tol=1e-6 * np.linalg.norm(moments, 2))
            squares.append(shares @ shares / rank / scale**2)
            assert left(real[:, axis], *law.T, moments @ shares) < 0.003
    assert np.sqrt(np.mean(squares)) == pytest.approx(DISTRIBUTION, rel=0.1)


def test_the_total_is_that_of_the_robot_file_or_within_a_factor_of_three_of_real_arms():
    for robot in three_arms():
        declared = sum(link.mass for link in robot.links)
        assert 1.0 / 3.0 < sum(link.mass for link in generic_links(bare(robot))) / declared < 3.0
        # of a whole arm: its base stands still
        known = replace(bare(robot), mass=40.0)
        assert sum(link.mass for link in generic_links(known)) == pytest.approx(40.0 * MOVING_SHARE)
        assert sum(link.mass for link in generic_links(known, 28.0)) == pytest.approx(28.0)


def test_declared_masses_stay_and_generic_ones_are_taken_back():
    robot = puma()
    assert with_generic_masses(robot) is robot and with_declared_masses(robot) is robot
    guessed = with_generic_masses(bare(robot))
    assert guessed.generic_masses and with_declared_masses(guessed) == bare(robot)


def test_an_arm_without_lengths_gets_none():
    turntable = Robot("turntable", (Joint(),))
    assert generic_links(turntable) is None and with_generic_masses(turntable) is turntable
    assert generic_links(replace(puma(), has_geometry=False)) is None


def test_a_sliding_axis_counts_no_length_of_its_own():
    linear = Joint(type="prismatic", alpha=-np.pi / 2, q_min=0.0, q_max=5.0)
    arm = bare(puma())
    with_track = replace(arm, joints=(linear, *arm.joints))
    masses = lambda robot: np.array([link.mass for link in generic_links(robot)])[-6:]
    np.testing.assert_allclose(masses(with_track) / masses(with_track).sum(), masses(arm) / masses(arm).sum())


def test_the_robot_file_keeps_mass_and_the_mark_of_generic_links(tmp_path):
    robot = with_generic_masses(replace(bare(puma()), mass=31.5))
    write_robot(tmp_path / "robot.toml", robot)
    read = load_robot(tmp_path / "robot.toml")
    assert read == replace(robot, file=read.file) and read.generic_masses and read.mass == 31.5
    assert "no declaration" in (tmp_path / "robot.toml").read_text()


@pytest.mark.parametrize("line, says", [
    ("mass_kg = 0.0", "key mass_kg: 0; expected a number above 0"),
    ("generic_masses = true", "true without"),
    ("generic_masses = 1", "expected true or false"),
])
def test_wrong_keys_are_refused_by_name(tmp_path, line, says):
    (tmp_path / "robot.toml").write_text(f'name = "a"\n{line}\n[[joints]]\na_m = 1.0\n')
    with pytest.raises(InputError, match=says):
        load_robot(tmp_path / "robot.toml")


def test_other_programs_and_torques_never_see_generic_masses():
    guessed = with_generic_masses(bare(puma()))
    assert urdf_text(guessed) == urdf_text(bare(puma()))
    with pytest.raises(InputError, match="no link masses"):
        guessed.inverse_dynamics(np.zeros(6))


def test_no_spring_is_said_to_take_load_off_that_nobody_knows():
    robot = load_robot("ur10")
    time, angle, *_ = fourier_motion(robot, 3.0, 50.0, 1)
    data = Dataset.of_arrays("tracked_motion", {"q": angle}, time=time, position=np.zeros((time.size, 3)))
    view = lambda of: predict_tracked_motion(of, Layout.of(()), data, tangents=False).view
    guessed = with_generic_masses(bare(robot))
    assert not tuple(GravityCompensator.candidates(guessed, view(guessed)))
    assert len(tuple(GravityCompensator.candidates(robot, view(robot)))) == 4 * robot.axes


def test_the_size_of_a_load_is_as_unknown_as_arms_differ():
    """Masses of three arms beside those of the law, which takes 9 kg/m^3 for all of them."""
    mass = lambda links: sum(link.mass for link in links)
    beside = [mass(robot.links) / mass(generic_links(bare(robot))) for robot in three_arms()]
    assert np.std(np.log(beside), ddof=1) == pytest.approx(SPREAD, abs=0.05)
    low, high = with_unknown_load(SPREAD, 2e-6, 1.9e-6, 2.1e-6)
    assert low == pytest.approx(2e-6 * np.exp(-1.96 * SPREAD), rel=0.01)
    assert low * high == pytest.approx(4e-12, rel=0.01)
    cubed = with_unknown_load(SPREAD, -2e-9, -2.1e-9, -1.9e-9, 3)
    assert cubed[0] / -2e-9 == pytest.approx(np.exp(3 * 1.96 * SPREAD), rel=0.01)
    assert with_unknown_load(SPREAD_OF_SHAPE, -2e-6, -2.2e-6, -1.8e-6)[1] == pytest.approx(-1.46e-6, rel=0.02)
    assert (with_unknown_load(SPREAD_OF_SHAPE, 0.0, -1e-6, 2e-6)
            == pytest.approx((-1.342e-6, 2.684e-6), rel=1e-3))


def test_the_mass_of_an_arm_tells_a_load_no_better_than_arms_of_one_mass_differ():
    """Moments of axes 2 and 3 beside those of the law with the mass of the real links: 15 % were said, which
    is what its shape leaves of a load whose size is fitted. The base is another fifth. Any seed."""
    sizes = []
    for robot in three_arms():
        q = np.random.default_rng(0).uniform(-2.5, 2.5, (ROWS, robot.axes))
        links = generic_links(bare(robot), sum(link.mass for link in robot.links))
        real, law = (_core.gravity_torque(each.core, q, 1) for each in (robot, replace(robot, links=links)))
        sizes += [real[:, axis] @ law[:, axis] / (law[:, axis] @ law[:, axis]) for axis in (1, 2)]
    assert np.hypot(np.std(np.log(sizes), ddof=1), 0.2) == pytest.approx(SPREAD_BY_MASS, abs=0.02)
    arm = bare(puma())
    assert spread_of_load(arm, False) == SPREAD
    assert spread_of_load(replace(arm, mass=55.0), False) == SPREAD_BY_MASS
    assert spread_of_load(arm, True) == SPREAD_OF_SHAPE


@pytest.mark.parametrize("values, can_be", [
    ((1e-5, 1e-5, 0.0, 0.0), True),
    ((0.0, 0.0, 0.0, 0.0), True),
    ((0.0, 1e-5, 0.0, 0.0), False),
])
def test_no_arm_bends_under_a_share_of_its_weight_and_not_under_all_of_it(values, can_be):
    """A spring at zero with its share at the flange was certain beside a base that gives way."""
    spring = RelativeCompliance.none_of(load_robot("ur10"), 1).with_values(values)
    assert spring.possible(load_robot("ur10"), np.zeros(4)) == can_be
