"""The guide of a sliding axis: derivatives, exact rigid motions of an independent plant, found where hidden,
compensated."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import exactarm as ea
from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.chain.extrapolation import extrapolations
from exactarm.data.dataset import Dataset
from exactarm.diagnose.pose_problem import PoseProblem
from exactarm.effects import effect_from_table, library
from exactarm.effects.frames import Frames
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.guide_error import GuideError
from exactarm.identify.declared import geometry_layout
from exactarm.plan.compensation import known_functions, planning_model
from exactarm.robot.robot import Joint, Placement, Robot
from exactarm.simulate.virtual_robot import parse_effect
from test_robot_types import arm_on_a_track, slide

WAVES, NOISE_M, WAY_M = 3, 2e-5, 3.0


def track_on_a_turntable():
    """The guide itself turns: its directions follow the axis before it."""
    track = arm_on_a_track()
    return replace(track, joints=(replace(track.joints[1], a=0.3, alpha=0.4), *track.joints[:4]))


def angles(robot, rows: int, seed: int) -> np.ndarray:
    span = np.array([(-2.2, 2.2) if joint.type == "revolute" else (joint.q_min, joint.q_max)
                     for joint in robot.joints])
    return np.random.default_rng(seed).uniform(*span.T, (rows, robot.axes))


def bent(joint: int, seed: int = 1, seen=(0.1, 2.9), size_m: float = 3e-4) -> GuideError:
    empty = GuideError(joint, (0.0,) * 6 * WAVES, seen=seen, size_m=size_m)
    sizes = [parameter.prior for parameter in empty.parameters()]
    return empty.with_values(np.random.default_rng(seed).normal(size=len(sizes)) * sizes)


def poses(q: np.ndarray, position: np.ndarray | None = None) -> Dataset:
    position = np.zeros((len(q), 3)) if position is None else position
    return Dataset.of_arrays("poses", {"q": q}, position=position)


def placed(robot, seed: int = 5):
    random = np.random.default_rng(seed)
    return replace(robot, base=Placement(Rotation.random(rng=random).as_matrix(), random.normal(size=3)),
                   tool=Placement(Rotation.random(rng=random).as_matrix(), np.array([0.05, 0.02, 0.15])))


def moved_by_the_guide(robot, q: np.ndarray, axis: int, motions) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) targets on an ideal guide and on one whose carriage makes `motions` (N, 6), by exact
    rotations."""
    origins, rotations = _core.frame_poses(replace(robot, base=Placement(), tool=Placement()).core, q)
    target = origins[:, -1] + rotations[:, -1] @ robot.tool.position
    carriage, guide = origins[:, axis + 1], rotations[:, axis]
    shift, turn = (np.einsum("nij,nj->ni", guide, part) for part in (motions[:, :3], motions[:, 3:]))
    moved = carriage + shift + Rotation.from_rotvec(turn).apply(target - carriage)
    return tuple(point @ robot.base.rotation.T + robot.base.position for point in (target, moved))


def predicted(robot, q: np.ndarray, *effects) -> np.ndarray:
    frames = Frames.of(1, robot.base, robot.tool, False)
    return predict_poses(robot, Layout.of((frames, *effects)), poses(q), tangents=False).position


ARMS = pytest.mark.parametrize("build, joint", [(arm_on_a_track, 1), (track_on_a_turntable, 2)])


@ARMS
def test_the_target_follows_the_carriage_as_a_rigid_body(build, joint):
    robot, effect = placed(build()), bent(joint)
    q = angles(robot, 40, 2)
    waves = np.cos(np.pi * np.arange(1, WAVES + 1) * (np.clip(q[:, [joint - 1]], 0.1, 2.9) - 0.1) / 2.8)
    motions = waves @ np.reshape(effect.values, (6, WAVES)).T
    ideal, moved = moved_by_the_guide(robot, q, joint - 1, motions)
    np.testing.assert_allclose(predicted(robot, q), ideal, atol=1e-12)
    assert np.linalg.norm(moved - ideal, axis=1).max() > 5e-4
    np.testing.assert_allclose(predicted(robot, q, effect), moved, atol=3.0 * np.abs(motions).max() ** 2)


@pytest.mark.slow
@ARMS
def test_derivatives_by_all_parameters_of_the_arm(build, joint):
    """Also by those that carry the guide itself: with the arm fixed in them, a thousandth of a derivative was
    lost, and a calibration of an arm on a known guide did not converge."""
    robot, effect = placed(build()), bent(joint)
    q = angles(robot, 12, 3)
    declared = Layout.of((Frames.of(1, robot.base, robot.tool, True),)).joined(geometry_layout(robot))
    layout = declared.joined(Layout.of((effect,)))
    memory = cache(lambda values: predict_poses(robot, layout.at(np.array(values)), poses(q), tangents=False))
    at = lambda x: memory(tuple(x))  # for both checks
    found = predict_poses(robot, layout, poses(q))
    steps = [1e-2 * min(p.plausible, 1e-2) for p in layout.parameters]
    assert_derivative(lambda x: at(x).position, layout.values, found.jacobian[:, :3], steps)
    away = lambda x: np.einsum("nij,nkj->nik", at(x).rotation, found.rotation)[:, [2, 0, 1], [1, 2, 0]]
    # Two small turns add up to the product of both, here a thousandth.
    assert_derivative(away, layout.values, found.jacobian[:, 3:], steps, relative=2e-3)


def test_a_file_gives_it_back_and_says_it_in_numbers():
    effect = bent(1)
    assert effect_from_table(effect.to_table()) == effect
    waves = np.cos(np.pi * np.linspace(0.0, 1.0, 101)[:, None] * np.arange(1, WAVES + 1))
    roll = 1e6 * np.ptp(waves @ np.reshape(effect.values, (6, WAVES))[3:].T, axis=0).max()
    assert f"turns by {roll:.0f} µrad" in effect.describe()
    covariance = 1e-12 * np.eye(len(effect.values))
    derived = {name: (value, sd) for name, value, sd in effect.derived(covariance)}
    assert derived["turn_rad"][0] == pytest.approx(1e-6 * roll, abs=1e-6)
    assert 0.0 < derived["turn_rad"][1] < 5e-6
    assert 0.0 < derived["straightness_m"][0] < 5e-3


def test_a_few_terms_are_enough_to_simulate_one():
    words = "guide_error joint=1 shift_x_2_m=1e-4 turn_z_3_rad=2e-4 seen_from_m=0 seen_to_m=3 size_m=1e-4"
    robot, q = arm_on_a_track(), angles(arm_on_a_track(), 20, 10)
    effect = parse_effect(words, robot.axes)
    assert effect.waves == 3 and np.count_nonzero(effect.values) == 2
    assert 2e-5 < np.linalg.norm(predicted(robot, q, effect) - predicted(robot, q), axis=1).max() < 1e-3
    for wrong in (words.replace("seen_to_m=3", "seen_to_m=0"), words.replace("size_m=1e-4", "size_m=0"),
                  "guide_error joint=1 seen_from_m=0 seen_to_m=3 size_m=1e-4",
                  words.replace("shift_x_2_m", "shift_w_2_m")):
        with pytest.raises(ea.InputError, match="guide_error"):
            parse_effect(wrong, robot.axes)


def test_its_curves_are_its_motions_less_line_and_mean_with_their_spread():
    effect, x = bent(1), np.linspace(0.1, 2.9, 101)
    random = np.random.default_rng(9)
    spread = 1e-6 * random.normal(size=(len(effect.values),) * 2)
    curves = effect.curves(x, spread @ spread.T)
    waves = np.cos(np.pi * np.arange(1, WAVES + 1) * (x[:, None] - 0.1) / 2.8)
    motions = waves @ np.reshape(effect.values, (6, WAVES)).T
    line = np.stack([np.ones(101), x], axis=1)
    shift = motions[:, :3] - line @ np.linalg.lstsq(line, motions[:, :3], rcond=None)[0]
    told = np.concatenate([shift, motions[:, 3:] - motions[:, 3:].mean(axis=0)], axis=1)
    np.testing.assert_allclose([curve.value for curve in curves], told.T, atol=1e-15)
    units = (effect.with_values(row) for row in np.eye(len(spread)))  # the curves are linear in the terms
    made = np.array([[curve.value for curve in unit.curves(x, 0.0 * spread)] for unit in units])
    deviations = np.linalg.norm(np.einsum("kmx,kl->mxl", made, spread), axis=2)
    np.testing.assert_allclose([curve.deviation for curve in curves], deviations, rtol=1e-9)
    assert [curve.unit for curve in curves] == ["m"] * 3 + ["rad"] * 3


def test_what_is_no_straightness_is_not_told_as_one():
    """Shifts in proportion to the position are the geometry's, a constant turn too."""
    many = 40
    empty = GuideError(1, (0.0,) * 6 * many, seen=(0.0, WAY_M))
    k = np.arange(1, many + 1)
    slope = np.where(k % 2 == 1, -4.0 / (np.pi * k) ** 2, 0.0)  # cosine series of s - 1/2
    told = empty.with_values([*(1e-3 * slope), *([0.0] * 5 * many)])
    (name, height, _), _ = told.derived(np.zeros((6 * many,) * 2))
    assert name == "straightness_m" and height < 0.02 * 1e-3


def test_only_a_slide_that_moves_has_a_guide_and_no_turn_of_its_own():
    def candidates(name, robot, q):
        view = predict_poses(robot, Layout.of(()), poses(q)).view
        return {effect.joint for effect in library()[name].candidates(robot, view)}

    track, arm = arm_on_a_track(), replace(arm_on_a_track(), joints=arm_on_a_track().joints[1:])
    q = angles(track, 30, 4)
    still = q.copy()
    still[:, 0] = 1.0
    assert candidates("guide_error", track, q) == {1}
    assert candidates("guide_error", track, still) == candidates("guide_error", arm, q[:, 1:]) == set()
    assert candidates("gear_eccentricity", track, q) == set(range(2, 8))
    view = predict_poses(track, Layout.of(()), poses(q)).view
    waves = list(GearHarmonics.candidates(track, view))
    assert {e.joint for e in waves if e.any_curve} == set(range(2, 8))
    ratio = track.joints[0].ratio
    tried = {order for e in waves if e.joint == 1 for order in e.search}
    assert tried and all(min(abs(order - ratio), abs(order - 0.5 * ratio)) <= 1.0 for order in tried)


def test_waves_of_a_slide_are_told_by_their_length():
    track = arm_on_a_track()
    wave = GearHarmonics(1, (200.0, 1e-3, 0.0))
    assert "31.42 mm long" in wave.describe_on(track)
    assert wave.in_units_of(track, "order_per_rev") == "order_rad_per_m"
    assert "revolution" in GearHarmonics(2, (200.0, 1e-3, 0.0)).describe_on(track)


def test_beyond_the_way_measured_it_holds_and_is_told():
    robot, effect = placed(arm_on_a_track()), bent(1, seen=(0.5, 2.0))
    q = np.repeat(angles(robot, 1, 6), 3, axis=0)
    q[:, 0] = 2.0, 2.5, 3.0
    moved = predicted(robot, q, effect) - predicted(robot, q)
    np.testing.assert_allclose(moved[1:], moved[[0, 0]], atol=1e-12)
    assert np.linalg.norm(moved[0]) > 1e-5
    line, = extrapolations(replace(robot, effects=(effect,)), q)
    assert "from 0.500 to 2.000 m; 2 of 3" in line


def test_commands_and_plans_correct_it():
    robot = arm_on_a_track()
    identified = replace(robot, effects=(bent(1),))
    q = 0.5 + 0.3 * angles(robot, 8, 7)
    command = ea.command_of(identified, q)
    reached = predicted(robot, command, bent(1))
    assert np.linalg.norm(predicted(robot, q, bent(1)) - predicted(robot, q), axis=1).max() > 1e-4
    np.testing.assert_allclose(reached, predicted(robot, q), atol=1e-8)
    path = np.linspace(q[0], q[1], 20)
    shifts = [known_functions(planning_model(each), path, 0.01, "motion", 1).displacement
              for each in (robot, identified)]
    assert np.abs(shifts[1] - shifts[0]).max() > 1e-4


def rail(seed: int, size_m: float):
    """Six motions of a carriage along `WAY_M`: sines of random lengths that fit into no window."""
    random = np.random.default_rng(seed)
    motions = []
    for motion in range(6):
        length = WAY_M * random.uniform(0.3, 1.3, 3)
        amplitude = random.normal(size=3) * size_m * (length / WAY_M) ** (2 if motion < 3 else 1)
        motions.append((amplitude * (1.0 if motion < 3 else 2.0 * np.pi / WAY_M), length,
                        random.uniform(0.0, 2.0 * np.pi, 3)))
    return lambda x: np.stack([np.sin(2.0 * np.pi * x[:, None] / length + phase) @ amplitude
                               for amplitude, length, phase in motions], axis=1)


def on_a_rail(motions, count: int, seed: int):
    """A deviated arm on a track with these motions (N,) -> (N, 6), its drawing, and poses of it."""
    random = np.random.default_rng(seed)
    robot = arm_on_a_track()
    off = lambda joint: {name: getattr(joint, name) + 3e-4 * random.normal() for name in ("d", "a", "alpha")}
    true = placed(replace(robot, joints=tuple(replace(joint, **off(joint)) for joint in robot.joints)), seed)
    q = angles(robot, count, seed)
    _, moved = moved_by_the_guide(true, q, 0, motions(q[:, 0]))
    return true, robot, poses(q, moved + NOISE_M * random.normal(size=moved.shape))


@pytest.mark.parametrize("ratio, told", [(None, True), (100.0 * np.pi, False)])
def test_waves_that_nobody_knows_where_to_look_for_are_said_not_to_be_searched(ratio, told):
    _, robot, data = on_a_rail(rail(1, 0.0), 20, 1)
    robot = replace(robot, joints=(replace(robot.joints[0], ratio=ratio), *robot.joints[1:]))
    lines = PoseProblem(robot, data, data.select(np.zeros(len(data), bool))).left_out()
    told_of = [line.startswith("axis 1 slides and its file has no ratio_rad_m") for line in lines]
    assert told_of == [True] * told


def panels_of(result) -> set[str]:
    """Titles of the panels of its figure of causes."""
    figure, = (figure for figure in result.report.figures if figure.name == "effects")
    return {axes.get_title() for axes in figure.build().axes}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_rail_that_shifts_and_does_not_turn_is_found(seed):
    """A bow of 0.2 mm under a long carriage, orientations measured: with turns as large as its slope asks
    for, seeds 1 to 4 were all `unexplained` (the device follows the travel), now none is. Seeds: the first
    two."""
    bow = lambda x: 2e-4 * np.stack([0.0 * x, (x / WAY_M - 0.5) ** 2 * 4.0, *(0.0 * x,) * 4], axis=1)
    true, robot, data = on_a_rail(bow, 150, seed)
    bare = replace(true, base=Placement(), tool=Placement())
    turned = _core.frame_poses(bare.core, data.joints["q"])[1][:, -1]
    noise = NOISE_M * np.random.default_rng(seed).normal(size=(len(data), 3))
    turned = true.base.rotation @ turned @ true.tool.rotation
    data = replace(data, rotation=Rotation.from_rotvec(noise).as_matrix() @ turned)
    result = ea.diagnose(robot, data, seed=seed, threads=1)
    assert result["verdict"] == "explained"
    assert [(found["effect"], found["joint"]) for found in result["effects"]] == [("guide_error", 1)]
    assert result.after["validation"].rms < 0.6 * result.before["validation"].rms


@pytest.mark.slow
@pytest.mark.parametrize("seed, size_m, count", [(1, 2e-4, 120), (2, 5e-5, 80), (3, 5e-4, 150)])
def test_a_hidden_bent_rail_is_found_and_nothing_beside_it(seed, size_m, count):
    """Plant: exact rigid motions of a deviated arm. Seeds: the first three, none was left out.

    Held-out errors of 9 to 59 NOISE_M fall to 2.2 to 2.6 (noise alone: 1.7), so that six tenths left are a
    failure. Of the motions a third of the largest may be missing: fewer poses than terms have fitted them."""
    motions = rail(seed, size_m)
    _, robot, data = on_a_rail(motions, count, seed)
    result = ea.diagnose(robot, data, seed=seed, threads=1)
    assert [(found["effect"], found["joint"]) for found in result["effects"]] == [("guide_error", 1)]
    assert result["verdict"] == "explained" and result["converged"]
    assert result.after["validation"].rms < 0.6 * result.before["validation"].rms
    found, = (effect for effect in result.robot.effects if effect.name == "guide_error")
    assert {"Guide of axis 1: roll", "Guide of axis 1: straightness along x"} <= panels_of(result)
    x = np.linspace(*found.seen, 101)
    waves = np.cos(np.pi * np.arange(1, found.waves + 1) * np.linspace(0.0, 1.0, 101)[:, None])
    line = np.stack([np.ones(101), x], axis=1)
    apart = [motion - line @ np.linalg.lstsq(line, motion, rcond=None)[0]
             for motion in (motions(x), waves @ found.coefficients.T)]
    assert np.std(apart[1] - apart[0], axis=0).max() < 0.35 * np.std(apart[0], axis=0).max()


def test_the_width_of_its_priors_follows_what_it_was_found_to_be():
    """Ten times too tight, it comes to the width of its terms, and stays there."""
    made = bent(1, seed=4)
    tight = replace(made, size_m=0.1 * made.size_m)
    known = np.zeros((len(made.values),) * 2)
    redrawn = tight.redrawn(known)
    sizes = np.array(made.values) / [parameter.prior for parameter in made.parameters()]
    assert redrawn.size_m == pytest.approx(made.size_m * np.sqrt(np.mean(sizes**2)))
    assert redrawn.redrawn(known) is redrawn
    nothing = made.with_values([0.0] * len(made.values))
    prior = np.diag([parameter.prior**2 for parameter in made.parameters()])
    assert nothing.redrawn(prior) is nothing  # data that say nothing leave the width as it is


def test_a_short_slide_is_drawn_to_a_smaller_error():
    """Priors are in proportion to the way: a quill of 0.2 m is not bent by 0.9 mm."""
    short = replace(arm_on_a_track(), joints=(slide(0.2, alpha=-np.pi / 2), *arm_on_a_track().joints[1:]))
    view = predict_poses(short, Layout.of(()), poses(angles(short, 30, 8))).view
    sizes = [effect.size_m for effect in GuideError.candidates(short, view)]
    assert len(set(sizes)) == 4 and max(sizes) < 6.1e-5


@pytest.mark.slow
def test_a_bent_rail_and_a_run_out_beside_it_are_both_found():
    """Priors held at the size of the first picture left 0.43 mm; now they are as wide as the terms are
    found. Seeds: of the arm on which that was seen; noise alone is 1.7 NOISE_M."""
    random = np.random.default_rng(58)
    robot = arm_on_a_track()
    q = angles(robot, 120, 58)
    turned = q.copy()
    turned[:, 3] += 4e-4 * np.cos(q[:, 3]) - 3e-4 * np.sin(2.0 * q[:, 3])
    _, moved = moved_by_the_guide(placed(robot, 8), turned, 0, rail(108, 2e-4)(q[:, 0]))
    data = poses(q, moved + NOISE_M * random.normal(size=moved.shape))
    result = ea.diagnose(robot, data, seed=8, threads=1)
    found = {(each["effect"], each["joint"]) for each in result["effects"]}
    assert found == {("guide_error", 1), ("gear_eccentricity", 4)} and result["converged"]
    assert result.after["validation"].rms < 4.0 * NOISE_M


def gantry():
    """Three slides at right angles, and a wrist."""
    quarter = 0.5 * np.pi
    wrist = [replace(joint, ratio=100.0, q_min=-2.2, q_max=2.2)
             for joint in (Joint(d=0.1, alpha=quarter), Joint(alpha=-quarter), Joint(d=0.1))]
    return Robot("gantry", (slide(4.0, alpha=-quarter), slide(2.0, alpha=quarter, zero=quarter), slide(1.0),
                            *wrist))


@pytest.mark.slow
@pytest.mark.parametrize("axes, count, seed", [((1, 2, 3), 250, 3), ((3,), 100, 4), ((), 120, 5)])
def test_the_guides_of_a_gantry_are_told_apart(axes, count, seed):
    """Plant: from the last bent guide to the first, what lies beyond moves with its carriage. Seeds 1
    and 2 were gantries with one and two bent guides, in a trial: none was left out."""
    robot, random = gantry(), np.random.default_rng(seed)
    true, q = placed(robot, seed), angles(robot, count, seed)
    origins, rotations = _core.frame_poses(replace(true, base=Placement(), tool=Placement()).core, q)
    target = origins[:, -1] + rotations[:, -1] @ true.tool.position
    for axis in sorted(axes, reverse=True):
        way = robot.joints[axis - 1].q_max
        motions = rail(10 * seed + axis, 6e-5 * way)(q[:, axis - 1] * WAY_M / way)
        motions[:, 3:] *= WAY_M / way
        guide, carriage = rotations[:, axis - 1], origins[:, axis]
        shift, turn = (np.einsum("nij,nj->ni", guide, part) for part in (motions[:, :3], motions[:, 3:]))
        target = carriage + shift + Rotation.from_rotvec(turn).apply(target - carriage)
    measured = target @ true.base.rotation.T + true.base.position + NOISE_M * random.normal(size=target.shape)
    result = ea.diagnose(robot, poses(q, measured), seed=seed, threads=1)
    found = [(each["effect"], each["joint"]) for each in result["effects"]]
    assert sorted(found) == [("guide_error", axis) for axis in axes] and result["converged"]
    assert result.after["validation"].rms < 4.0 * NOISE_M
