"""What no effect explains in runs between the encoders of all axes: named by what it follows, drafted."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.robot_file import load_robot

pytestmark = pytest.mark.slow
RUNS, STEP_S, DURATION_S, NOISE_RAD = 2, 0.02, 30.0, 5e-6
PULLED, PULLING, SIZE_RAD = 3, 1, 8e-5  # axes from 1: a hose that one pulls along


@pytest.fixture(scope="module")
def racer():
    robot = load_robot("racer-7-1.4")
    return replace(robot, links=None, joints=tuple(replace(j, cw=None, ccw=None) for j in robot.joints))


def to_and_fro(robot, pull):
    """Every axis to and fro at its own pace; pull: rad of axis PULLED, a function of the angle (N,) of
    PULLING."""
    random = np.random.default_rng(11)
    time = np.tile(np.arange(0.0, DURATION_S, STEP_S), RUNS)
    run = np.repeat(np.arange(1, RUNS + 1), len(time) // RUNS)
    pace = 0.17 + 0.043 * np.arange(robot.axes)
    phase = random.uniform(0.0, 2.0 * np.pi, (RUNS, robot.axes))[run - 1]
    output = 0.9 * np.sin(2.0 * np.pi * pace * time[:, None] + phase)
    q = output + random.normal(0.0, NOISE_RAD, output.shape)
    q[:, PULLED - 1] += pull(output[:, PULLING - 1])
    return Dataset.of_arrays("gear_run", {"theta": output * robot.ratios, "q": q}, time=time, run=run)


@pytest.fixture(scope="module")
def pulled(racer):
    data = to_and_fro(racer, lambda angle: SIZE_RAD * np.sin(2.0 * angle))
    return data, diagnose(racer, data)


def test_an_axis_that_another_one_pulls_at_is_no_floor_that_shakes(pulled):
    """The other axis goes to and fro at one frequency: a wave of 0.17 Hz in time was named."""
    _, result = pulled
    assert result.verdict == "unexplained"
    assert f"axis {PULLED} follows the angle of axis {PULLING}" in result.sentence
    assert "shakes" not in result.sentence and "Hz" not in result.sentence
    assert not any(finding.probability > 0.05 for finding in result.findings)


def test_it_is_drafted_as_it_was_made(pulled):
    _, result = pulled
    (draft,) = result.drafts
    assert draft.effect.joint == PULLED and draft.effect.of == (f"q_{PULLING}",) and draft.short
    angle = np.linspace(-0.8, 0.8, 9)
    effect = draft.effect
    numbers = {name: np.full(angle.size, value) for name, value in zip(effect.names, effect.values)}
    drawn = effect.formula({f"q_{PULLING}": angle, **numbers})[0]
    true = SIZE_RAD * np.sin(2.0 * angle)
    assert_allclose(drawn - drawn.mean(), true - true.mean(), atol=0.05 * SIZE_RAD)
    assert draft.held_out[1] < 0.5 * draft.held_out[0]
    assert "held_out_rms_rad" in draft.to_table()["evidence"]


def test_accepted_it_leaves_nothing(racer, pulled):
    data, result = pulled
    known = diagnose(replace(racer, effects=(result.drafts[0].effect,)), data)
    assert known.verdict == "no_undeclared_effect" and known.drafts == ()


def test_clean_runs_are_left_alone(racer):
    result = diagnose(racer, to_and_fro(racer, np.zeros_like))
    assert result.verdict == "no_undeclared_effect" and result.drafts == ()


def test_of_less_than_two_turns_of_a_motor_nothing_repeats(racer):
    """Where a file's motor angles are those of the axes, "within a revolution" was likelier than the angle,
    and no formula knows it."""
    direct = replace(racer, joints=tuple(replace(joint, ratio=1.0) for joint in racer.joints))
    result = diagnose(direct, to_and_fro(direct, lambda angle: 3.0 * SIZE_RAD * angle**3))
    assert [(draft.effect.joint, draft.effect.of) for draft in result.drafts] == [(PULLED, (f"q_{PULLING}",))]
    assert "revolution" not in result.sentence
