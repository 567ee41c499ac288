"""Tracker range: every distance from the device's head is too long by the same length.

Seeds: none exchanged.
"""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects.frames import Frames
from exactarm.effects.tracker_range import TrackerRange
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot
from random_robot import random_rotation
from set_ups import joints_in_limits, measured, true_robot

NOISE_M, COUNT, FITTED, LONGER_M = 4e-5, 150, 110, 2.5e-4


def poses(name, seed, station_m, longer_m=LONGER_M):
    """The arm stands `station_m` from the tracker's head, which is the origin of what it measures."""
    rng = np.random.default_rng(seed)
    robot = load_robot(name)
    truth = true_robot(robot, rng, 0.5)
    way = rng.normal(size=3) * (1.0, 1.0, 0.2)
    arm = replace(truth, base=Placement(random_rotation(rng), station_m * way / np.linalg.norm(way)))
    q = np.clip(joints_in_limits(robot, COUNT, rng), -2.2, 2.2)
    data = measured(robot, [arm], [q], NOISE_M, rng, identification=np.arange(COUNT) < FITTED)
    away = np.linalg.norm(data.position, axis=1, keepdims=True)
    return robot, replace(data, position=data.position * (1.0 + longer_m / away))


def test_moves_the_target_along_the_line_of_sight_with_its_derivatives():
    robot, data = poses("ur10", 1, 2.0, 0.0)
    robot = replace(robot, base=Placement(position=np.array([1.0, 1.5, 0.3])))
    effect = TrackerRange(None, (3e-4,))
    bare, longer = (predict_poses(robot, Layout.of(effects), data, tangents=False).position
                    for effects in ((), (effect,)))
    distances = [np.linalg.norm(position, axis=1) for position in (bare, longer)]
    np.testing.assert_allclose(distances[1] - distances[0], 3e-4, rtol=1e-9)
    np.testing.assert_allclose(np.cross(longer, bare), 0.0, atol=1e-12)
    view = predict_poses(robot, Layout.of(()), data).view
    place = view.measured[:, :3].copy()
    change = effect.change(view)
    np.testing.assert_allclose(change.by_parameters[:, :, 0] * 3e-4, change.value)

    def moved(shift):
        view.signals["measured"] = place + shift
        return effect.change(view).value

    assert_derivative(moved, np.zeros(3), change.by_signal["measured"], 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name, station_m",
                         [("ur10", 1.8), ("tx40", 1.5), ("racer-7-1.4", 2.5), ("panda", 1.6)])
def test_a_range_that_is_too_long_is_named_with_its_size(name, station_m):
    result = diagnose(*poses(name, 2, station_m))
    first = result.findings[0]
    assert result.verdict == "explained" and len(result.findings) == 1, result.sentence
    assert first.effect.name == "tracker_range" and first.probability > 0.9
    low, high = first.intervals[0]
    assert abs(first.effect.values[0] - LONGER_M) < high - low and "millimetre" in first.effect.describe()


@pytest.mark.slow
@pytest.mark.parametrize("seed, alone", [(2, False), (3, True), (4, False)])
def test_far_away_it_forms_a_set_with_a_scale(seed, alone):
    """Lines of sight that are nearly parallel: what is left of a longer range is a scale across them."""
    result = diagnose(*poses("ur10", seed, 7.0, 5e-4))
    (first,) = result.findings
    assert {name for name, _, _ in first.credible_set} - {"tracker_scale"} == {"tracker_range"}
    assert (len(first.credible_set) == 1) == alone
    assert first.intervals[0][0] < 5e-4 < first.intervals[0][1]


@pytest.mark.parametrize("stations_m, tried", [((2.5,), True), ((2.5, 3.0), True), ((0.3,), False),
                                               ((2.5, 0.0), False)])
def test_is_a_candidate_where_the_head_can_stand(stations_m, tried):
    """Where the origin lies among the targets (coordinates in the arm's own frame) no device stands."""
    robot = load_robot("ur10")
    q = np.tile(joints_in_limits(robot, COUNT, np.random.default_rng(3)), (len(stations_m), 1))
    session = np.repeat(1 + np.arange(len(stations_m)), COUNT)
    data = Dataset.of_arrays("poses", {"q": q}, position=np.zeros((len(q), 3)), session=session)
    frames = tuple(Frames.of(number, Placement(position=[station, 0.0, 0.0]), Placement(), False)
                   for number, station in enumerate(stations_m, start=1))
    view = predict_poses(robot, Layout.of(frames), data).view
    assert bool(tuple(TrackerRange.candidates(robot, view))) == tried
