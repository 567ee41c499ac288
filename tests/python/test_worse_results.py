"""A result that is worse than what it began with says so."""

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
        assert "rises from 0.37 to 5.48" in done.warnings[0]


def test_what_has_no_before_is_left_alone():
    plain = CommandResult({"error": {"rms": 1.0}}, Report("T", "V."))
    assert plain.warned(()) is plain
