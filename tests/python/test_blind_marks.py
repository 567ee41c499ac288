"""The scorer and the marks of bench/blind, on results written by hand."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import exactarm

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "bench"))

from blind.marks import printed, summary  # noqa: E402
from blind.scorer import score, shrink_library  # noqa: E402

CASE = {
    "arm": "a",
    "foreign": False,
    "noise": 1.0,
    "best": 1.0,
    "rows": 9,
    "has": [],
    "seconds": 1.0,
    "before": 3.0,
    "probability": [0.95],
    "hits": [True],
    "named": ["backlash_2"],
    "missed": [],
}
RIGHT = CASE | {
    "seed": 1,
    "hidden": ["backlash_2"],
    "raised": 2.0,
    "score": "right",
    "after": 1.0,
    "against_best": 1.0,
}
WRONG = RIGHT | {
    "seed": 2,
    "score": "wrong",
    "hits": [False],
    "after": 4.0,
    "against_best": 4.0,
    "missed": ["backlash_2"],
}
CLEAN = CASE | {
    "seed": 3,
    "hidden": [],
    "raised": 1.0,
    "score": "wrong",
    "hits": [False],
    "after": 3.0,
    "against_best": 1.0,
}

BACKLASH = {
    "effect": "backlash",
    "joint": 2,
    "probability": 0.97,
    "parameters": {"width_rad": {"value": 4e-4, "ci95": [3e-4, 5e-4]}, "friction_Nm": 10.0},
}
SUMMARY = {"identification": {"n": 7, "rms": 2.0}, "validation": {"n": 3, "rms": 1.5}}
RESULT = {
    "effects": [BACKLASH],
    "alternatives": [],
    "verdict": "explained",
    "before": SUMMARY,
    "after": SUMMARY,
    "noise_floor": 1.0,
    "sentence": "",
}


def hidden(effect="backlash", joint=2, **more) -> dict:
    return {
        "effect": effect,
        "joint": joint,
        "size": 4e-4,
        "foreign": False,
        "parameters": {"width_rad": 4e-4},
    } | more


def test_marks_count_what_they_say():
    marks = summary([RIGHT, WRONG, CLEAN])
    assert marks["first_right_when_clear"] == 0.5
    assert marks["by_effect"] == {"backlash": "1/2"}
    assert marks["clean_with_effects"] == 1.0
    assert marks["false_alarms"]["of"] == "1/1"
    assert marks["validation_grew"] == [2]
    assert marks["right_of_0.95"]["of"] == "1/3"
    assert marks["right_of_0.99"]["of"] == "0/0"
    assert marks["reliability"]["0.95-0.98"] == pytest.approx(
        {"right": "1/3", "stated": 0.95, "share": 1 / 3}
    )
    assert marks["expected_calibration_error"] == pytest.approx(0.95 - 1 / 3)


def test_calibration_error_weighs_each_bin_by_its_statements():
    sure = [RIGHT | {"probability": [1.0], "hits": [True]}] * 3
    half = [RIGHT | {"probability": [0.6], "hits": [hit]} for hit in (True, False)]
    marks = summary(sure + half)
    assert marks["expected_calibration_error"] == pytest.approx(2 / 5 * 0.1)


def test_share_comes_with_the_exact_binomial_interval():
    quiet = [CLEAN | {"named": [], "probability": [], "hits": []}] * 10
    low, high = summary(quiet)["false_alarms"]["ci95"]
    assert low == 0.0
    assert high == pytest.approx(1.0 - 0.025 ** (1 / 10))  # Clopper and Pearson, none of ten


def test_marks_are_told_by_condition_and_print():
    records = [
        RIGHT | {"conditions": {"student": 4.0}},
        WRONG | {"conditions": {}},
        CLEAN | {"conditions": {"student": 9.0}},
    ]
    marks = summary(records)
    assert marks["by_condition"] == {
        "student": {
            "cases": 2,
            "clear_first_right": "1/1",
            "clean_with_effects": "1/1",
            "after_over_best_median": 1.0,
        }
    }
    assert "clear_first_right 1/1" in printed(json.loads(json.dumps(marks)))


@pytest.mark.parametrize("true, held", [(4e-4, True), (6e-4, False)])
def test_intervals_are_held_against_the_truth(true, held):
    record = score(RESULT, {"effects": [hidden(parameters={"width_rad": true})], "best": 1.0})
    assert record["score"] == "right" and record["intervals"] == {"backlash_2.width_rad": held}


def test_intervals_of_a_wrong_axis_are_not_judged():
    record = score(RESULT, {"effects": [hidden(joint=3)], "best": 1.0})
    assert record["score"] == "wrong" and record["intervals"] == {}


def test_something_else_is_no_named_effect():
    unknown = {"effect": "unknown", "joint": 3, "parameters": {}, "probability": 1.0}
    found = RESULT | {"effects": [unknown], "verdict": "unexplained"}
    record = score(found, {"effects": [hidden("cable_force", foreign=True)], "best": 1.0})
    assert record["named"] == [] and record["else_joint"] == [3] and record["score"] == "right"


def test_credible_set_holds_a_hidden_cause_by_name_and_axis():
    members = [
        {"effect": "hysteresis", "joint": 2, "probability": 0.6},
        {"effect": "backlash", "joint": 2, "probability": 0.4},
    ]
    found = RESULT | {"effects": [BACKLASH | {"effect": "hysteresis", "set": members}]}
    of = lambda joint: score(found, {"effects": [hidden(joint=joint)], "best": 1.0})["sets"]
    assert of(2) == [True] and of(4) == [False]


def test_coupling_is_known_by_its_motor():
    coupling = {"effect": "joint_coupling", "joint": 6, "probability": 0.9, "parameters": {"motor": 5}}
    cause = {"effect": "joint_coupling", "joint": 6, "size": 1.0, "foreign": False, "motor": 5}
    found = RESULT | {"effects": [coupling]}
    assert score(found, {"effects": [cause], "best": 1.0})["score"] == "right"
    assert score(found, {"effects": [cause | {"motor": 4}], "best": 1.0})["score"] == "wrong"


@pytest.mark.slow
def test_an_effect_can_be_taken_out_of_the_library():
    words = (
        "import sys; sys.path[:0] = sys.argv[1:3]; from blind.scorer import shrink_library; "
        "from exactarm.effects import library; shrink_library(('backlash',)); "
        "assert 'backlash' not in library() and 'payload' in library()"
    )
    # where the extension is built, which a source tree need not hold
    program = Path(exactarm.__file__).parents[1]
    subprocess.run([sys.executable, "-c", words, str(TOP / "bench"), str(program)], check=True)


def test_nothing_is_taken_out_unasked():
    from exactarm.effects import library

    before = set(library())
    shrink_library(())
    assert set(library()) == before
