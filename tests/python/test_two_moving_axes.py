"""A seven-axis arm of which two axes move over a grid, and the others stand: its sag is named, with its size,
and nothing is suspected."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.diagnose.problems import problem_for
from exactarm.effects.joint_compliance import RelativeCompliance
from exactarm.first_aid.first_aid import first_aid
from exactarm.identify.calibrate import calibrate
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot_file import load_robot

SAG, NOISE_M = 80e-6, 2e-4  # rad/Nm of axis 2
ARM = replace(load_robot("panda"), links=None)


def grid(torque_sign=None, bend=0.0, seed=2):
    """Axis 2 sags under the weight of links 1.5 times as heavy as the generic law has them; bend: the share
    of that which it does not at its largest load, as a gear that stiffens has it."""
    rng = np.random.default_rng(seed)
    q = np.zeros((72, 7))
    q[:, 0] = np.repeat(np.linspace(-2.6, 2.6, 9), 8)
    q[:, 1] = np.tile(np.linspace(-1.5, 1.5, 8), 9)
    q[:, 2:] = rng.normal(0.0, 5e-5, (72, 5))
    load = 1.5 * _core.gravity_torque(with_generic_masses(ARM).core, q, 1)
    bent = q.copy()
    bent[:, 1] -= SAG * load[:, 1] * (1.0 - bend * (load[:, 1] / np.abs(load[:, 1]).max()) ** 2)
    measured = ARM.fk(bent).position + rng.normal(0.0, NOISE_M, (72, 3))
    torques = {} if torque_sign is None else {"tau": torque_sign * load + rng.normal(0.0, 0.05, load.shape)}
    return Dataset.of_arrays("poses", {"q": q} | torques, position=measured)


def compliance(result):
    found = {(effect["effect"], effect["joint"]): effect for effect in result["effects"]}
    assert list(found) == [("joint_compliance", 2)]
    return {name: value["value"] if isinstance(value, dict) else value
            for name, value in found["joint_compliance", 2]["parameters"].items()}


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_no_scale_is_suspected(noise):
    """Where axes 3 to 7 stand the tool takes up any size of the arm, and the error shrinks with it."""
    data = grid()
    far = data.position + np.random.default_rng(1).normal(0.0, noise, data.position.shape)
    assert first_aid(ARM, replace(data, position=far)) == ()


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["of the drive", "of the load"])
def test_the_sag_has_its_size_by_the_measured_torque_of_either_sign(sign):
    result = ea.diagnose(ARM, grid(sign), threads=1)
    assert compliance(result)["linear_rad_per_Nm"] == pytest.approx(SAG, rel=0.1)
    assert any("opposite sign" in line for line in result.warnings) == (sign < 0.0)


def test_the_weight_at_the_flange_is_drawn_to_a_share_of_the_arm_s():
    """Of axis 2 alone its torque and that of the links are one: freely, the two sizes cancel each other."""
    nothing = RelativeCompliance.none_of(ARM, 1, own_free=True)
    assert np.isinf([p.prior for p in nothing.parameters()]).all()
    about = [p.prior for p in nothing.with_values((4e-5, 1e-4, 0.0, 0.0)).parameters()]
    np.testing.assert_allclose(about, [np.inf, 12e-5, 4e-5, np.inf])


@pytest.mark.slow
@pytest.mark.parametrize("torque", [None, 1.0], ids=["guessed", "measured"])
@pytest.mark.parametrize("seed", [3, 4])
def test_a_spring_that_stiffens_is_no_run_out(seed, torque):
    """A quarter less at the largest load. With a bend as small as those of large arms have it, and none under
    a guessed load, a run-out of 5 mrad was named in two of these four, with 0.60 and 0.73. Seeds
    2 to 9 all hold."""
    result = ea.diagnose(ARM, grid(torque, 0.25, seed), threads=1)
    bent = compliance(result)
    assert result["verdict"] == "explained" and bent["cubic_rad_per_Nm3"] < 0.0 < bent["linear_rad_per_Nm"]


def test_where_links_are_guessed_a_spring_is_no_softer_than_the_data_ask_for():
    """Ten times as soft, under a load that the flange takes nearly away, it did the same: 2.4 mrad/Nm were
    told of an arm of 0.2."""
    about = RelativeCompliance.none_of(ARM, 1).drawn_wider(30.0)
    assert [p.prior for p in about.parameters()] == pytest.approx([150e-6, 450e-6, 150e-6, np.inf])


def test_the_angle_of_an_axis_that_stands_is_no_signal():
    data = grid()
    problem = problem_for(with_generic_masses(ARM), data, data, 1, 0)
    fitted = problem.fit(problem.declared())
    names = {str(name) for name in problem.signals(fitted)}
    assert {"angle of axis 1", "angle of axis 2", "load of axis 4"} <= names
    assert not names & {f"angle of axis {axis}" for axis in range(3, 8)}
    (surface,) = problem.surfaces(fitted).values()
    assert surface.shape[1] == 6  # a constant, two angles, their squares and product


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4, 6])
def test_a_calibration_keeps_the_spring_that_moves_the_tool_most(seed):
    """From one side of a stretched arm torques of axes 2, 4 and 6 are one shape. Asked beside lengths that
    the noise hides, no spring was sure and all went: 0.45 to 0.62 mm were left in place of 0.30 to 0.41.
    Of seeds 2 to 13 all keep axis 2 alone, within 2.2 standard deviations; 2, 9 and 10 leave it a little less
    sure than is asked here (three of them are 40 to 46 urad/Nm)."""
    data = grid(1.0, seed=seed)
    result = calibrate(ARM, data.select(np.flatnonzero(data.joints["q"][:, 1] > 0.0)))
    springs = {name: (value, sd) for name, value, sd in zip(
        result.fit.layout.names, result.fit.fit.x, np.sqrt(np.diag(result.fit.fit.covariance)))
        if name.startswith("joint_compliance")}
    ((name, (value, sd)),) = springs.items()
    assert name == "joint_compliance_2.linear_rad_per_Nm" and abs(value - SAG) < 3.0 * sd < 0.5 * SAG
