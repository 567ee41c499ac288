"""Options of commands in Python: the command line's, by their names, with the values that Python has."""

import inspect

import numpy as np
import pytest

import exactarm as ea
from exactarm.commands.about import KEYS
from exactarm.commands.execute import parser_of
from exactarm.commands.listing import import_command

ELSEWHERE = {"help", "out", "quiet", "debug", "map", "workers"}  # an argument of another function, or of none
NAMED = {"rate": "rate_hz", "duration": "duration_s", "bandwidth": "bandwidth_hz", "start": "start_rad",
         "tool": "tool_m", "clearance": "clearance_m", "effect": "effects"}  # with a unit, or of several
GIVEN = {"robot", "files", "paths"}  # what stands before the options
LINE = {"compare": "line", "rate_hz": 250}


def both(name):
    """Options of a command line (name in Python -> action), and the parameters of the function."""
    module = import_command(name)
    parameters = inspect.signature(getattr(module, name)).parameters
    actions = {action.dest: action for action in parser_of(module)._actions
               if action.dest not in ELSEWHERE | GIVEN}
    return {key if key in parameters else NAMED.get(key, key): action for key, action in actions.items()}, \
        parameters


@pytest.mark.parametrize("name", ea.COMMANDS)
def test_every_option_of_the_command_line_is_one_in_python(name):
    options, parameters = both(name)
    free = {"certify": set(KEYS)}.get(name, set())  # by their names: **details
    if name == "accept":  # copies a draft, nothing is drawn
        free = {"seed"}
    assert options.keys() - free <= {*parameters, "threads"}
    assert name == "certify" or not any(p.kind is p.VAR_KEYWORD for p in parameters.values())


@pytest.mark.parametrize("name", ["design", "simulate", "study", "compensate", "identifiable"])
def test_an_option_has_the_default_and_the_type_of_the_command_line(name):
    options, parameters = both(name)
    for key, action in options.items():
        if key not in ("seed", "threads"):
            default = parameters[key].default
            assert (default or None) == (action.default or None), key
            assert parameters[key].annotation not in ("Any", inspect.Parameter.empty)
    assert not {key for key in parameters if key not in options} - {"robot", "file", "files", "paths",
                                                                    "progress"}


@pytest.mark.parametrize("option, value, said", [
    ("seed", -1, "argument seed: -1 is negative, expected 0 or more"),
    ("seed", 1.5, "argument seed: 1.5, expected a whole number"),
    ("seed", "7", "argument seed: '7', expected a whole number"),
    ("seed", None, "argument seed: None, expected a whole number"),
    ("seed", 2**70, f"argument --seed: {2**70}; expected a whole number of at most {2**63 - 1} (64 bits)"),
    ("threads", 0, "argument threads: 0, expected 1 or more"),
    ("threads", "two", "argument threads: 'two', expected a whole number"),
])
def test_common_options_are_refused_before_any_work(option, value, said):
    asked = 0
    for name in ea.COMMANDS:
        parameters = inspect.signature(getattr(ea, name)).parameters
        if option not in parameters:
            continue
        given = [object() for p in parameters.values()  # nothing that could be read
                 if p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD]
        needed = {p.name: None for p in parameters.values()
                  if p.default is p.empty and p.kind is p.KEYWORD_ONLY}
        with pytest.raises(ea.InputError) as refused:
            getattr(ea, name)(*given, **needed, **{option: value})
        assert str(refused.value) == said
        asked += 1
    assert asked >= 12


def test_whole_numbers_of_numpy_are_seeds():
    assert ea.identifiable("ur10", count=20, seed=np.int64(3)) == ea.identifiable("ur10", count=20, seed=3)


@pytest.mark.parametrize("written, given", [
    ({"tool_m": "0.05,0,-0.1"}, {"tool_m": [0.05, 0, -0.1]}),
    ({"tool_m": "0.05,0,-0.1"}, {"tool_m": np.array([0.05, 0.0, -0.1])}),
    ({"box": "-1,1,-1,1,0,1.5"}, {"box": (-1, 1, -1, 1, 0, 1.5)}),
    ({"clearance_m": 0.1}, {"clearance_m": np.float64(0.1)}),
])
def test_numbers_may_be_given_as_python_has_them(written, given):
    one, other = (ea.identifiable("ur10", count=30, **options) for options in (written, given))
    assert one == other


def test_an_option_that_may_be_given_again_takes_one_value_or_several():
    made = [ea.simulate("racer-7-1.4", measure="gear", joint=joint, speed=speed, repeats=1, rate_hz=100.0)
            for joint, speed in ((2, 20), ([2], [20.0]))]
    assert made[0] == made[1]
    hidden = "backlash joint=2 width_rad=1e-4"
    assert (ea.simulate("racer-7-1.4", count=5, effects=hidden)
            == ea.simulate("racer-7-1.4", count=5, effects=[hidden]))


@pytest.mark.parametrize("options, said", [
    ({"count": 20.5}, "--count: invalid int value"),
    ({"temperature": 20}, "--temperature: expected 2"), ({"quasi_static": "no"}, "one of True, False"),
    ({"noise": "loud"}, "--noise: invalid float value"),
])  # fmt: skip
def test_a_value_that_cannot_be_meant_is_refused_in_words(options, said):
    with pytest.raises(ea.InputError, match=said):
        ea.simulate("ur10", **options)


def test_a_misspelt_option_is_refused_by_its_name():
    with pytest.raises(TypeError, match="unexpected keyword argument 'cuont'"):
        ea.simulate("ur10", cuont=20)


def test_options_of_a_design_that_belong_together_are_told_as_on_the_command_line():
    with pytest.raises(ea.InputError, match="--minutes acts with --for"):
        ea.design("ur10", minutes=["visit=2"])


@pytest.mark.slow
def test_poses_and_touches_are_designed_and_plans_compared_from_python():
    seen = ea.design("ur10", count=20, validation=0, station=[2.0, 0.0, 0.5], opening=[1, 0, 0],
                     tool_m=[0.05, 0, 0.1])
    assert len(seen.to_dataframe()) == 20
    assert "touches at 2 places" in str(ea.design("ur10", count=20, contact="socket", places=2))
    assert {entry["method"] for entry in ea.simulate("racer-7-1.4", **LINE)["tracking"]} > {"exactarm"}
