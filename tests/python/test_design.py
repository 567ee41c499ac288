"""Design of measurement poses: criteria, exchange, polish, limits, and the marks of observability."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.design.criterion import LogDeterminant, SmallestOverLargest, information_of
from exactarm.design.design import DesignOptions, design_poses, short_way, spread_poses
from exactarm.design.exchange import ExchangeOptions, exchange
from exactarm.design.polish import PolishOptions, polish
from exactarm.design.pose_space import Box, PoseSpace
from exactarm.errors import ComputationError, InputError
from exactarm.files.examples import data_path
from exactarm.identify.observability import observability
from exactarm.robot.robot import Joint, Placement, Robot
from exactarm.robot_file import load_robot
from identification_poses import RIGHT, TOOL, racer_like, robot_of

CRITERIA = (LogDeterminant(), LogDeterminant(nuisance=(0, 2, 5)), SmallestOverLargest())


def random_blocks(count, seed, parameters=8, rows=3):
    return np.random.default_rng(seed).normal(size=(count, rows, parameters))


@pytest.mark.parametrize("criterion", CRITERIA)
def test_changes_are_differences_of_values(criterion):
    blocks, others = random_blocks(12, 1), random_blocks(6, 2)
    information = information_of(blocks)

    def value(*sets):
        return criterion.value(information_of(np.concatenate(sets)))

    now = value(blocks)
    np.testing.assert_allclose(
        criterion.gains(information, others), [value(blocks, b[None]) - now for b in others], rtol=1e-9,
        atol=1e-12
    )
    np.testing.assert_allclose(
        criterion.losses(information, blocks),
        [value(np.delete(blocks, k, axis=0)) - now for k in range(12)], rtol=1e-9, atol=1e-12,
    )
    swapped = [value(np.delete(blocks, k, axis=0), others[[k]]) - now for k in range(6)]
    np.testing.assert_allclose(criterion.swaps(information, blocks[:6], others), swapped, rtol=1e-9,
                               atol=1e-12)


def test_criteria_are_the_indices_of_the_source():
    blocks = random_blocks(20, 3)
    indices = observability(np.linalg.svd(blocks.reshape(-1, 8), compute_uv=False), 20)
    information = information_of(blocks)
    assert indices.O1 == pytest.approx(np.exp(LogDeterminant().value(information) / 16) / np.sqrt(20))
    assert indices.O4 == pytest.approx(np.exp(SmallestOverLargest().value(information)))


def test_nuisance_criterion_is_the_determinant_of_the_schur_complement():
    information = information_of(random_blocks(10, 4))
    nuisance, rest = [0, 2, 5], [1, 3, 4, 6, 7]
    schur = information[np.ix_(rest, rest)] - information[np.ix_(rest, nuisance)] @ np.linalg.solve(
        information[np.ix_(nuisance, nuisance)], information[np.ix_(nuisance, rest)]
    )
    assert LogDeterminant(nuisance=(0, 2, 5)).value(information) == pytest.approx(np.linalg.slogdet(schur)[1])


def test_observability_of_known_singular_values():
    indices = observability(np.array([4.0, 2.0, 1.0]), 4)
    assert (indices.O1, indices.O2, indices.O3, indices.O4) == (pytest.approx(1.0), 0.25, 1.0, 0.25)
    assert indices.O5 == pytest.approx(1.0 / 1.75)
    assert observability(np.array([1.0, 0.0]), 4).O1 == 0.0


def test_exchange_finds_the_best_subset_of_a_small_pool():
    """Orthogonal rows of known size: the best set is the four largest of each direction."""
    size = np.concatenate([np.linspace(1.0, 2.0, 12)] * 2)
    pool = np.zeros((24, 1, 2))
    pool[np.arange(24), 0, np.repeat([0, 1], 12)] = size
    start = np.array([0, 1, 2, 3, 12, 13, 14, 15])
    options = ExchangeOptions(candidates=24, add=LogDeterminant())
    # With a prior, even an empty one, any gain admits: the rule of O1 per experiment stops a little earlier.
    found = exchange(pool, start, np.random.default_rng(0), options, prior=np.zeros((2, 2)))
    assert sorted(found.chosen) == [8, 9, 10, 11, 20, 21, 22, 23]


def test_exchange_never_returns_less_than_its_start_and_no_experiment_twice():
    pool = random_blocks(300, 5)
    start = np.arange(10)
    found = exchange(pool, start, np.random.default_rng(1))
    assert found.value > LogDeterminant().value(information_of(pool[start]))
    assert len(set(found.chosen)) == 10 and np.all(np.diff(found.history) >= 0.0)
    assert found.value == pytest.approx(LogDeterminant().value(information_of(pool[found.chosen])))


def test_exchange_separates_with_prior_information():
    """The wanted column shows only in a few experiments; with everything else known they are all that
    counts."""
    pool = random_blocks(200, 6)
    pool[:, :, 7] *= 0.01
    telling = np.array([20, 70, 120, 170])
    pool[telling, :, 7] *= 1000.0
    separate = LogDeterminant(nuisance=tuple(range(7)))
    options = ExchangeOptions(candidates=200, keep=separate, add=separate)
    found = exchange(pool, np.arange(4), np.random.default_rng(0), options, prior=1e4 * np.eye(8))
    assert sorted(found.chosen) == telling.tolist()


def test_exchange_refuses_a_singular_start():
    """Two of eight eigenvalues are zero, and lie on either side of zero by rounding: half of such
    determinants are positive."""
    for start in range(20):
        with pytest.raises(ComputationError, match="cannot identify 8 parameters"):
            exchange(random_blocks(50, 7), np.array([start, start + 1]), np.random.default_rng(0))


def test_polish_raises_the_criterion_and_guards_the_other():
    def blocks_at(x):
        return np.stack([np.ones_like(x), x, x**2], axis=-1), np.abs(x[:, 0]) <= 1.0

    start = np.linspace(-0.3, 0.3, 6)[:, None]
    keep, guard = LogDeterminant(), SmallestOverLargest()
    moved = polish(start, np.array([-2.0]), np.array([2.0]), blocks_at, keep, guard, np.random.default_rng(0),
                   PolishOptions(rounds=40))
    assert np.all(np.abs(moved) <= 1.0)
    before, after = (information_of(blocks_at(x)[0]) for x in (start, moved))
    assert guard.value(after) >= guard.value(before)
    # The D-optimal design of a parabola on [-1, 1] has a third of its points at -1, 0 and 1.
    np.testing.assert_allclose(np.sort(moved[:, 0]), [-1, -1, 0, 0, 1, 1], atol=0.05)


def test_pose_space_keeps_limits_and_box():
    robot = racer_like()
    box = Box(np.array([-0.8, -1.0, 0.2]), np.array([1.2, 1.0, 1.6]))
    space = PoseSpace.of(robot, box)
    q = space.draw(500, np.random.default_rng(0))
    assert np.all(q > -2.4) and np.all(q < 2.2) and space.allowed(q).all()
    target = space.target(q)
    assert np.all(target >= box.lower) and np.all(target <= box.upper)
    flange = PoseSpace.of(replace(robot, tool=Placement()), box).target(q)
    assert np.all(flange >= box.lower) and np.all(flange <= box.upper)
    np.testing.assert_allclose(np.linalg.norm(target - flange, axis=1), np.linalg.norm(TOOL.position),
                               rtol=1e-12)


def test_pose_space_says_why_it_is_empty():
    space = PoseSpace.of(racer_like(), Box(np.array([5.0, 5.0, 5.0]), np.array([6.0, 6.0, 6.0])))
    with pytest.raises(ComputationError, match="beyond the reach"):
        space.draw(10, np.random.default_rng(0))


def test_hand_keeps_clear_of_the_arm():
    robot = robot_of([(0.5, 0.0, RIGHT), (0.0, 0.5, 0.0), (0.0, 0.0, RIGHT), (0.5, 0.0, -RIGHT),
                      (0.0, 0.0, RIGHT), (0.1, 0.0, 0.0)])
    stretched = np.array([[0.0, 0.5, RIGHT, 0.0, 0.0, 0.0]])
    folded = np.array([[0.0, 1.0, -1.3, 0.0, 0.0, 0.0]])  # the hand hangs down beside the base column
    wide, none = PoseSpace.of(robot), PoseSpace.of(robot, clearance=0.0)
    assert wide.clearance == pytest.approx(0.1 * 1.6)
    assert wide.allowed(stretched)[0] and none.allowed(folded)[0] and not wide.allowed(folded)[0]
    q = none.draw(2000, np.random.default_rng(0))
    clear = wide.allowed(q)
    assert 0.5 < clear.mean() < 1.0
    for pose in wide.target(q[clear][:200]):
        height = np.clip(pose[2], 0.0, 0.5)
        assert np.linalg.norm(pose - [0.0, 0.0, height]) >= wide.clearance


def test_limits_that_are_not_declared():
    bare = Robot("bare", tuple(replace(joint, q_min=None, q_max=None) for joint in racer_like().joints))
    assert PoseSpace.of(bare).assumed == (1, 2, 3, 4, 5, 6)
    with pytest.raises(InputError, match="axis 1 slides"):
        PoseSpace.of(Robot("slide", (Joint(type="prismatic"),)))


def shipped_racer(frames):
    robot = replace(load_robot("racer-7-1.4"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    design = design_poses(robot, DesignOptions(frames=frames, seed=1))
    return robot, design


@pytest.mark.slow
@pytest.mark.parametrize("frames", ["both", "none"])
def test_marks_better_than_the_source_and_than_random_sets(frames):
    robot, design = shipped_racer(frames)
    table = np.genfromtxt(data_path("racer/thesis_poses.csv"), delimiter=",", names=True)
    theta = np.radians(np.stack([table[name] for name in table.dtype.names[:6]], axis=1))
    source = design.observability_of(theta / robot.controller_ratios + robot.controller_offsets)
    assert len(theta) == len(design.q) == 50
    assert design.observability.O1 > source.O1
    rng = np.random.default_rng(11)
    pool = design.space.draw(5000, rng)
    best = max(design.observability_of(pool[rng.choice(5000, 50, replace=False)]).O1 for _ in range(1000))
    assert design.observability.O1 > best > design.start.O1
    assert design.observability.O4 >= design.exchanged.O4 * (1.0 - 1e-9)


@pytest.mark.slow
def test_designed_poses_are_allowed_and_validation_stays_apart():
    _, design = shipped_racer("both")
    assert design.q.shape == (50, 6) and design.q_validation.shape == (13, 6)
    assert design.space.allowed(design.q).all() and design.space.allowed(design.q_validation).all()
    scaled = lambda q: (q - design.space.lower) / (design.space.upper - design.space.lower)
    gaps = np.sqrt(np.mean((scaled(design.q_validation)[:, None] - scaled(design.q)[None]) ** 2, axis=-1))
    assert gaps.min() >= design.validation_distance > 0.1
    assert design.q[0] in design.q and len(np.unique(design.q, axis=0)) == 50
    assert design.history[-1] == pytest.approx(design.exchanged.O1, rel=1e-9)


@pytest.mark.slow
def test_design_is_repeatable_and_depends_on_the_seed():
    robot = racer_like()
    options = DesignOptions(count=12, validation=3, seed=4)
    first, second = design_poses(robot, options), design_poses(robot, options)
    np.testing.assert_array_equal(first.q, second.q)
    np.testing.assert_array_equal(first.q_validation, second.q_validation)
    assert not np.array_equal(first.q, design_poses(robot, replace(options, seed=5)).q)


def test_too_few_poses_are_refused_with_the_number_needed():
    # as many as `calibrate` takes: it refused the 11 that were named here before
    with pytest.raises(InputError, match="30 numbers for 33 parameters, expected at least 12 poses"):
        design_poses(racer_like(), DesignOptions(count=10))


@pytest.mark.slow
def test_seven_axes_with_orientation():
    rows = [(0.34, 0.0, -RIGHT), (0.0, 0.0, RIGHT), (0.4, 0.0, RIGHT), (0.0, 0.0, -RIGHT), (0.4, 0.0, -RIGHT),
            (0.0, 0.0, RIGHT), (0.13, 0.0, 0.0)]
    design = design_poses(robot_of(rows), DesignOptions(count=20, validation=4, orientation=True))
    assert design.q.shape == (20, 7) and design.observability.O1 > design.start.O1


def test_a_sliding_axis():
    rows = [(0.3, 0.2, RIGHT), (0.2, 0.1, 0.7), (0.1, 0.1, 0.8), (0.1, 0.0, -RIGHT), (0.1, 0.0, RIGHT),
            (0.1, 0.0, 0.0)]
    types = ["revolute", "revolute", "prismatic", "revolute", "revolute", "revolute"]
    design = design_poses(robot_of(rows, types, ratios=False), DesignOptions(count=20, validation=4))
    assert design.observability.O1 > design.start.O1


def test_short_way_keeps_the_poses_and_shortens_the_way():
    robot = racer_like()
    space = PoseSpace.of(robot)
    q = space.draw(40, np.random.default_rng(2))
    ordered = short_way(space, q)
    way = lambda path: np.max(np.abs(np.diff(path, axis=0)), axis=1).sum()
    assert sorted(map(tuple, q)) == sorted(map(tuple, ordered)) and way(ordered) < way(q)


def test_spread_poses_may_be_none():
    space = PoseSpace.of(racer_like())
    assert spread_poses(space, np.zeros((3, 6)), 0, np.random.default_rng(0))[0].shape == (0, 6)
