"""What bends under a weight by more than one number: a base that gives way more about one direction than
about another, and a tool that bends under its own weight. Derivatives, robot files, found where hidden."""

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
from exactarm.effects.frames import Frames
from exactarm.effects.joint_offset import JointOffset
from exactarm.robot.robot import Placement
from six_axis import six_axis
from test_guide_error import angles, placed, poses

UNEVEN = {"effect": "base_compliance", "rad_per_Nm": 3e-6, "differs_rad_per_Nm": 1e-6,
          "skew_rad_per_Nm": -5e-7}
SAG = {"effect": "tool_sag", "sag_xx_m": 1e-5, "sag_yy_m": 2e-5, "sag_xy_m": -1e-5, "sag_xz_m": 3e-5,
       "sag_yz_m": 2e-6}
TURNING_SAG = SAG | {"turn_x_rad": 1e-5, "turn_y_rad": -2e-5, "turn_z_rad": 3e-5}
TABLES = pytest.mark.parametrize("table", [UNEVEN, SAG, TURNING_SAG], ids=["base", "tool", "tool turns"])
NOISE_M = 3e-5


@TABLES
def test_derivatives_by_own_sizes_and_by_the_arm(table):
    """Any seed of the angles: 0 to 7 were tried."""
    robot, effect = placed(six_axis()), effect_from_table(table)
    q = angles(robot, 12, 3)
    offsets = [JointOffset.of(robot, k) for k in range(robot.axes)]
    layout = Layout.of((Frames.of(1, robot.base, robot.tool, True), *offsets, effect))
    memory = cache(lambda values: predict_poses(robot, layout.at(np.array(values)), poses(q), tangents=False))
    at = lambda x: memory(tuple(x))
    found = predict_poses(robot, layout, poses(q))
    steps = [1e-2 * min(p.plausible, 1e-2) for p in layout.parameters]
    # that frames and joints before it turn the bending, too, is of second order
    close = np.array([1e-7 if table["effect"] in name else 5e-3 for name in layout.names])
    assert_derivative(lambda x: at(x).position, layout.values, found.jacobian[:, :3], steps, relative=close)
    away = lambda x: np.einsum("nij,nkj->nik", at(x).rotation, found.rotation)[:, [2, 0, 1], [1, 2, 0]]
    assert_derivative(away, layout.values, found.jacobian[:, 3:], steps, relative=close + 1e-3)  # two turns


@TABLES
def test_a_robot_file_gives_it_back(table):
    effect = effect_from_table(table)
    assert effect.to_table() == table and effect_from_table(effect.to_table()) == effect


def test_even_and_uneven_bases_are_one_cause():
    uneven = effect_from_table(UNEVEN)
    even = effect_from_table({"effect": "base_compliance", "rad_per_Nm": 3e-6})
    assert uneven.includes(even) and not even.includes(uneven) and even.label == uneven.label
    richer, = even.richer()
    assert richer.values == (3e-6, 0.0, 0.0) and not tuple(uneven.richer())


def test_a_base_gives_way_to_every_moment():
    robot, exact = six_axis(), np.zeros(3)
    for differs, skew, possible in ((2e-6, 1e-6, True), (3e-6, 1e-6, False)):
        effect = effect_from_table(UNEVEN | {"differs_rad_per_Nm": differs, "skew_rad_per_Nm": skew})
        assert effect.possible(robot, exact) == possible
    assert effect.possible(robot, np.full(3, 1e-7))  # as far as the data tell


def bent(robot, q: np.ndarray, tilt_per_Nm: np.ndarray, sag_m: np.ndarray) -> np.ndarray:
    """(N, 3) targets of an arm whose base turns by tilt_per_Nm (2, 2) of the overturning moment and whose
    tool hangs lower by sag_m (3, 3), in the frame of the flange, by exact rotations. It stands upright."""
    origins, rotations = _core.frame_poses(replace(robot, base=Placement(), tool=Placement()).core, q)
    gravity = np.asarray(robot.gravity)
    moment = np.zeros((len(q), 3))
    for j, link in enumerate(robot.links):
        centre = origins[:, j + 1] + rotations[:, j + 1] @ link.centre_of_mass
        moment += np.cross(centre - origins[:, 0], link.mass * gravity)
    tilt = np.pad(moment[:, :2] @ tilt_per_Nm.T, ((0, 0), (0, 1)))
    down = gravity / np.linalg.norm(gravity)
    flange = rotations[:, -1]
    hangs = np.einsum("nij,jk,nlk,l->ni", flange, sag_m, flange, down)
    target = origins[:, -1] + flange @ robot.tool.position + hangs
    turned = origins[:, 0] + Rotation.from_rotvec(tilt).apply(target - origins[:, 0])
    return turned @ robot.base.rotation.T + robot.base.position


# Seeds 0 to 7, the first eight of the generator.
SEEDS = range(8)


def hidden(seed: int, rows: int = 120):
    random = np.random.default_rng(seed)
    robot = placed(six_axis(), seed)
    q = angles(robot, rows, seed + 100)
    turn = random.uniform(-np.pi, np.pi)
    across = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    soft = across @ np.diag([6e-6, 2e-6]) @ across.T
    bar = random.normal(size=3)
    bar /= np.linalg.norm(bar)
    cantilever = 2e-4 * (np.eye(3) - np.outer(bar, bar))  # it gives way across itself
    return robot, q, soft, cantilever, random.normal(size=(rows, 3)) * NOISE_M


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_an_uneven_base_is_found(seed):
    robot, q, soft, _, error = hidden(seed)
    found = diagnose(robot, poses(q, bent(robot, q, soft, np.zeros((3, 3))) + error))
    effect, = (one.effect for one in found.findings)
    assert effect.name == "base_compliance" and len(effect.values) == 3 and found.verdict == "explained"


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_a_sagging_tool_is_found(seed):
    robot, q, _, cantilever, error = hidden(seed)
    found = diagnose(robot, poses(q, bent(robot, q, np.zeros((2, 2)), cantilever) + error))
    assert [one.effect.name for one in found.findings] == ["tool_sag"] and found.verdict == "explained"
