"""Effects less likely than not leave the model, the least likely first, where held-out rows contradict them
or, where none stands, an unknown function outdoes them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.commands.diagnose import _objected, _structure
from exactarm.diagnose import standing
from exactarm.diagnose.selected import Accepted, Selection
from exactarm.diagnose.standing import Judged
from exactarm.diagnose.verdict import beside

PROBLEM = SimpleNamespace(settled=lambda fitted: fitted, unknown_rivals=False)
DECLARED = SimpleNamespace(effects=())


def effect(name: str) -> SimpleNamespace:
    return SimpleNamespace(name=name, joint=1, title=f"{name} of axis 1")


def fit_of(effects) -> SimpleNamespace:
    return SimpleNamespace(layout=SimpleNamespace(effects=tuple(effects)))


@pytest.fixture
def judged(monkeypatch):
    """Makes a judged selection of named effects, whose probabilities hang on which of them are in the model;
    gain: of every round in nats; share: of every effect beside unknown functions."""

    def make(by_set: dict[str, list[float]], gain: float = 5.0, share: float = 1.0) -> Judged:
        def of(problem, declared, selection, causes) -> Judged:
            present = "".join(a.effect.name for a in selection.accepted)
            gains = [gain] * len(present)
            return Judged(selection, [], [], gains, gains, by_set[present])

        monkeypatch.setattr(standing, "refit", lambda problem, declared, effects, *last: fit_of(effects))
        monkeypatch.setattr(Judged, "of", staticmethod(of))
        effects = [effect(name) for name in max(by_set, key=len)]
        accepted = tuple(Accepted(each, 10.0, 1.0, (), number, share=share)
                         for number, each in enumerate(effects))
        return of(None, None, Selection((fit_of(()), fit_of(effects)), accepted), None)

    return make


def test_the_least_likely_leaves_first_and_the_others_are_judged_anew(judged):
    left, _, dropped = judged({"abc": [0.9, 0.4, 0.1], "ab": [0.9, 0.6]}).standing(PROBLEM, DECLARED)
    assert [(each.effect.name, each.probability) for each in dropped] == [("c", 0.1)]
    assert [a.effect.name for a in left.selection.accepted] == ["a", "b"] and left.sure == [0.9, 0.6]
    assert len(left.selection.fits) == 2 and {a.round for a in left.selection.accepted} == {0}
    assert dropped[0].to_json() == {"effect": "c", "joint": 1, "probability": 0.1,
                                    "reason": "held-out rows contradict it"}


def test_where_none_stays_the_declared_model_is_left(judged):
    left, _, dropped = judged({"ab": [0.3, 0.2], "a": [0.49], "": []}).standing(PROBLEM, DECLARED)
    assert [each.effect.name for each in dropped] == ["b", "a"]
    assert not left.selection.accepted and len(left.selection.fits) == 1


def test_what_stands_stays_as_it_is(judged):
    made = judged({"ab": [0.5, 0.9]})
    assert made.standing(PROBLEM, DECLARED) == (made, None, ())


def test_what_an_unknown_function_outdoes_stays_while_held_out_rows_speak_for_it(judged):
    made = judged({"ab": [0.9, 0.2]}, share=0.2)
    assert made.standing(PROBLEM, DECLARED) == (made, None, ())
    against = judged({"ab": [0.9, 0.2], "a": [0.9]}, gain=-0.1, share=0.2)
    assert [each.effect.name for each in against.standing(PROBLEM, DECLARED)[2]] == ["b"]


def test_what_an_unknown_function_outdoes_leaves_where_nothing_stands(judged):
    left, _, dropped = judged({"ab": [0.3, 0.2], "a": [0.9]}, share=0.4).standing(PROBLEM, DECLARED)
    assert [each.effect.name for each in dropped] == ["b"] and left.sure == [0.9]
    assert not dropped[0].contradicted
    assert beside((), dropped) == " Something else is likelier than b of axis 1, left out of the model."
    assert _objected(SimpleNamespace(dropped=dropped)) is None, "rows that were not fitted chose nothing"
    by_rivals = judged({"ab": [0.3, 0.2]}, share=1.0)
    by_rivals = replace(by_rivals, selection=replace(by_rivals.selection, accepted=tuple(
        replace(each, probability=0.3) for each in by_rivals.selection.accepted)))
    assert by_rivals.standing(PROBLEM, DECLARED)[2] == (), "one of them is the cause"


def test_rows_that_have_objected_are_said_to_have_chosen(judged):
    dropped = judged({"ab": [0.9, 0.2], "a": [0.9]}).standing(PROBLEM, DECLARED)[2]
    assert "took b of axis 1 out of the model" in _objected(SimpleNamespace(dropped=dropped))
    assert _objected(SimpleNamespace(dropped=())) is None


def test_where_nothing_else_is_left_the_evidence_names_what_does_not_stand(judged):
    dropped = judged({"ab": [0.9, 0.2], "a": [0.9]}).standing(PROBLEM, DECLARED)[2]
    result = SimpleNamespace(dossier_after=SimpleNamespace(structure=()), unknown=(), dropped=dropped,
                             causes=SimpleNamespace(probability_nothing=0.02, unknown=()))
    told = _structure(result)
    assert told["probability"] == pytest.approx(0.98)
    assert told["evidence"].startswith("the fitted rows ask for b of axis 1, which does not stand")


def test_a_round_that_lost_is_judged_once_more_beside_what_came_after(monkeypatch):
    """What it mended had hidden another cause: errors of the last model with and without it decide."""
    rows = np.random.default_rng(1).normal(size=400)
    errors = [{"identification": np.abs(size * rows), "validation": np.abs(size * rows)}
              for size in (1.0, 1.1, 0.8)]
    monkeypatch.setattr(standing, "refit", lambda problem, declared, effects, *last: fit_of(effects))
    monkeypatch.setattr(standing, "errors_of", lambda problem, fitted: errors[1])
    problem = SimpleNamespace(settled=lambda fitted: fitted, numbers_of_error=1,
                              correlation_factor=lambda fitted: 1.0)
    accepted = tuple(Accepted(effect(name), 10.0, 1.0, (), k) for k, name in enumerate("ab"))
    selection = Selection((fit_of(()), fit_of("a"), fit_of("ab")), accepted)
    gains = standing.held_out_gains(errors, 1, 1.0)
    assert gains[0] < 0.0 < gains[1]
    alone = [standing._gain_of(problem, None, selection, errors[-1], k, gains) for k in range(2)]
    assert alone[0] > 0.0 and alone[1] == gains[1]
