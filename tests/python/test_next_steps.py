"""After a fit the page says what to do: with a robot file that is better, and with one that is not."""

import html
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import exactarm as ea
from exactarm import cli
from exactarm.commands.gear_report import _as_declared
from exactarm.commands.next_steps import after_check, next_steps, to_improve, with_lines
from exactarm.commands.outcome import Asked, Outcome
from exactarm.data.kinds import GEAR_RUN, MOTION, POSES
from exactarm.data.rows import Source
from exactarm.report import Report, Text
from exactarm.report.sections import line_to_copy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from robustness.short_runs import prepare, words_of


def test_a_fit_that_pays_is_used_judged_anew_and_diagnosed():
    robot = ea.load_robot("ur10")
    use, judge, diagnose = next_steps(robot, POSES, 1e-3, 4e-4).paragraphs
    assert "exactarm compensate" in use and "twenty new poses" in judge and "exactarm diagnose" in diagnose
    use, judge, _ = next_steps(replace(robot, has_geometry=False), GEAR_RUN, 1e-3, 4e-4).paragraphs
    assert "compensate" not in use and "Record the gears once more" in judge


def test_a_fit_that_does_not_pay_leaves_the_robot_file():
    keep, diagnose = next_steps(ea.load_robot("ur10"), POSES, 1e-3, 0.95e-3).paragraphs
    assert keep.startswith("Keep your robot file") and "exactarm diagnose" in diagnose


def test_a_model_that_is_warned_of_is_not_handed_out():
    look, diagnose = next_steps(ea.load_robot("ur10"), POSES, 1e-3, 4e-4, worse=True).paragraphs
    assert look.startswith("Look at the largest errors before") and "exactarm diagnose" in diagnose


@pytest.mark.slow
def test_the_page_of_a_calibration_says_it_before_the_evidence():
    report = ea.calibrate("ur10", "ur10/series_B", threads=1).report
    assert [getattr(section, "heading", "") for section in report.sections][1] == "What to do next"


def test_a_judgement_names_the_commands_that_lower_the_error():
    for kind, command in ((POSES, "calibrate"), (GEAR_RUN, "gear"), (MOTION, "identify")):
        (line,) = to_improve(kind).paragraphs
        assert f"`exactarm {command}` and `exactarm diagnose`" in line


def test_an_alarm_says_where_to_look_and_one_that_nothing_explains_asks_for_a_diagnosis():
    look, anew = after_check(unexplained=False).paragraphs
    assert "collision" in look and "exactarm calibrate" in anew and "BEFORE" in anew
    assert "`session`" in after_check(unexplained=False, base=True).paragraphs[0]
    (line,) = after_check(unexplained=True).paragraphs
    assert "exactarm diagnose" in line


# -- lines to copy -----------------------------------------------------------------------------------------
def lines_of(report) -> list[str]:
    return [line for section in report.sections if isinstance(section, Text)
            for line in map(line_to_copy, section.paragraphs) if line]


TOLD = ("plan", "design", "certify", "compensate", "check", "evaluate", "export", "calibrate",
        "identifiable")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With a space in its name, as folders of people have."""
    made = tmp_path_factory.mktemp("next steps") / "of all commands"
    prepare(made)
    return made


@pytest.mark.slow
@pytest.mark.parametrize("command", TOLD)
def test_the_line_to_copy_runs_as_it_stands(command, folder, tmp_path, capsys):
    """In the text of the terminal it is unbroken, in the page it is whole."""
    out = tmp_path / "my results"
    assert cli.main([word for word in words_of(command, folder, out) if word != "--quiet"]) == 0
    printed = capsys.readouterr().out
    page = re.sub(r'<span class="whole">(.*?)</span>', r"\1", (out / "report.html").read_text())
    page = html.unescape(page)
    lines = [line.strip() for line in printed.split("What to do next\n")[1].split("\n\n")[0].splitlines()
             if line.startswith("    ")]
    assert len(lines) == 1 and f"<pre>{lines[0]}</pre>" in page
    words = shlex.split(lines[0])
    if words[0] == "diff":
        done = subprocess.run(words, capture_output=True, text=True)
        assert done.returncode == 1 and "movej" in done.stdout  # there are differences
        return
    if command == "check":
        assert words[2:5] == ["ur10", str(folder / "poses.csv"), str(folder / "day.csv")]
    if "NEXT.csv" in words:  # the one file that nobody has written yet: the day, a little later
        place = words.index("NEXT.csv")
        day = (folder / "day.csv").read_text().splitlines()
        (tmp_path / "NEXT.csv").write_text("\n".join([day[0], *reversed(day[1:])]) + "\n")
        words[place] = str(tmp_path / "NEXT.csv")
    assert words[0] == "exactarm"
    assert cli.main([*words[1:], "--quiet", "--threads", "1"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("words, following", [
    (("simulate", "ur10", "--count", "40"), "calibrate"),
    (("simulate", "racer-7-1.4", "--measure", "gear", "--joint", "2", "--rate", "200"), "gear"),
    (("simulate", "racer-7-1.4", "--measure", "motion", "--runs", "2", "--seconds", "4"), "identify"),
    (("simulate", "panda", "--measure", "closures", "--count", "20"), "calibrate"),
    (("simulate", "racer-7-1.4", "--compare", "line", "--rate", "100"), "plan"),
    (("design", "ur10", "--contact", "socket", "--count", "12"), None),
    (("export", "ur10", "--format", "offsets"), None),
])
def test_what_follows_depends_on_what_was_made(words, following, tmp_path, capsys):
    assert cli.main([*words, "--out", str(tmp_path / "made"), "--threads", "1"]) == 0
    told = capsys.readouterr().out.split("What to do next\n")[1].split("\n\n")[0]
    lines = [line.strip() for line in told.splitlines() if line.startswith("    ")]
    assert [shlex.split(line)[1] for line in lines] == ([following] if following else [])
    for line in lines:
        assert cli.main([*shlex.split(line)[1:], "--quiet", "--threads", "1"]) == 0


def test_a_line_reads_the_files_as_the_run_did():
    """Options that say how the data are read are part of it; shipped data keep their short name."""
    words = ["evaluate", "kr300", "kr300/run_A", "--kind", "gear_run", "--map", "a=b", "--out", "o"]
    asked = Asked("evaluate", shlex.join(["exactarm", *words]), "kr300",
                  (Source(str(ea.example("kr300/run_A")), "", 9),), 0, ("--kind", "gear_run", "--map", "a=b"))
    result = Outcome({}, Report("t", "v"))
    (line,) = lines_of(with_lines(result.report, result, asked, Path("a folder/o")))
    assert line == ("exactarm diagnose kr300 kr300/run_A --kind gear_run --map a=b "
                    "--out 'a folder/o_diagnosed'")
    (line,) = lines_of(with_lines(result.report, result, asked, Path(".")))
    assert line.endswith("--out diagnosed")


def test_a_robot_that_only_python_knows_is_no_file_to_name():
    result = Outcome({}, Report("t", "v"))
    asked = Asked("certify", "exactarm.certify(robot, data)", "ur10")
    (line,) = lines_of(with_lines(result.report, result, asked, Path("o")))
    assert line.startswith("exactarm design ROBOT ")


def test_corners_are_calibrated_with_their_board():
    result = Outcome({}, Report("t", "v"), tables={"corners.csv": {}})
    asked = Asked("corners", "exactarm corners ur10 j.csv a.png --fixture board.toml --out o", "ur10", (), 0,
                  ("--fixture", "board.toml"))
    (line,) = lines_of(with_lines(result.report, result, asked, Path("o")))
    assert line == "exactarm calibrate ur10 o/corners.csv --fixture board.toml --out o_calibrated"
    touched = replace(asked, command="identifiable")  # of a fixture, `design` needs more than the robot
    assert lines_of(with_lines(result.report, result, touched, Path("o"))) == []


def test_a_gear_that_falls_is_told_beside_the_tables_of_the_file():
    """An error that falls tenfold and "keep your robot file" stood below each other without the reason."""
    assert _as_declared(2.5e-3, 2.5e-4, "rad/s") == " (as the file has it: 0.250 mrad/s)"
    assert _as_declared(2.5e-3, 2.5e-3, "rad/s") == ""


def test_touches_are_diagnosed_with_the_springs_that_a_calibration_found(tmp_path, capsys):
    made, out = tmp_path / "made", tmp_path / "calibrated"
    words = ["simulate", "panda", "--measure", "closures", "--count", "60", "--out", str(made)]
    assert cli.main(words) == 0
    fixture, data = made / "fixture.toml", made / "closures.csv"
    assert cli.main(["calibrate", "panda", str(data), "--fixture", str(fixture), "--out", str(out)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"exactarm diagnose {out / 'robot.toml'} {data}" in said
    assert "with this `robot.toml` and the same files" in said


def test_a_file_that_was_judged_at_its_own_poses_is_still_named(tmp_path, capsys):
    made = tmp_path / "made"
    assert cli.main(["simulate", "ur10", "--count", "40", "--out", str(made)]) == 0
    data = str(made / "measured.csv")
    assert cli.main(["evaluate", "ur10", data, "--at", data, "--out", str(tmp_path / "judged")]) == 0
    assert f"exactarm diagnose ur10 {data}" in " ".join(capsys.readouterr().out.split())
