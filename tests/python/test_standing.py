"""Effects that are less likely than not leave the model, the least likely first."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from exactarm.data.dataset import read_dataset
from exactarm.diagnose import standing
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.selected import Accepted, Selection
from exactarm.diagnose.standing import Judged
from exactarm.diagnose.verdict import UNEXPLAINED
from exactarm.robot_file import load_robot

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "bench"))

from blind import gear_scenario  # noqa: E402
from blind.conditions import WIDE  # noqa: E402


def effect(name: str) -> SimpleNamespace:
    return SimpleNamespace(name=name, joint=1, title=f"{name} of axis 1")


def fit_of(effects) -> SimpleNamespace:
    return SimpleNamespace(layout=SimpleNamespace(effects=tuple(effects)))


@pytest.fixture
def judged(monkeypatch):
    """Makes a judged selection of named effects, whose probabilities hang on which of them are in the
    model."""

    def make(by_set: dict[str, list[float]]) -> Judged:
        def of(problem, declared, selection, causes) -> Judged:
            present = "".join(a.effect.name for a in selection.accepted)
            return Judged(selection, [], [], [], by_set[present])

        monkeypatch.setattr(standing, "refit", lambda problem, declared, effects, *last: fit_of(effects))
        monkeypatch.setattr(Judged, "of", staticmethod(of))
        effects = [effect(name) for name in max(by_set, key=len)]
        accepted = tuple(Accepted(each, 10.0, 1.0, (), number) for number, each in enumerate(effects))
        return of(None, None, Selection((fit_of(()), fit_of(effects)), accepted), None)

    return make


PROBLEM = SimpleNamespace(settled=lambda fitted: fitted, unknown_rivals=False)
DECLARED = SimpleNamespace(effects=())


def test_the_least_likely_leaves_first_and_the_others_are_judged_anew(judged):
    left, _, dropped = judged({"abc": [0.9, 0.4, 0.1], "ab": [0.9, 0.6]}).only_standing(PROBLEM, DECLARED)
    assert [(each.effect.name, each.probability) for each in dropped] == [("c", 0.1)]
    assert [a.effect.name for a in left.selection.accepted] == ["a", "b"] and left.sure == [0.9, 0.6]
    assert len(left.selection.fits) == 2 and {a.round for a in left.selection.accepted} == {0}
    assert dropped[0].to_json() == {"effect": "c", "joint": 1, "probability": 0.1,
                                    "reason": "less likely than not by all rows"}


def test_where_none_stands_the_declared_model_is_left(judged):
    left, _, dropped = judged({"ab": [0.3, 0.2], "a": [0.49], "": []}).only_standing(PROBLEM, DECLARED)
    assert [each.effect.name for each in dropped] == ["b", "a"]
    assert not left.selection.accepted and len(left.selection.fits) == 1


def test_what_stands_stays_as_it_is(judged):
    made = judged({"ab": [0.5, 0.9]})
    assert made.only_standing(PROBLEM, DECLARED) == (made, None, ())


def test_a_diagnosis_holds_nothing_that_is_less_likely_than_not(tmp_path):
    """Gear run 93125: an eccentricity at 0.49 and waves at 0.13 stood in `robot.toml`, with a warning."""
    case = gear_scenario.draw_case(tmp_path, 93125, TOP / "python" / "exactarm" / "data" / "robots",
                                   conditions=WIDE)
    robot = load_robot(str(case.robot))
    result = diagnose(robot, read_dataset([str(case.data)], robot))
    assert {each.effect.name for each in result.dropped} == {"gear_eccentricity", "gear_harmonics"}
    assert all(each.probability < 0.5 for each in result.dropped) and not result.findings
    assert result.verdict == UNEXPLAINED and result.drafts and "ask for gear eccentricity" in result.sentence
    assert not result.robot.effects
