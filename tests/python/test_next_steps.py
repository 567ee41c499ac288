"""After a fit the page says what to do: with a robot file that is better, and with one that is not."""

from dataclasses import replace

import exactarm as ea
from exactarm.commands.next_steps import next_steps
from exactarm.kinds import GEAR_RUN, POSES


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
