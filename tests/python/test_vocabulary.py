"""Vocabulary: blocks that differ in their prior alone share their columns, and known causes leave
the matrix."""

import numpy as np

from exactarm.diagnose.problems import problem_for
from exactarm.diagnose.vocabulary import vocabulary_of
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot


def vocabulary():
    rng, robot = np.random.default_rng(5), load_robot("ur10")
    q = joints_in_limits(robot, 30, rng)
    data = measured(robot, [true_robot(robot, rng, 0.3)], [q], 5e-5, rng)
    problem = problem_for(robot, data, data.select(np.zeros(len(data), bool)), 1, 0)
    fitted = problem.fit(problem.declared())
    laws = [GearHarmonics.curve(2, 5, amplitude, (-3.0, 3.0)) for amplitude in (3e-5, 1e-4)]
    other = GearEccentricity(3, (0.0, 0.0), second=False)
    return vocabulary_of(fitted, [*laws, other], []), laws


def test_laws_of_one_curve_share_its_columns():
    found, _ = vocabulary()
    first, second, other = found.blocks
    assert first.where == second.where and first.columns == 10
    assert not np.allclose(first.size, second.size)
    assert other.where == slice(10, 12) and found.width == 12


def test_beside_a_curve_its_columns_are_gone_and_the_others_are_what_they_were():
    found, laws = vocabulary()
    left = found.beside([laws[0]])
    assert [block.label for block in left.blocks] == ["gear_eccentricity_3"]
    assert left.blocks[0].where == slice(0, 2)
    assert np.array_equal(left.parts[0], found.response(slice(10, 12)))


def test_a_wave_that_was_found_may_have_an_overtone():
    found, _ = vocabulary()
    wave = GearHarmonics.zero(2, (101.0,)).with_values((101.3, 0.01, 0.02))
    overtone, = wave.companions()
    assert overtone.joint == 2 and overtone.values == (202.6, 0.0, 0.0)
    assert not list(GearHarmonics.curve(2, 5, 3e-5, (-3.0, 3.0)).companions())


def test_joined_causes_follow_the_others_and_are_together_as_probable_as_one_name():
    found, _ = vocabulary()
    both = found.joined(found.beside([GearHarmonics.curve(2, 5, 3e-5, (-3.0, 3.0))]))
    last = both.blocks[-1]
    assert last.where == slice(12, 14) and both.width == 14
    assert np.array_equal(both.response(last.where), found.response(found.blocks[-1].where))
    assert np.isclose(last.log_prior, found.blocks[-1].log_prior - np.log(2.0))
