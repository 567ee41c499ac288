"""Effects as formulas: read safely, with exact derivatives, and known to every command once a draft is
accepted."""

import json
from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import cli
from exactarm.chain import Layout
from exactarm.data.dataset import write_dataset
from exactarm.effects import effect_from_table
from exactarm.identify.pose_fit import fit_poses
from exactarm.numerics.formula import Formula, FormulaError
from exactarm.robot.writer import robot_text
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

HOSE = {"effect": "expression", "joint": 5, "title": "a hose presses axis 5", "of": ["q_4", "q_6"],
        "form": "a*(q_4 + q_6)^2",
        "values": {"a": 3e-4}, "plausible": {"a": 3e-4}}


@pytest.mark.parametrize("text", [
    "a*(x + y)^2", "a*tanh(x/w) - sin(2*x)*y", "exp(-x/2)*sqrt(2 + y)", "-x^2/(1 + y*y)",
    "atan(x)*log(3 + y) + cos(x*y) + tan(x/9)",
    "abs(x)*a + 2e-3*y", "x^y^0.5",
])
def test_derivatives_are_those_of_central_differences(text):
    formula, rng = Formula.of(text), np.random.default_rng(1)
    start = np.concatenate([rng.uniform(0.3, 1.5, len(formula.names))])

    def value(x):
        return np.atleast_1d(formula(dict(zip(formula.names, x)))[0])

    slopes = formula(dict(zip(formula.names, start)))[1]
    assert_derivative(value, start, np.array([[float(slopes[name]) for name in formula.names]]), 1e-4)


@pytest.mark.parametrize("text, said", [
    ("", "empty"), ("a*(q_4", "not closed"), ("a**b", "where a number"), ("__import__('os')", "expected"),
    ("system(1)", "no function"),
    ("a b", "not expected"), ("1 +", "ends"), ("(" * 60 + "a" + ")" * 60, "nested"),
    ("a" * 2000, "characters"), ("a.b", "'.'"),
])
def test_what_is_no_formula_is_refused(text, said):
    with pytest.raises(FormulaError, match=said.replace("'.'", "'\\.'")):
        Formula.of(text)


def test_a_fit_through_the_chain_finds_the_size():
    rng, robot = np.random.default_rng(5), load_robot("ur10")
    truth = effect_from_table(HOSE)
    q = joints_in_limits(robot, 120, rng)
    true = true_robot(robot, rng, 0.0)
    data = measured(robot, [true], [q], 1e-5, rng, layout=Layout.of((truth,), estimate=False))
    fit = fit_poses(true, Layout.of((truth.emptied(),)), data)
    assert fit.layout.effects[0].values[0] == pytest.approx(3e-4, rel=0.02)


@pytest.mark.parametrize("command", ["evaluate", "calibrate"])
@pytest.mark.parametrize("form", ["a*log(q_4)", "a/(q_4 - q_4)", "a*exp(1000*q_4^2)"])
def test_a_formula_without_a_value_at_some_row_is_refused(tmp_path, capsys, command, form):
    """They ended as a fault: what is no number reached the linear algebra."""
    robot = load_robot("ur10")
    effect = effect_from_table(HOSE | {"of": ["q_4"], "form": form})
    (tmp_path / "arm.toml").write_text(robot_text(replace(robot, effects=(effect,))))
    rng = np.random.default_rng(2)
    data = measured(robot, [robot], [joints_in_limits(robot, 30, rng)], 4e-5, rng)
    write_dataset(tmp_path / "poses.csv", data, robot)
    words = [command, str(tmp_path / "arm.toml"), str(tmp_path / "poses.csv"), "--out", str(tmp_path / "out")]
    assert cli.main([*words, "--quiet"]) == 2
    said = capsys.readouterr().err
    assert "arm.toml: its effects (a hose presses axis 5) give no finite position at row" in said
    assert said.count("\n") == 1


def test_tables_survive_the_way_through_a_robot_file():
    effect = effect_from_table(HOSE)
    assert effect_from_table(effect.to_table()) == effect


@pytest.mark.slow
def test_an_accepted_draft_is_diagnosed_like_any_effect(tmp_path, monkeypatch):
    monkeypatch.setenv("EXACTARM_EFFECTS", str(tmp_path / "mine"))
    draft = tmp_path / "draft.toml"
    draft.write_text('[[effects]]\neffect = "expression"\ntitle = "a hose presses axis 5"\nstation = '
                     '"SPRING"\njoint = 5\n'
                     'of = ["q_4", "q_6"]\nform = "a*(q_4 + q_6)^2"\nvalues = { a = 1e-4 }\nstatus = '
                     '"draft"\n')
    assert cli.main(["accept", str(draft), "--out", str(tmp_path / "accepted")]) == 0
    rng, robot = np.random.default_rng(6), load_robot("ur10")
    data = measured(robot, [true_robot(robot, rng, 0.3)], [joints_in_limits(robot, 110, rng)], 5e-5, rng,
                    layout=Layout.of((effect_from_table(HOSE),), estimate=False))
    write_dataset(tmp_path / "measured.csv", data, robot)
    assert cli.main(["diagnose", "ur10", str(tmp_path / "measured.csv"), "--out",
                     str(tmp_path / "found")]) == 0
    result = json.loads((tmp_path / "found" / "result.json").read_text())
    first = result["effects"][0]
    assert (first["effect"], first["joint"], result["verdict"]) == ("expression", 5, "explained")
    low, high = first["parameters"]["a"]["ci95"]
    assert low < 3e-4 < high
    again = load_robot(str(tmp_path / "found" / "robot.toml"))
    assert any(effect.name == "expression" for effect in again.effects)


@pytest.mark.parametrize("text, said", [
    ("x = 1\n", "no effects"),
    ('[[effects]]\neffect = "expression"\njoint = 5\nof = []\nvalues = {}\n', "form is missing"),
    ('[[effects]]\neffect = "expression"\njoint = 5\nof = []\nform = "a*("\nvalues = { a = 1.0 }\n',
     "effects[1]"),
    ('[[effects]]\neffect = "nothing"\n', "no known effect"),
    ('[[effects]]\neffect = { a = 3e-4 }\n', "no known effect"),
    *(('[[effects]]\neffect = "expression"\njoint = 5\n'
       f'form = "{form}"\nof = ["q_1"]\nvalues = {{ {values} }}\n', "is zero at all angles")
      for form, values in (("0*q_1", ""), ("a*(q_1 - q_1)", "a = 1e-3"), ("a*sin(q_1)*0", "a = 0.0"))),
])
def test_a_draft_that_does_not_fit_is_refused_by_name(tmp_path, capsys, monkeypatch, text, said):
    monkeypatch.setenv("EXACTARM_EFFECTS", str(tmp_path / "mine"))
    draft = tmp_path / "draft.toml"
    draft.write_text(text)
    assert cli.main(["accept", str(draft), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error and "draft.toml" in error and not (tmp_path / "mine").exists()


def test_a_formula_that_is_zero_in_places_is_accepted_and_an_amplitude_of_zero_is_said(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setenv("EXACTARM_EFFECTS", str(tmp_path / "mine"))
    draft = tmp_path / "draft.toml"
    for value, warned in ((1e-4, False), (0.0, True)):
        draft.write_text('[[effects]]\neffect = "expression"\njoint = 5\nform = "a*step(q_1 - 3)"\n'
                         f'of = ["q_1"]\nvalues = {{ a = {value} }}\n')
        assert cli.main(["accept", str(draft), "--out", str(tmp_path / "out")]) == 0
        assert ("all its values are zero" in capsys.readouterr().out) == warned
