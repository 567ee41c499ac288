"""Known lengths of a fixture that are others: told by their name, with what the touches say."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.commands import diagnose as command
from exactarm.commands.calibrate import calibrate
from exactarm.errors import InputError
from exactarm.identify.closures import calibrate_closures, declare_closures, nominal_closures
from exactarm.identify.length_doubt import length_doubts
from exactarm.measurement.closures import touches
from exactarm.measurement.contacts import Sphere
from test_closures import ECCENTRICITY, touched


def doubts(robot, data) -> list[str]:
    return [line for line in calibrate_closures(robot.nominal, data).warnings if "the touches say" in line]


def with_radii(data, factor: float):
    radii = tuple(replace(each, length=factor * each.length) for each in data.fixture.radii)
    return replace(data, fixture=replace(data.fixture, radii=radii))


@pytest.mark.slow
@pytest.mark.parametrize(("contact", "count"), [("sphere", 30), ("bar", 30), ("plane", 20), ("socket", 15)])
def test_right_lengths_are_not_doubted(contact, count):
    for effects in ((), (ECCENTRICITY,)):
        robot, data = touched("panda", contact, 5, *effects, count=count)
        assert doubts(robot, data) == []


@pytest.mark.slow
def test_a_diameter_in_place_of_a_radius_is_told():
    """Of each of two spheres at three places: the first alone was."""
    robot, data = touched("panda", "sphere", 5, count=30)
    assert data.fixture.radii
    (line,) = doubts(robot, with_radii(data, 2.0))
    assert line.startswith("radius of sphere") and "is a diameter given for a radius?" in line
    assert line.count("radius of sphere") == 6


@pytest.mark.slow
def test_a_diagnosis_doubts_a_length_in_the_same_words_as_a_calibration():
    """And no right length, whatever the arm lacks."""
    told = lambda robot, data: [line for line in command.diagnose(robot.nominal, data, threads=1)["warnings"]
                                if "the touches say" in line]
    for effects in ((), (ECCENTRICITY,)):
        robot, data = touched("panda", "sphere", 5, *effects, count=30)
        assert told(robot, data) == []
    robot, data = touched("panda", "sphere", 5, count=30)
    (line,) = told(robot, with_radii(data, 2.0))
    assert line.startswith("radius of sphere") and "is a diameter given for a radius?" in line
    assert line.count("radius of sphere") == 6


@pytest.mark.slow
def test_a_fit_that_did_not_converge_doubts_nothing():
    """Of rows with wrong numbers the touches said 2.36e8 mm."""
    robot, data = touched("panda", "sphere", 5, count=30)
    rows = touches(with_radii(data, 2.0))
    found = declare_closures(robot.nominal, rows)
    stopped = replace(found.fit, fit=replace(found.fit.fit, reason="stopped"))
    assert length_doubts(found.fit, rows, found.pulls)
    assert not length_doubts(stopped, rows, found.pulls)


@pytest.mark.slow
def test_a_wire_whose_zero_is_elsewhere_is_told():
    """10 mm: without a word it made the arm four times worse than its drawing."""
    robot, data = touched("panda", "bar", 5, count=30)
    (line,) = doubts(robot, replace(data, length=data.length + 0.01))
    assert line.startswith("zero of bar 0") and "the touches say -9.99" in line


@pytest.mark.slow
def test_one_wrong_distance_among_right_ones_is_told():
    """1 mm, at one place of three: what the two others say of the scale is what doubts it. By the
    drawing's tolerance alone it passed without a word. The seed is that of the tests above."""
    robot, data = touched("panda", "socket", 5, count=20)
    sessions = np.unique(data.session)
    apart = [replace(each, session=int(session)) for session in sessions for each in data.fixture.distances]
    assert len(sessions) == 3 and len(apart) == 3
    right = replace(data, fixture=replace(data.fixture, distances=tuple(apart)))
    assert doubts(robot, right) == []
    apart[0] = replace(apart[0], length=apart[0].length + 1e-3)
    wrong = replace(data, fixture=replace(data.fixture, distances=tuple(apart)))
    (line,) = doubts(robot, wrong)
    assert line.startswith("socket 0 to 1 of session 1: the touches say") and "wrong one" not in line
    reports = [calibrate(robot.nominal, each).report for each in (wrong, right)]
    assert [report.tone for report in reports] == ["caution", "good"]
    assert ["is not to be used" in str(report) for report in reports] == [True, False]


@pytest.mark.slow
def test_known_radii_place_the_tool():
    """With free radii the tool and the centres could run off together, by kilometres."""
    robot, data = touched("panda", "sphere", 5, count=30)
    fit = nominal_closures(robot.nominal, touches(data), Layout.of(()))
    spheres = [effect for effect in fit.layout.effects if isinstance(effect, Sphere)]
    known = [data.fixture.radius_of("sphere", each.number, each.session) for each in spheres]
    assert len(spheres) >= 3 and all(known)
    found = [each.values[3] for each in spheres]
    np.testing.assert_allclose(found, [each.length for each in known], atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "contact"), [("panda", "socket"), ("ur10", "sphere"), ("panda", "plane")])
def test_a_distance_in_another_unit_is_refused_before_the_arm_is_bent_for_it(name, contact):
    """100 mm given in m, in inches, or another one by far; a fit to it takes minutes and says less."""
    robot, data = touched(name, contact, 1, count=20)
    for given, question in ((0.1e-3, "is it given in m?"), (3.937e-3, "is it given in inches?"),
                            (254e-3, "is it another one, or of others?")):
        wrong = tuple(replace(each, length=given) for each in data.fixture.distances)
        with pytest.raises(InputError, match="with the arm as its file says the touches are ") as refused:
            declare_closures(robot.nominal, replace(data, fixture=replace(data.fixture, distances=wrong)))
        assert question in refused.value.message
