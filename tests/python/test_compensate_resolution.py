"""Targets as the controller takes them: poses that are solved together are those that each gives alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensation_cell import identified, reachable
from exactarm.compensate.approach import Approaches
from exactarm.compensate.controller import ControllerChain
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.formats import DIALECTS
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Motion, Notation, Program, SourceText, Target
from exactarm.compensate.resolution import resolve

COUNT = 1200


def program(poses: Poses, order: list[int], odd: dict[int, dict]) -> Program:
    """Poses as targets; odd: what else some of them have."""
    targets = tuple(Target(f"p{i}", 0, i, (float(i),), is_pose=True, **odd.get(i, {}))
                    for i in range(len(poses)))
    notation = Notation(joints=lambda q: q, poses=lambda rows: poses.rows(rows[:, 0].astype(int)))
    motions = tuple(Motion("joint", i, i) for i in order)
    return Program("poses", (SourceText(Path("p"), b""),), targets, motions, notation)


def one_by_one(chain: ControllerChain, poses: Poses, order: list[int], odd: dict[int, dict],
               before: np.ndarray) -> np.ndarray:
    """(T, n) as the rule says it: each pose on the branch nearest to the one before."""
    q = np.full((len(poses), len(before)), np.nan)
    for i in order:
        own = odd.get(i, {})
        if not own.get("refusal"):
            if np.isnan(q[i, 0]):
                found = chain.nearest(poses.position[i], poses.rotation[i], own.get("near", before))
                fits = own.get("matches", lambda q: True)
                q[i] = found if fits(found) else next(
                    row for row in chain.branches(poses.position[i], poses.rotation[i]) if fits(row))
            before = q[i]
    return q


@pytest.mark.parametrize("coupled", [False, True])
def test_poses_on_the_way_of_an_arm_are_those_that_each_gives_from_the_one_before(monkeypatch, coupled):
    """Bit for bit, with jumps, targets met again, refused ones, and what else decides on a branch."""
    robot = identified()
    if coupled:
        robot = replace(robot, controller=replace(robot.controller, coupling=((3, 2, 1.0),)))
    chain = CompensationModel.of(robot).controller
    turn = np.linspace(0.0, 3.0, COUNT)[:, None] * np.array([1.0, 1.3, 0.7, 1.1, 0.9, 0.5])
    q = reachable(robot, 2)[0] + 0.3 * np.sin(turn)
    q[400:] += np.subtract(*reachable(robot, 2)[::-1])  # a jump
    poses = chain.poses(q)
    other = chain.branches(poses.position[600], poses.rotation[600])
    turned = next(row for row in other if np.abs(row - q[600]).max() > 1.0)
    odd = {100: {"refusal": "not known"}, 200: {"near": q[200] + 0.01},
           600: {"matches": lambda row: bool(np.abs(row - turned).max() < 0.1)}}
    order = [*range(300), 7, 7, *range(300, 700), 40, *range(650, COUNT)]
    expected = one_by_one(chain, poses, order, odd, q[0])
    assert np.isnan(expected).any(axis=1).sum() == 1
    assert np.abs(np.diff(expected[598:602], axis=0)).max() > 1.0
    asked = []
    newton = ControllerChain.newton
    monkeypatch.setattr(ControllerChain, "newton",
                        lambda self, *pose: asked.append(1) or newton(self, *pose))
    found = resolve(program(poses, order, odd), CompensationModel.of(robot), q[0])
    np.testing.assert_array_equal(found.q, expected)
    assert len(asked) < 20  # one by one where something else decides


def test_sides_of_few_changed_targets_are_those_of_all_of_them():
    robot = identified()
    model = CompensationModel.of(robot)
    q = reachable(robot, 60)
    motions = [Motion("circular" if i % 7 == 3 else "linear" if i % 3 else "joint", i, i,
                      via=i - 1 if i % 7 == 3 else None) for i in range(60)]
    again = Approaches(model, motions, q[1])
    again.of(q)
    for change in ([], [5], [2, 17, 18], range(60)):
        q = q.copy()
        q[list(change)] += 0.05
        np.testing.assert_array_equal(again.of(q), Approaches(model, motions, again.start).of(q))


def test_numbers_keep_their_decimals_and_their_plus():
    texts = ["1.50", "+2.5", "-0.001", "+0.004", "7", "1e-3", "12.", "-1.5E2", "+3"]
    content = " ".join(texts).encode()
    ends = np.cumsum([len(text) + 1 for text in texts]) - 1
    places = np.column_stack([ends - [len(text) for text in texts], ends])
    values = np.array([2.344, -1.26, -0.0004, -0.0001, 6.7, -2e-4, 0.4, 151.2, 4.0])
    source = SourceText(Path("p"), content)
    digits = np.maximum(source.decimals(places), [0, 0, 0, 0, 0, 0, 1, 0, 0])
    written = source.numbers(places[:, 0], digits, values)
    assert written == [b"2.34", b"-1.3", b"0.000", b"+0.000", b"7", b"0.000", b"0.4", b"151", b"+4"]


def test_every_dialect_of_poses_says_how_it_shows_a_frame():
    for dialect in DIALECTS:
        if dialect.NAME != "JointTrajectory":
            numbers = (100.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)[: getattr(dialect, "FRAME_NUMBERS", 6)]
            assert np.linalg.norm(dialect.placement(numbers).position) in (pytest.approx(0.1), 100.0)
