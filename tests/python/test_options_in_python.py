"""Options of commands in Python: the command line's, by their names, with the values that Python has."""

import inspect

import numpy as np
import pytest

import exactarm as ea
from exactarm.commands.execute import parser_of
from exactarm.commands.listing import import_command

ELSEWHERE = {  # by another name, or as an argument of another function
    "help", "out", "quiet", "debug", "robot", "files", "paths", "map", "workers", "effect", "rate",
    "duration", "start", "bandwidth", "tool", "clearance"}
LINE = {"compare": "line", "rate_hz": 250}


@pytest.mark.parametrize("name", ea.COMMANDS)
def test_every_option_of_the_command_line_is_one_in_python(name):
    module = import_command(name)
    parameters = inspect.signature(getattr(module, name)).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return  # all others, by their names: arguments_of
    options = {action.dest for action in parser_of(module)._actions} - ELSEWHERE
    if name == "accept":  # copies a draft, nothing is drawn
        options -= {"seed", "threads"}
    assert options <= {*parameters, "threads"}


@pytest.mark.parametrize("written, given", [
    ({"tool": "0.05,0,-0.1"}, {"tool_m": [0.05, 0, -0.1]}),
    ({"tool": "0.05,0,-0.1"}, {"tool": np.array([0.05, 0.0, -0.1])}),
    ({"box": "-1,1,-1,1,0,1.5"}, {"box": (-1, 1, -1, 1, 0, 1.5)}),
    ({"clearance": 0.1}, {"clearance_m": np.float64(0.1)}),
])
def test_numbers_may_be_given_as_python_has_them(written, given):
    one, other = (ea.identifiable("ur10", count=30, **options) for options in (written, given))
    assert one == other


def test_an_option_that_may_be_given_again_takes_one_value_or_several():
    made = [ea.simulate("racer-7-1.4", measure="gear", joint=joint, speed=speed, repeats=1, rate=100.0)
            for joint, speed in ((2, 20), ([2], [20.0]))]
    assert made[0] == made[1]
    hidden = "backlash joint=2 width_rad=1e-4"
    assert (ea.simulate("racer-7-1.4", count=5, effects=hidden)
            == ea.simulate("racer-7-1.4", count=5, effects=[hidden]))


@pytest.mark.parametrize("options, said", [
    ({"count": 20.5}, "--count: invalid int value"), ({"cuont": 20}, "no option 'cuont'; expected count"),
    ({"temperature": 20}, "--temperature: expected 2"), ({"quasi_static": "no"}, "one of True, False"),
    ({"noise": "loud"}, "--noise: invalid float value"),
])  # fmt: skip
def test_a_value_that_cannot_be_meant_is_refused_in_words(options, said):
    with pytest.raises(ea.InputError, match=said):
        ea.simulate("ur10", **options)


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
