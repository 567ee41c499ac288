"""Where loads come from, what is said of it, and which measured torques are suspected."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.load_mistakes import load_mistakes
from exactarm.identify.compliance import compliance_layout
from exactarm.identify.loads import guess_line, kept_masses, load_json, load_lines, with_loads
from exactarm.identify.rest_torque import as_drives_hold
from exactarm.robot.generic_masses import with_generic_masses
from three_arms import puma

ROWS = 60
BARE = replace(puma(), links=None)


def poses(**more):
    q = np.random.default_rng(8).uniform(-2.0, 2.0, (ROWS, 6))
    return Dataset.of_arrays("poses", {"q": q} | more, position=np.zeros((ROWS, 3)))


def with_torques(factor=1.0, noise=1.0):
    data = poses()
    tau = _core.gravity_torque(puma().core, data.joints["q"], 1)
    tau = factor * tau + np.random.default_rng(9).normal(0.0, noise, tau.shape)
    return replace(data, joints=data.joints | {"tau": tau})


def with_payloads(*masses):
    return replace(poses(), covariates={"payload_kg": np.resize(np.array(masses, float), ROWS)})


def test_a_robot_with_masses_is_never_touched():
    assert with_loads(puma(), poses()) is not BARE and with_loads(puma(), poses()).links == puma().links
    for data in (poses(), with_torques(), with_payloads(0.0, 5.0)):
        assert not with_loads(puma(), data).generic_masses


def test_measured_torques_give_generic_masses_their_size():
    data = with_torques()
    found = with_loads(BARE, data)
    q = data.joints["q"]
    real, guessed = (_core.gravity_torque(robot.core, q, 1)[:, 1:3] for robot in (puma(), found))
    assert np.sqrt(np.mean((real - guessed) ** 2) / np.mean(real**2)) < 0.2
    assert found.generic_masses


@pytest.mark.parametrize("data", [with_torques(-1.0), with_torques(0.0, 30.0)], ids=["sign", "noise"])
def test_torques_that_are_not_gravity_do_not(data):
    assert with_loads(BARE, data) == with_generic_masses(BARE)


@pytest.mark.parametrize("kind", ["motion", "gear_run"])
def test_drives_and_gears_never_see_generic_masses(kind):
    assert with_loads(with_generic_masses(BARE), replace(poses(), kind=kind)) == BARE


def test_a_tracked_motion_sees_generic_masses():
    assert with_loads(BARE, replace(poses(), kind="tracked_motion")) == with_generic_masses(BARE)


def test_generic_masses_stay_in_a_result_only_with_an_effect_that_needs_a_load():
    found = with_generic_masses(BARE)
    sag = JointCompliance.none_of(found, 1)
    assert kept_masses(found, BARE) == BARE
    assert kept_masses(replace(found, effects=(sag,)), BARE).generic_masses
    assert kept_masses(BARE, found) == found


def test_what_is_said_names_every_source():
    assert guess_line(puma(), poses()) is None and load_lines(puma(), poses()) == ()
    assert "generic distribution" in guess_line(with_loads(BARE, poses()), poses())
    data = with_torques()
    loaded = with_loads(BARE, data)
    assert guess_line(loaded, data) is None
    assert "axes 1, 2, 3, 4, 5 and 6 is the torque that was measured" in load_lines(loaded, data)[0]
    carried = with_payloads(0.0, 2.5, 5.0)
    assert "0, 2.5, 5 kg" in load_lines(with_loads(BARE, carried), carried)[0]
    assert "by the known payloads" in guess_line(with_loads(BARE, carried), carried)
    assert "to make it absolute" in guess_line(with_loads(BARE, with_payloads(5.0)), with_payloads(5.0))
    assert load_json(loaded, data)["source"] == ["measured"] * 6
    assert load_json(with_loads(BARE, poses()), poses())["source"] == ["generic"] * 6


def test_springs_are_estimated_by_themselves_only_under_a_load_that_is_known():
    def axes(robot, data):
        return [effect.joint for effect in compliance_layout(with_loads(robot, data), data).effects]

    assert axes(BARE, poses()) == []
    assert axes(BARE, with_torques()) == axes(puma(), poses()) == [2, 3]
    assert axes(BARE, with_payloads(5.0)) == [] and axes(BARE, with_payloads(0.0, 5.0))[:2] == [2, 3]


@pytest.mark.parametrize("robot", [puma(), BARE], ids=["declared", "generic"])
@pytest.mark.parametrize("factor, says", [
    (1.0, None), (-1.0, None), (1000.0, "times as much"), (1e-3, "times as much"),
])
def test_implausible_torques_are_said_and_good_ones_are_not(robot, factor, says):
    found = [each.text for each in load_mistakes(robot, with_torques(factor, noise=abs(factor)))]
    assert (found == []) if says is None else (len(found) == 1 and says in found[0])


@pytest.mark.parametrize("robot", [puma(), BARE], ids=["declared", "generic"])
def test_torques_of_a_sensor_that_shows_the_load_are_taken_with_the_other_sign(robot):
    """Of either sign they are the same load; a second time nothing is turned."""
    held, shown = with_torques(1.0, noise=1.0), with_torques(-1.0, noise=1.0)
    assert as_drives_hold(robot, held) is held
    turned = as_drives_hold(robot, shown)
    np.testing.assert_array_equal(turned.joints["tau"], -shown.joints["tau"])
    (note,) = turned.notes
    assert "run against gravity (correlation -0.9" in note and "the opposite sign" in note
    assert as_drives_hold(robot, turned) is turned


def test_a_current_without_a_constant_is_said():
    current = np.random.default_rng(1).normal(0.0, 1.0, (ROWS, 6))
    data = poses(current=current)
    data = replace(data, position=predict_poses(BARE, Layout.of(()), data, tangents=False).position)
    assert "torque_constant_Nm_A" in first_aid(BARE, data)[0]
