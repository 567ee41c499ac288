"""After a fit the page says what to do: with a robot file that is better, and with one that is not."""

from dataclasses import replace
from types import SimpleNamespace

import exactarm as ea
from exactarm.commands.check import _next
from exactarm.commands.next_steps import next_steps, to_improve
from exactarm.kinds import GEAR_RUN, MOTION, POSES


def test_a_fit_that_pays_is_used_judged_anew_and_diagnosed():
    robot = ea.load_robot("ur10")
    use, judge, diagnose = next_steps(robot, POSES, 1e-3, 4e-4).paragraphs
    assert "exactarm compensate" in use and "twenty new poses" in judge and "exactarm diagnose" in diagnose
    use, judge, _ = next_steps(replace(robot, has_geometry=False), GEAR_RUN, 1e-3, 4e-4).paragraphs
    assert "compensate" not in use and "Record the gears once more" in judge


def test_a_fit_that_does_not_pay_leaves_the_robot_file():
    keep, diagnose = next_steps(ea.load_robot("ur10"), POSES, 1e-3, 0.95e-3).paragraphs
    assert keep.startswith("Keep your robot file") and "exactarm diagnose" in diagnose


def test_the_page_of_a_calibration_says_it_before_the_evidence():
    report = ea.calibrate("ur10", "ur10/series_B", threads=1).report
    assert [getattr(section, "heading", "") for section in report.sections][1] == "What to do next"


def test_a_judgement_names_the_commands_that_lower_the_error():
    for kind, command in ((POSES, "calibrate"), (GEAR_RUN, "gear"), (MOTION, "identify")):
        (line,) = to_improve(kind).paragraphs
        assert f"`exactarm {command}` and `exactarm diagnose`" in line


def test_an_alarm_says_where_to_look_and_one_that_nothing_explains_asks_for_a_diagnosis():
    look, anew = _next(SimpleNamespace(unexplained=1.0))
    assert "collision" in look and "exactarm calibrate" in anew and "BEFORE" in anew
    (line,) = _next(SimpleNamespace(unexplained=0.0))
    assert "exactarm diagnose" in line
