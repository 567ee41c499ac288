"""A cause of which one is missing without a doubt, and none likelier than not, is not nothing."""

import json
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm import _core, cli
from exactarm.data.dataset import write_dataset
from exactarm.diagnose import selected, selection
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.posterior import Place
from exactarm.diagnose.problems import problem_for
from exactarm.diagnose.verdict import NOTHING, UNEXPLAINED
from exactarm.diagnose.vocabulary import vocabulary_of
from exactarm.effects import effect_from_table
from exactarm.effects.gear_ratio import GearRatio
from exactarm.effects.joint_compliance import BEND, JointCompliance
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits
from test_closures import touched
from test_diagnose_poses import data_with, ur10

SPRING = "joint_compliance joint=2 linear_rad_per_Nm=4e-6 cubic_rad_per_Nm3=0"


@pytest.mark.slow
def test_a_cause_that_cannot_be_told_from_others_is_told_with_them(monkeypatch):
    """A wire's end is pulled alike by a spring and a soft base (the spring: 0.92, 0.87 while touches did not
    go by how far the arm is from its drawing; the limit is raised to 0.95, then 0.9, from 0.7 while a base
    had the prior of six springs). "Nothing is missing" was said of an arm whose spring was 0.40 beside a
    payload and a base."""
    for module in (selected, selection):
        monkeypatch.setattr(module, "NAMED_AT", 0.95)
    robot, data = touched("ur10", "bar", 1, SPRING, count=20)
    result = diagnose(robot.nominal, data)
    assert not result.findings and result.verdict == UNEXPLAINED
    assert result.sentence.startswith("The model lacks something, but this data cannot tell which: joint "
                                      "compliance of axis 2 or ")


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["bar", "socket"])
def test_where_nothing_is_missing_nothing_is_undecided(contact):
    robot, data = touched("ur10", contact, 1, count=20)
    result = diagnose(robot.nominal, data)
    assert result.verdict == NOTHING and result.selection.undecided is None


@pytest.mark.parametrize("own, rivals, many", [
    (0.45, (0.3, 0.2), True), (0.6, (0.3,), False), (0.3, (0.1,), False), (0.45, (), False)])
def test_a_place_is_open_where_named_causes_fill_it_together(own, rivals, many):
    effect = GearRatio(1, (1e-4,))
    unknown = ("a function", None, 1.0 - own - sum(rivals))
    named = tuple((str(k), effect, p) for k, p in enumerate(rivals))
    assert Place("a", effect, own, 9.0, (*named, unknown), 0).one_of_many == many


def test_what_gives_way_of_a_heavy_arm_is_as_large_at_the_target_as_that_of_a_light_one():
    """5 urad/Nm of axis 2 are 0.26 mm RMS at the target of the UR10, and 13 mm of one 50 times as heavy. Per
    Nm, the base was named for a spring of an arm of 600 kg. Sizes alone: nothing hangs on the seed."""
    light = ur10()
    heavy = replace(light, links=tuple(replace(k, mass=50.0 * k.mass, inertia=50.0 * k.inertia)
                                       for k in light.links))
    data, sizes = data_with((), 80)[0], []
    for robot in (light, heavy):
        problem = problem_for(robot, data, data, 1, 0)
        fitted = problem.fit(problem.declared())
        (block,) = vocabulary_of(fitted, [JointCompliance.none_of(robot, 1)], []).blocks
        moved = fitted.responses_of([block.effect])[0][:, :3, 0]
        sizes.append((block.size[0], block.size[0] * np.sqrt(np.mean(np.sum(moved**2, axis=1)))))
    assert sizes[0][0] == 5e-6 and sizes[0][1] == pytest.approx(0.26e-3, rel=0.1)
    assert sizes[1][1] == pytest.approx(1e-3) and sizes[1][0] < 1e-6


def test_the_bend_of_a_spring_is_as_large_beside_it_for_arms_of_every_size():
    """An eighth of the spring at the target, whatever the arm weighs: 1e-12 rad/Nm^3, that of arms of 500 kg,
    was a thousandth of it on the UR10."""
    robot, data = ur10(), data_with((), 80)[0]
    problem = problem_for(robot, data, data, 1, 0)
    fitted = problem.fit(problem.declared())
    (block,) = vocabulary_of(fitted, [JointCompliance.none_of(robot, 1, cubic_free=True)], []).blocks
    moved = np.sqrt(np.mean(np.sum(fitted.responses_of([block.effect])[0][:, :3] ** 2, axis=1), axis=0))
    assert block.size[1] * moved[1] == pytest.approx(BEND * block.size[0] * moved[0])
    assert block.size[1] > 50e-12


def test_declared_springs_of_the_reference_robot_give_way_by_less_than_is_plausible():
    racer = load_robot("racer-7-1.4")
    q = joints_in_limits(racer, 500, np.random.default_rng(0))
    torque = _core.inverse_dynamics(racer.core, q, 0.0 * q, 0.0 * q)
    springs = np.array([joint.spring_linear for joint in racer.joints])
    given = np.sqrt(np.mean(np.square(torque), axis=0)) / springs
    assert given[1] == pytest.approx(0.9e-3, rel=0.1) and given.argmax() == 1


@pytest.mark.slow
def test_poses_that_leave_three_causes_open_say_so_and_what_would_tell(tmp_path):
    """A spring of 0.75 urad/Nm in 70 poses: a base, the spring and a run-out share it. "A structure that
    nothing in the library explains" was said, with a probability of one, and nothing to measure. Of 0.6, 0.7,
    0.8, 1.0 and 1.2 urad/Nm with seeds 80 and 81, one leaves it open and doubts that anything acts: 0.7
    before wobbles of axes and a tool that sags shared the prior of what could act (now nothing; 0.8 is open
    with 0.04 for nothing, 0.9 the spring), 0.6 until a base had the prior of one spring, not of all. The
    larger ones are the spring, or open; the smaller and those of seed 81 nothing."""
    spring = {"effect": "joint_compliance", "joint": 2, "linear_rad_per_Nm": 7.5e-7, "cubic_rad_per_Nm3": 0.0}
    data = data_with((effect_from_table(spring),), 80)[0]
    write_dataset(tmp_path / "poses.csv", data.select(np.arange(0, len(data), 2)), ur10())
    out = tmp_path / "out"
    assert cli.main(["diagnose", "ur10", str(tmp_path / "poses.csv"), "--out", str(out), "--quiet"]) == 0
    told = json.loads((out / "result.json").read_text())
    assert told["verdict"] == UNEXPLAINED and not (out / "draft.toml").exists()
    assert told["probability_nothing"] > 0.05  # else it would be sure that something is
    assert told["sentence"].startswith("The model probably lacks something, but this data cannot tell which")
    (unknown,) = told["effects"]
    assert unknown["probability"] == told["probability_something_else"] < 0.2
    asked = {(each["effect"], each["joint"]): each["probability"] for each in unknown["set"]}
    assert ("joint_compliance", 2) in asked and max(asked.values()) < 0.5 < sum(asked.values()) <= 1.0
    assert "joint compliance of axis 2" in told["next_experiment"]
    page = (out / "report.html").read_text()
    share = 100.0 * asked["joint_compliance", 2]
    assert "Which cause is missing" in page and ">joint compliance of axis 2<" in page
    assert f">{share:.1f} %<" in page
    designed = ea.design("ur10", diagnosis=out / "result.json")
    assert len(designed.tables["poses.csv"]) > 0
