"""An axis that leans as it turns: its derivatives, exact rigid motions of an independent plant,
found where it is hidden, and not elsewhere."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.effects.axis_wobble import AxisWobble
from exactarm.effects.frames import Frames
from exactarm.identify.declared import geometry_layout
from exactarm.robot.robot import Placement
from six_axis import six_axis
from test_guide_error import angles, placed, poses, predicted

NOISE_M = 3e-5


def wobbled(robot, q: np.ndarray, effect: AxisWobble) -> np.ndarray:
    """(N, 3) targets of an arm whose axis leans, by exact rotations."""
    origins, rotations = _core.frame_poses(replace(robot, base=Placement(), tool=Placement()).core, q)
    waves, index = effect.values[0], effect.index
    complex_turn = np.exp(1j * waves * robot.joints[index].sign * q[:, index])
    tilt = complex(*effect.values[1:]) * complex_turn
    centre, turn = origins[:, index], np.einsum(
        "nij,nj->ni", rotations[:, index], np.stack([tilt.real, tilt.imag, np.zeros(len(tilt))], axis=1))
    target = origins[:, -1] + rotations[:, -1] @ robot.tool.position
    moved = centre + Rotation.from_rotvec(turn).apply(target - centre)
    return moved @ robot.base.rotation.T + robot.base.position


@pytest.mark.parametrize("joint, waves", [(1, 2.0), (3, -1.0), (5, 3.0)])
def test_the_arm_behind_moves_as_a_rigid_body(joint, waves):
    """Any seed of the angles: 0 to 7 were tried."""
    robot = placed(six_axis())
    effect = AxisWobble(joint, (waves, 2e-4, -1e-4))
    q = angles(robot, 40, 2)
    moved = wobbled(robot, q, effect)
    assert np.linalg.norm(moved - predicted(robot, q), axis=1).max() > 2e-5
    np.testing.assert_allclose(predicted(robot, q, effect), moved, atol=3.0 * (3e-4) ** 2)


@pytest.mark.parametrize("joint, waves", [(1, -2.0), (2, -1.0), (4, 3.0)])
def test_derivatives_by_all_parameters_of_the_arm(joint, waves):
    """Any seed of the angles: 0 to 7 were tried."""
    robot, effect = placed(six_axis()), AxisWobble(joint, (waves, 2e-5, -1e-5))
    q = angles(robot, 12, 3)
    declared = Layout.of((Frames.of(1, robot.base, robot.tool, False),)).joined(geometry_layout(robot))
    layout = declared.joined(Layout.of((effect,)))
    memory = cache(lambda values: predict_poses(robot, layout.at(np.array(values)), poses(q), tangents=False))
    found = predict_poses(robot, layout, poses(q))
    steps = [1e-2 * min(p.plausible, 1e-2) for p in layout.parameters]
    # that the frame which the joint stands on turns the wobble, too, is of second order
    assert_derivative(lambda x: memory(tuple(x)).position, layout.values, found.jacobian[:, :3], steps,
                      relative=1e-4)


def test_a_file_gives_it_back():
    effect = AxisWobble(2, (-1.0, 2e-4, -1e-4))
    assert effect_from_table(effect.to_table()) == effect
    assert "axis 2 wobbles" in effect.describe() and "0.224 mrad" in effect.describe()


# Seeds 0 to 7, the first eight of the generator.
SEEDS = range(8)
# The noise that seed 5 gives the held-out rows is 54.6 um RMS, beside 48.1 um of the others: four of them err
# farther than all fitted ones, which chance makes of one set in a hundred.
NOISY_ELSEWHERE = (5,)


def hidden(seed: int, rows: int = 120):
    """An arm of six axes, one of which wobbles, with gears and springs that are as they should be."""
    random = np.random.default_rng(seed)
    robot = placed(six_axis(), seed)
    joint, waves = int(random.integers(1, 5)), float(random.choice([-2.0, -1.0, 2.0, 3.0]))
    phase = random.uniform(-np.pi, np.pi, 2)[0]  # the noise drawn after two
    effect = AxisWobble(joint, (waves, 3e-4 * np.cos(phase), 3e-4 * np.sin(phase)))
    q = angles(robot, rows, seed + 100)
    error = random.normal(size=(rows, 3)) * NOISE_M
    return robot, effect, q, error


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_it_is_found_where_it_is_hidden(seed):
    robot, effect, q, error = hidden(seed)
    found = diagnose(robot, poses(q, wobbled(robot, q, effect) + error))
    assert [(one.effect.name, one.effect.joint, one.effect.values[0]) for one in found.findings] == [
        ("axis_wobble", effect.joint, effect.values[0])]
    one, = found.findings
    assert one.probability > 0.95
    assert found.verdict == ("unexplained" if seed in NOISY_ELSEWHERE else "explained")
    low, high = one.intervals[1:3].T
    inside = (low < effect.values[1:3]) & (np.array(effect.values[1:3]) < high)
    assert inside.any() and found.after["validation"].rms < 1.2 * np.sqrt(3.0) * NOISE_M
