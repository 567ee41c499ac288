"""The poses that a diagnosis asks for: against the fit that the new measurements would really allow."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.design.pose_space import PoseSpace
from exactarm.diagnose.confusion import Place
from exactarm.diagnose.next_poses import (
    PAYLOAD_KG,
    Experiment,
    _seen,
    _simulated,
    _State,
    next_poses,
    sentence_of,
)
from exactarm.diagnose.pose_problem import PoseProblem
from exactarm.effects.gear_ratio import GearRatio
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot

SPRING, RATIO = JointCompliance(2, (2e-6, 0.0)), GearRatio(2, (0.0,))


def told_by(robot, fitted, places, q, payload_kg):
    """The bits that any poses q (K, n) would tell about the causes, approached from both directions."""
    fields, rows = _seen(robot, fitted, [_State.of(fitted, place) for place in places], q, payload_kg)
    return _simulated(fields, rows, list(range(len(q))), 0)


@pytest.fixture(scope="module")
def narrow():
    """The UR10 measured with axis 2 in a narrow range, where a spring and a wrong ratio look alike."""
    robot = replace(load_robot("ur10"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    rng = np.random.default_rng(2)
    q = rng.uniform(-1.2, 1.2, (60, 6))
    q[:, 1] = rng.uniform(-0.9, -0.7, 60)
    data = Dataset.of_arrays("poses", {"q": q})
    exact = predict_poses(robot, Layout.of(()), data, tangents=False).position
    measured = replace(data, position=exact + rng.normal(0.0, 1e-4, (60, 3)))
    problem = PoseProblem(robot, measured, measured.select(np.zeros(60, bool)))
    return robot, problem.fit(problem.declared())


@pytest.fixture(scope="module")
def doubtful(narrow):
    """The spring fitted, and the ratio as likely in its place."""
    robot, fitted = narrow
    problem = PoseProblem(robot, fitted.view.data, fitted.view.data.select(np.zeros(60, bool)))
    with_spring = problem.fit(fitted.layout.joined(Layout.of((SPRING,))))
    found = with_spring.layout.effects[-1]
    return robot, with_spring, Place(found, 0.5, ((RATIO, 0.5),))


@pytest.fixture(scope="module")
def experiments(doubtful):
    robot, fitted, place = doubtful
    strong = place.effect.with_values((2e-6, 0.0))
    layout = replace(fitted.layout, effects=fitted.layout.effects[:-1] + (strong,))
    data = replace(fitted.view.data,
                   position=predict_poses(robot, layout, fitted.view.data, tangents=False).position)
    rng = np.random.default_rng(3)
    problem = PoseProblem(robot, replace(data, position=data.position + rng.normal(0.0, 1e-4, (60, 3))),
                          data.select(np.zeros(60, bool)))
    fitted = problem.fit(layout)
    return robot, fitted, next_poses(robot, fitted, [Place(fitted.layout.effects[-1], 0.5, ((RATIO, 0.5),))],
                                     0)


@pytest.mark.slow
def test_most_of_what_is_open_would_be_known(experiments):
    robot, _, found = experiments
    best = found[0]
    assert {e.payload_kg for e in found} == {0.0, PAYLOAD_KG}
    assert best.open_bits == pytest.approx(1.0) and best.parts and 0.9 <= best.bits <= 1.0
    space = PoseSpace.of(robot)
    assert np.all((best.q >= space.lower - 1e-9) & (best.q <= space.upper + 1e-9))


@pytest.mark.slow
def test_chosen_poses_tell_more_than_random_ones(experiments):
    robot, fitted, found = experiments
    rng, space, place = np.random.default_rng(5), PoseSpace.of(robot), Place(fitted.layout.effects[-1], 0.5,
                                                                             ((RATIO, 0.5),))
    for best in found:
        told = told_by(robot, fitted, [place], best.q, best.payload_kg)
        assert told == pytest.approx(best.bits, abs=0.03)  # another scale of the columns: other draws
        random = [told_by(robot, fitted, [place], space.draw(len(best.q), rng), best.payload_kg)
                  for _ in range(20)]
        assert told > max(random)


def test_sentence_names_poses_causes_bits_and_minutes(experiments):
    robot, fitted, found = experiments
    text = sentence_of(found)
    assert (
        text.startswith(f"Measure {len(found[0].q)} poses") and "design --for" in text
        and "joint compliance of axis 2 or gear ratio of axis 2" in text
    )
    assert "of 1.00 bits" in text and "minutes" in text
    assert text == sentence_of(next_poses(robot, fitted,
                                          [Place(fitted.layout.effects[-1], 0.5, ((RATIO, 0.5),))], 0))


@pytest.mark.parametrize("poses, time", [(1, "in less than a minute "), (2, "in some 1 minute "),
                                         (6, "in some 3 minutes ")])
def test_time_is_said_as_a_person_says_it(poses, time):
    experiment = Experiment(np.zeros((poses, 6)), 0.0, 1.0, 1.0, "one or the other")
    assert time in sentence_of([experiment])


def test_mounting_a_payload_costs_its_minutes(experiments):
    _, _, found = experiments
    loaded, plain = sorted(found, key=lambda e: -e.payload_kg)
    assert (
        loaded.minutes() - 0.5 * len(loaded.q) == pytest.approx(5.0) and plain.minutes() == 0.5 * len(plain.q)
    )
    assert loaded.bits_per_minute({"visit": 0.25, "payload": 100.0}) < 0.1 * plain.bits_per_minute()


def test_says_so_when_no_pose_parts_them(doubtful):
    robot, fitted, _ = doubtful
    same = GearRatio(2, (1e-9,))
    layout = replace(fitted.layout, effects=fitted.layout.effects[:-1] + (same,),
                     free=fitted.layout.free[:-1] + (np.array([True]),))
    problem = PoseProblem(robot, fitted.view.data, fitted.view.data.select(np.zeros(60, bool)))
    found = next_poses(robot, problem.fit(layout), [Place(same, 0.5, ((same, 0.5),))], 0)
    assert sentence_of(found).startswith("No poses inside the limits tell")


@pytest.mark.slow
@pytest.mark.parametrize("spread", [pytest.param(0.03, marks=pytest.mark.slow), 1e-6])
def test_poses_measured_in_a_corner_ask_for_others_all_the_same(narrow, spread):
    """So narrow that hardly any pose within the limits has its target there: it ended with an error."""
    robot, _ = narrow
    rng = np.random.default_rng(6)
    q = np.array([0.4, -0.9, 0.8, -0.3, 0.5, 0.2]) + rng.uniform(-spread, spread, (40, 6))
    data = Dataset.of_arrays("poses", {"q": q})
    exact = predict_poses(robot, Layout.of(()), data, tangents=False).position
    measured = replace(data, position=exact + rng.normal(0.0, 1e-4, (40, 3)))
    problem = PoseProblem(robot, measured, measured.select(np.zeros(40, bool)))
    frames = problem.calibrated.layout
    fitted = problem.fit(frames.joined(Layout.of((SPRING,))))
    words, found = problem.next_experiments(fitted, (Place(fitted.layout.effects[-1], 0.5, ((RATIO, 0.5),)),))
    assert found and all(len(each.q) for each in found)
    assert words.startswith(("Measure", "No poses"))
