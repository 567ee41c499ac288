"""What to do next where something is left: an experiment that one can do, not the finding said again."""

from types import SimpleNamespace as Plain

import pytest

from exactarm.commands.measure_more import experiment_for, to_tell_noise, worse_elsewhere
from exactarm.data.kinds import CLOSURES, GEAR_RUN, MOTION, POSES, TRACKED_MOTION
from exactarm.diagnose.signal import Quantity, Signal, Structure


def follows(*signals):
    return (Structure("", signals),)


@pytest.mark.parametrize("kind, told, words", [
    (POSES, follows(Signal(Quantity.ANGLE, 5)), "turn axis 5 alone"),
    (POSES, follows(Signal(Quantity.TWO_ANGLES)), "every axis over its whole range"),
    (POSES, follows(Signal(Quantity.ANGLE, 2), Signal(Quantity.ANGLE, 3)), "every axis over"),
    (POSES, follows(Signal(Quantity.ANGLE, 2), Signal(Quantity.LOAD, 3)), "load of axis 3"),
    (POSES, follows(Signal(Quantity.PLACE)), "second place of the tracker"),
    (POSES, follows(Signal(Quantity.TRAVEL, 1)), "axis 1 alone along its way"),
    (TRACKED_MOTION, follows(Signal(Quantity.TRAVEL, 1)), "axis 1 alone along its way, slowly"),
    (POSES, follows(Signal(Quantity.ORDER)), "every quarter of an hour"),
    (POSES, follows(Signal(Quantity.APPROACH, 2)), "both sides of axis 2"),
    (POSES, follows(Signal("temperature_degC")), "other values of the temperature_degC"),
    (POSES, (Structure("", wanders=True),), "one pose again"),
    (POSES, (), "five poses ten times each"),
    (CLOSURES, follows(Signal(Quantity.POSITION, part="x")), "another place of the fixture"),
    (CLOSURES, follows(Signal(Quantity.LOAD, 3)), "known payload"),
    (GEAR_RUN, (Structure("", hertz=12.5),), "leaves 12.5 Hz with the speed"),
    (GEAR_RUN, (Structure("", hertz=1e3),), "leaves 1e+03 Hz with the speed"),
    (GEAR_RUN, follows(Signal(Quantity.MOTOR_ANGLE, 4, "within a revolution")), "turn axis 4 alone"),
    (MOTION, follows(Signal(Quantity.DIRECTION, 2)), "axis 2 alone to and fro"),
    (MOTION, (), "record the same motion three times"),
    (TRACKED_MOTION, follows(Signal(Quantity.ACCELERATION, 1)), "half the speed"),
    (TRACKED_MOTION, follows(Signal(Quantity.TIME)), "cold, and after half an hour"),
])
def test_every_structure_has_an_experiment_that_varies_what_it_follows(kind, told, words):
    said = experiment_for(kind, told)
    assert words in said and said.startswith("To find what is left, ") and said.endswith(".")
    assert "{" not in said


@pytest.mark.parametrize("kind, words", [
    (POSES, "That the noise is 3.00 mm (RMS) is what the fit says of itself"),
    (CLOSURES, "If the device is better than that"),
    (MOTION, "the same motion three times"),
])
def test_what_only_the_fit_calls_noise_is_to_be_measured(kind, words):
    said = to_tell_noise(Plain(kind=kind.name, unit="Nm" if kind is MOTION else "m", noise=Plain(value=3e-3)))
    assert words in said and said.endswith(".")


def test_where_fitted_rows_say_little_of_others_more_of_them_are_asked_for():
    found = follows(Signal(Quantity.TIME))
    assert "at least two other motions" in experiment_for(MOTION, found, far_larger=True)
    assert "elsewhere in the work space" in experiment_for(POSES, found, far_larger=True)


@pytest.mark.parametrize("rows, rms, told", [((188, 438), 1.5, True), ((188, 438), 1.1, False),
                                             ((4, 9), 1.5, False), ((0, 9), 1.0, False)])
def test_rows_that_were_not_fitted_and_err_more_are_said_beside_nothing_missing(rows, rms, told):
    sets = {"validation": Plain(n=rows[0], rms=rms), "identification": Plain(n=rows[1], rms=1.0)}
    said = worse_elsewhere(Plain(kind=TRACKED_MOTION.name, after=sets))
    assert (said is not None) == told
    assert not told or ("1.5 times as large" in said and "at least two other motions" in said)
