"""Springs beside a drive by their own geometry: cylinders of any free length, bundles of hoses."""

import numpy as np
import pytest

from exactarm import _core
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import EXPLAINED
from exactarm.effects import effect_from_table
from exactarm.effects.gravity_compensator import GravityCompensator, Spring
from motions import fourier_motion, motion_data
from rigid_arm import LINKS_ALONE, rigid

AXIS, CRANK_M, HINGE_M, DEAD_CENTRE_RAD = 2, 0.12, 0.6, -1.3


def cylinder(angle, free_m, stiffness=8e3):
    """(N,) Nm that the drive gives against a spring from the crank's end to its hinge: dE/dq of E = k/2
    (length - free length)^2, by differences of the length, which no formula of the library has."""
    length = lambda q: np.hypot(CRANK_M * np.cos(q - DEAD_CENTRE_RAD) - HINGE_M,
                                CRANK_M * np.sin(q - DEAD_CENTRE_RAD))
    energy = lambda q: 0.5 * stiffness * (length(q) - free_m) ** 2
    step = 1e-5
    return (energy(angle + step) - energy(angle - step)) / (2.0 * step)


def hoses(angle):
    return 12.0 * (angle - 0.5) + 16.0 * (angle - 0.5) ** 3


def found_in(axis, torque, seed):
    """The diagnosis of 12 s at 100 Hz with friction, noise of 0.5 Nm, and a torque by the angle of one axis,
    which the arm passes anew with every seed; the angles (N,) of that axis."""
    robot = rigid(**LINKS_ALONE)
    time, angle, rate, acceleration = fourier_motion(robot, 12.0, 100.0, seed=seed, amplitude=0.8)
    every = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    every += 5.0 * np.tanh(rate / 0.02)
    q = angle[:, axis - 1] + robot.offsets[axis - 1]
    every[:, axis - 1] += torque(q)
    every += np.random.default_rng(seed).normal(0.0, 0.5, every.shape)
    return diagnose(robot, motion_data(robot, time, angle, every)), q


def taken_off(effect, q):
    """(N,) Nm that an effect takes off the load at these angles."""
    view = type("View", (), {"q": np.tile(q[:, None], effect.joint), "rows": q.size, "axes": effect.joint})
    return -effect.change(view).value[:, 0]


@pytest.mark.slow
@pytest.mark.parametrize("free_m, seed", [(0.15, 0), (0.15, 6), (0.45, 1)])
def test_a_cylinder_with_a_free_length(free_m, seed):
    """Before, the sine of the angle alone was known: beside it stood run-outs and frictions, or nothing did.
    Of 0.15 and 0.45 m with seeds 0 to 7 all 16 are found like this, the torque within 0.17 Nm; the interval
    of the dead centre misses in two, that of the hinge in none. Seeds 0 and 6: with a bound in place of the
    prior the hinge ended there, and the spring was refused; 1 tells the hinge best."""
    result, q = found_in(AXIS, lambda q: cylinder(q, free_m), seed)
    (finding,) = result.findings
    effect, (low, high) = finding.effect, finding.intervals[5]
    assert result.verdict == EXPLAINED and effect.label == "gravity_compensator_2"
    assert effect.form == Spring.HINGED and low < DEAD_CENTRE_RAD < high and high - low < 0.15
    low, high = 1.0 + 2.0 * np.exp(finding.intervals[6])
    assert low < HINGE_M / CRANK_M < high
    assert np.abs(taken_off(effect, q) + cylinder(q, free_m)).max() < 0.5  # the noise of one reading


@pytest.mark.slow
def test_a_bundle_of_hoses_stiffens():
    """Any seed: of 0 to 7 all are found, within 0.14 Nm."""
    result, q = found_in(3, hoses, 0)
    (finding,) = result.findings
    assert result.verdict == EXPLAINED and finding.effect.label == "gravity_compensator_3"
    assert finding.effect.form == Spring.STIFFENING
    assert np.abs(taken_off(finding.effect, q) + hoses(q)).max() < 0.5


@pytest.mark.parametrize("form, more", [(Spring.TORSION, ()), (Spring.STIFFENING, (3.0, -2.0)),
                                        (Spring.CRANK, ()), (Spring.HINGED, (40.0, 0.3, -0.5))])
def test_every_form_comes_back_from_a_file(form, more):
    plain = (20.0, 3.0, 0.0, 0.0) if form in (Spring.TORSION, Spring.STIFFENING) else (0.0, 0.0, 30.0, -9.0)
    effect = GravityCompensator(2, (*plain, *more), form)
    assert effect_from_table(effect.to_table()) == effect
    assert effect.describe().startswith("a spring takes load off axis 2: ")
