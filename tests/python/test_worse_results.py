"""A result that is worse than what it began with says so."""

import numpy as np
import pytest

from exactarm.commands.result import CommandResult
from exactarm.report import Report


def result(before, after):
    sets = {"before": {"validation": {"rms": before}}, "after": {"validation": {"rms": after}}}
    return CommandResult(sets, Report("T", "V.", tone="good"))


@pytest.mark.parametrize("before, after, told", [
    (0.37, 5.48, True), (1.0, 1.04, False), (1.0, 0.5, False), (None, 1.0, False), (float("nan"), 1.0, False),
])
def test_a_worse_model_is_told(before, after, told):
    done = result(before, after).warned(())
    assert bool(done.json.get("warnings")) == told and (done.report.tone == "caution") == told
    if told:
        assert "rises from 0.370 to 5.48" in done.warnings[0]


@pytest.mark.parametrize("wild, told", [(4e-3, True), (4e-4, False)])
def test_the_row_that_alone_makes_it_worse_is_named(wild, told):
    """The mean falls, and one of ten rows that were never fitted lies far off; or all are somewhat worse."""
    after = np.append(np.full(9, 2e-4 if told else 6e-4), wild)
    sets = np.repeat(["identification", "validation"], [3, 10])
    error = lambda held_out: np.append(np.zeros(3), held_out)
    before = np.full(10, 5e-4)
    rms = lambda error: {"validation": {"rms": float(np.sqrt(np.mean(error**2)))}}
    rows = {"file": ["a/poses.csv"] * 13, "row": np.arange(1, 14), "set": sets,
            "error_before_m": error(before), "error_after_m": error(after)}
    done = CommandResult({"before": rms(before), "after": rms(after), "unit": "m"}, Report("T", "V."),
                         tables={"residuals.csv": rows})
    (said,) = done.warned(()).warnings
    assert ("row 13 of poses.csv makes it so, by 4.00 mm: without it the error falls from 0.500 mm to 0.200 "
            "mm" in said) == told and said.count(";") == told


def test_what_has_no_before_is_left_alone():
    plain = CommandResult({"error": {"rms": 1.0}}, Report("T", "V."))
    assert plain.warned(()) is plain
