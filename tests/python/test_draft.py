"""Drafts: an effect that the library lacks is written as a formula, accepted, and found again by its name."""

import json
import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from exactarm import cli
from exactarm.data.dataset import write_dataset
from exactarm.data.split import DEFAULT_SEED
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.dictionary import forms_of, is_series
from exactarm.diagnose.draft import Draft, _suspect, gaps_in_words, gaps_of
from exactarm.numerics.formula import Formula, divisors, linear_names
from exactarm.robot_file import load_robot, write_robot
from set_ups import measured, true_robot

NOISE_M, POSES = 5e-5, 160
# Turns of an axis (from 1) that no effect of the library makes: name -> (axis, signals, turn in rad of angles
# (N, 6) and humidity (N,)).
FOREIGN = {
    "square of a sum": (5, {"q_4", "q_6"}, lambda q, h: 3e-4 * (q[:, 3] + q[:, 5]) ** 2),
    "product": (6, {"q_2", "q_3"}, lambda q, h: 4e-4 * q[:, 1] * q[:, 2]),
    "second harmonic of another axis": (2, {"q_5"}, lambda q, h: 3e-4 * np.sin(2.0 * q[:, 4] + 0.4)),
    "saturation over a covariate": (3, {"humidity"}, lambda q, h: 4e-4 * np.tanh((h - 50.0) / 8.0)),
    # was a series, which its own plausible sizes kept from being found again
    "worn place": (3, {"q_3"}, lambda q, h: 1e-3 * np.exp(-(((q[:, 2] + 0.6) / 0.3) ** 2))),
    "no formula of the dictionary": (
        4,
        {"q_2"},
        lambda q, h: 6e-4 * np.exp(-2.0 * (q[:, 1] - 0.8) ** 2) - 4e-4 * (q[:, 1] < -1.2),
    ),
}


def poses(turn, axis=1, seed=6):
    """Poses of a UR10 whose axis is turned further by `turn`; the same noise whatever the turn is."""
    rng, robot = np.random.default_rng(seed), load_robot("ur10")
    q, humidity = rng.uniform(-2.5, 2.5, (POSES, 6)), rng.uniform(30.0, 70.0, POSES)
    true, stands = true_robot(robot, rng, 0.3), q.copy()
    stands[:, axis - 1] += turn(q, humidity)
    data = measured(robot, [true], [stands], NOISE_M, rng, covariates={"humidity": humidity})
    return robot, replace(data, joints={"theta": (q - robot.controller_offsets) * robot.controller_ratios})


@pytest.fixture(autouse=True)
def own_library(tmp_path, monkeypatch):
    monkeypatch.setenv("EXACTARM_EFFECTS", str(tmp_path / "mine"))


@pytest.fixture(scope="module")
def best():
    """Held-out RMS error of the same poses with the same noise, and without any cause, m."""
    return diagnose(*poses(lambda q, h: 0.0)).before["validation"].rms


@pytest.mark.slow
@pytest.mark.parametrize("name", FOREIGN)
def test_a_foreign_effect_is_drafted_accepted_and_found_by_its_name(name, tmp_path, best):
    axis, signals, turn = FOREIGN[name]
    robot, data = poses(turn, axis)
    write_dataset(tmp_path / "measured.csv", data, robot)
    call = ["diagnose", "ur10", str(tmp_path / "measured.csv"), "--out"]
    assert cli.main([*call, str(tmp_path / "first")]) == 0
    first = json.loads((tmp_path / "first" / "result.json").read_text())
    assert first["verdict"] == "unexplained"
    draft = tmp_path / "first" / "draft.toml"
    entry = tomllib.loads(draft.read_text())["effects"][0]
    assert (entry["station"], entry["joint"], set(entry["of"]), entry["status"]) == (
        "SPRING",
        axis,
        signals,
        "draft",
    )
    assert (
        first["drafts"][0]["form"] == entry["form"]
        and "draft.toml" in (tmp_path / "first" / "report.html").read_text()
    )
    assert set(entry["measured_between"]) == signals and entry["suspect"]
    assert cli.main(["accept", str(draft), "--out", str(tmp_path / "accepted")]) == 0
    assert cli.main([*call, str(tmp_path / "second")]) == 0
    second = json.loads((tmp_path / "second" / "result.json").read_text())
    assert ("expression", axis) in {(e["effect"], e["joint"]) for e in second["effects"]}
    assert second["after"]["validation"]["rms"] <= 1.10 * best
    assert second["after"]["validation"]["rms"] < first["after"]["validation"]["rms"]
    assert not second["drafts"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_drafted_on_clean_data(seed):
    assert not diagnose(*poses(lambda q, h: 0.0, seed=20 + seed)).drafts


@pytest.mark.slow
def test_what_held_out_rows_speak_against_is_no_draft():
    """A turn that is the other way round in the rows that were not fitted."""
    axis, _, turn = FOREIGN["square of a sum"]
    fitted = poses(lambda q, h: 0.0)[1].split(DEFAULT_SEED)
    found = diagnose(*poses(lambda q, h: np.where(fitted, 1.0, -1.0) * turn(q, h), axis))
    assert found.verdict == "unexplained" and not found.drafts and not found.findings
    assert diagnose(*poses(turn, axis)).drafts


def test_a_gap_is_an_interval_that_even_scatter_would_not_leave():
    rng = np.random.default_rng(3)
    even = rng.uniform(-2.0, 2.0, 200)
    assert gaps_of(even) == ()
    ((low, high),) = gaps_of(even[(even < 0.3) | (even > 0.9)])
    assert low == pytest.approx(0.3, abs=0.1) and high == pytest.approx(0.9, abs=0.1)


def test_long_names_of_signals_leave_formulas_that_can_be_read():
    rng = np.random.default_rng(1)
    names = ("torque_3", "temperature_of_the_room_degC", "s" * 900)
    forms = forms_of(4, {name: rng.uniform(-93.1, 21.7, 300) for name in names})
    assert {"torque_3", "temperature_of_the_room_degC"} <= {name for form in forms for name in form.of}
    for form in forms:
        assert Formula.of(form.form)
    assert any(is_series(form) and len(form.of) == 2 for form in forms)


def test_formulas_know_which_parameters_they_are_linear_in():
    formula = Formula.of("a*tanh((x - c)/w) + b*x + d*b")
    assert linear_names(formula, ("a", "c", "w", "b", "d")) == ("a", "b")
    assert {"w"} <= divisors(formula) and not {"a", "b", "c"} & divisors(formula)


def test_every_form_of_the_dictionary_is_a_formula_of_plausible_size():
    rng = np.random.default_rng(1)
    signals = {"q_2": rng.uniform(-2.0, 1.0, 300), "torque_3": rng.uniform(-90.0, 20.0, 300)}
    forms = forms_of(4, signals)
    assert any(is_series(form) for form in forms)
    for form in forms:
        numbers = {name: np.full(300, value) for name, value in zip(form.names, form.values)}
        slopes = form.formula(signals | numbers)[1]
        for name, size in zip(form.names, form.plausible):
            if name in form.linear and not is_series(form):
                assert size * np.std(slopes[name]) == pytest.approx(3e-4, rel=1e-6), form.form


def test_the_widest_gaps_are_told_in_degrees():
    gaps = [(-2.0, -1.0), (0.0, 0.1), (0.2, 0.5), (0.6, 0.9), (1.0, 1.05)]
    assert gaps_in_words("q_4", gaps) == (
        "q_4 from -114.6 to -57.3, 11.46 to 28.65, 34.38 to 51.57 deg and 2 narrower gaps")
    assert gaps_in_words("temperature_degC", gaps[:1]) == "temperature_degC from -2 to -1"


@pytest.mark.parametrize(("joint", "slides", "place"), [
    (2, {1}, "the guide of axis 1"), (2, set(), "a hose, a cable or a linkage that axis 1"),
    (1, {1}, "the screw or the scale"), (1, set(), "the gear or the encoder"),
])
def test_what_is_suspected_of_a_travel_is_no_hose(joint, slides, place):
    assert place in _suspect(SimpleNamespace(of=("q_1",), joint=joint), frozenset(slides))


def test_what_is_drafted_of_an_axis_that_slides_is_a_length():
    effect = SimpleNamespace(joint=3, form="a*q_3", names=("a",), values=(2e-5,), title="axis 3 follows q_3")
    draft = Draft(effect, np.zeros((1, 2)), {}, {"q_3": ((0.01, 0.02),)}, 9.0, 0.99, (1e-4, 5e-5), "a screw",
                  True, frozenset({3}))
    assert "a*q_3 m with a = 2e-05" in draft.sentence and "q_3 from 10 to 20 mm" in draft.sentence
    turning = replace(draft, slides=frozenset())
    assert "a*q_3 rad with a = 2e-05" in turning.sentence and "deg" in turning.sentence


DRAFT = """[[effects]]
effect = "expression"
joint = 2
form = "{form}"
of = [{of}]
values = {{a = 1e-4}}
"""


@pytest.mark.parametrize("form, of, why", [
    ("a*q_9", '"q_2"', "the formula has q_9, a signal of axis 9, and the list `of` has not (it has q_2); "
                       "expected every signal there, of axes that the arm has"),
    ("a*humidity", "", "the formula has humidity, and neither the list of signals `of` (it has none) nor the "
                       "table `values` has"),
    ("a*q_99", '"q_99"', "expression follows axis 99; expected an axis from 1 to 64"),
])
def test_a_name_that_a_draft_cannot_have_is_refused_in_words(tmp_path, capsys, form, of, why):
    """It said that `effects[1].q_9 is missing`."""
    draft = tmp_path / "draft.toml"
    draft.write_text(DRAFT.format(form=form, of=of))
    assert cli.main(["accept", str(draft), "--out", str(tmp_path / "out")]) == 2
    assert why in capsys.readouterr().err


@pytest.mark.parametrize("effect, why", [
    (DRAFT.format(form="a*q_9", of='"q_9"'), "expression follows axis 9; expected an axis from 1 to 6"),
    ('[[effects]]\neffect = "joint_coupling"\njoint = 2\nmotor = 9\ncoupling_rad_per_rad = 1e-3\n',
     "joint_coupling follows axis 9; expected an axis from 1 to 6"),
    (DRAFT.format(form="a*humidity", of='"humidity"'), "no column humidity, which an effect of the robot"),
])
def test_an_effect_that_follows_what_the_arm_or_the_data_lack_is_refused(tmp_path, capsys, effect, why):
    """It ended in a fault of the program."""
    robot = tmp_path / "robot.toml"
    write_robot(robot, load_robot("ur10"))
    robot.write_text(robot.read_text() + effect)
    assert cli.main(["simulate", str(robot), "--count", "5", "--out", str(tmp_path / "out")]) == 2
    assert why in capsys.readouterr().err
