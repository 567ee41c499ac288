"""The demo: steps run in their own folders, on files that come with the package, and one failure ends
nothing."""

import json
from types import SimpleNamespace

import pytest

from exactarm import cli
from exactarm.commands import demo
from exactarm.commands.demo_steps import STEPS, Step
from exactarm.commands.listing import find_commands
from exactarm.files.examples import data_path
from exactarm.report.html import render_html


def test_every_step_names_a_command_and_files_that_exist():
    folders, commands = set(), find_commands()
    for step in STEPS:
        assert step.words[0] in commands
        for word in step.words:
            for kind, path in demo.REFERENCE.findall(word):
                assert data_path(path).exists() if kind == "example" else path.split("/")[0] in folders
        assert step.folder not in folders
        folders.add(step.folder)


def test_the_page_begins_with_what_the_steps_have_brought():
    def ended(folder, before, after, real=True):
        step = Step(folder, folder, ("calibrate",), real, headline=f"{folder}, after")
        json = {"before": {"validation": {"mean": before}}, "after": {"validation": {"mean": after}}}
        return demo.Outcome(step, 1.0, SimpleNamespace(json=json, report=None))

    report = demo._report([ended("arm", 1e-3, 1e-4), ended("gear", 2e-3, 1e-3),
                           ended("plan", 1e-3, 1e-9, real=False)], [])
    assert "is now 10 to 50 % of what it was. 3 of 3 steps done" in report.verdict
    page = render_html(report)
    assert page.index("arm, after") < page.index("All steps") and "1.00 nm" in page
    assert page.count('class="short" data-name') == 0 and '<td data-name="report" class="short">' in page


@pytest.mark.slow
def test_a_failed_step_is_told_and_the_others_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(demo, "STEPS", (
        Step("broken", "A robot that nobody has", ("evaluate", "nobody", "{example/ur10/series_B.csv}")),
        Step("judged", "The nominal arm", ("evaluate", "ur10", "{example/ur10/series_B.csv}"),
             picture="error_histogram"),
    ))
    assert cli.main(["demo", "--out", str(tmp_path / "demo")]) == 1
    result = json.loads((tmp_path / "demo/result.json").read_text())
    broken, judged = result["steps"]
    assert (
        "nobody: no robot of that name" in broken["failure"]
        and not (tmp_path / "demo/broken/result.json").exists()
    )
    assert judged["validation_mean_after"] == pytest.approx(0.00103, rel=0.1) and judged["unit"] == "m"
    assert json.loads((tmp_path / "demo/judged/result.json").read_text())["command"] == "evaluate"
    page = (tmp_path / "demo/report.html").read_text()
    # the picture that tells most of a step
    assert (tmp_path / "demo/plots/judged_error_histogram.svg").exists()
    assert 'href="judged/report.html"' in page and "1 of 2 steps done" in page
    assert "warning: broken: nobody: no robot of that name" in capsys.readouterr().out


def test_an_unknown_step_is_bad_input(tmp_path, capsys):
    assert cli.main(["demo", "--steps", "dance", "--out", str(tmp_path / "demo")]) == 2
    assert "no step 'dance'" in capsys.readouterr().err
