"""Evidence of sets of causes: the same as the dense Gaussian formulas, and no name for noise."""


from math import factorial
from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.diagnose import posterior
from exactarm.diagnose.evidence import Members, Picture
from exactarm.diagnose.search import FIRST, FURTHER, _richer, log_prior_of_count, search, weight_of
from exactarm.diagnose.self_test import _Parts
from exactarm.diagnose.signal import Quantity, Signal, turn_of
from exactarm.diagnose.unknown import Unknown, basis_of, sizes_of
from exactarm.diagnose.vocabulary import SCALE_WEIGHTS, SCALES, Block, Vocabulary
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.noise.estimate import normal_noise

ROWS, COMPONENTS, MOST = 60, 3, 16
SHARE = 0.01


class Cause:
    """What a named block asks of its effect: nothing that another one includes or sums."""

    family, joint, any_curve = "", None, False

    def includes(self, other):
        return False

    sums = includes


def block(number, columns, at, positive=False):
    """A named cause of `columns` coefficients; the effect itself is never asked."""
    return Block(f"cause_{number}", Cause(), None, slice(at, at + columns), np.full(columns, 0.5),
                 np.full(columns, positive), float(np.log(SHARE)), False)


def picture(seed, planted=(), positive=False, size=1.5, known=0):
    """Eight random causes of one to three columns, five declared parameters, unit noise."""
    rng = np.random.default_rng(seed)
    widths = [1, 1, 1, 2, 2, 2, 3, 3]
    starts = np.concatenate([[0], np.cumsum(widths)])
    blocks = tuple(block(i, width, int(starts[i]), positive) for i, width in enumerate(widths))
    responses = rng.standard_normal((ROWS, COMPONENTS, starts[-1]))
    declared = rng.standard_normal((ROWS, COMPONENTS, 5))
    residual = rng.standard_normal((ROWS, COMPONENTS))
    for index in planted:
        residual += responses[:, :, blocks[index].where] @ np.full(widths[index], size)
    noise = normal_noise(np.ones((ROWS, COMPONENTS)))  # whitens with one
    return Picture.of(Vocabulary(blocks, (responses,)), residual, declared, noise, known=known)


def dense_log_likelihood(pic, members):
    """-1/2 log|V| - n/2 log(r' V^-1 r), V = I + B B' written out."""
    columns, residual, basis = pic.columns, pic.residual, pic.absorbed.basis
    blocks = [pic.vocabulary.blocks[i] for i in members.blocks]
    b = np.concatenate([np.zeros((len(residual), 0)),
                        *(columns[:, block.where] * (SCALES[scale] * block.size)
                          for block, scale in zip(blocks, members.scales))], axis=1)
    b -= basis @ (basis.T @ b)
    v = np.eye(len(residual)) + b @ b.T
    left = residual @ np.linalg.solve(v, residual)
    return -0.5 * np.linalg.slogdet(v)[1] - 0.5 * pic.count * np.log(left / pic.square)


@pytest.mark.parametrize("members", [Members((), ()), Members((2,), (3,)), Members((0, 4, 7), (2, 1, 4))])
def test_likelihood_is_that_of_the_full_covariance(members):
    pic = picture(1, planted=(4,))
    assert pic.log_likelihood(members) == pytest.approx(dense_log_likelihood(pic, members), abs=1e-9)


def test_what_a_set_takes_off_has_a_row_for_each_direction_that_it_tells():
    """Forty waves of a smooth function on an angle of sixty poses: most of them say the same."""
    rng = np.random.default_rng(11)
    angle = rng.uniform(-1.0, 1.0, (ROWS, 1, 1))
    waves = np.cos(np.arange(40) * np.pi * (angle + 2.0) / 4.0) * 0.5 ** np.arange(40) * np.ones((1, 3, 1))
    blocks, members = (block(0, 40, 0), block(1, 3, 40)), Members((0,), (5,))
    responses = np.concatenate([waves, rng.standard_normal((ROWS, COMPONENTS, 3))], axis=2)
    declared, residual = rng.standard_normal((ROWS, COMPONENTS, 5)), rng.standard_normal((ROWS, COMPONENTS))
    pic = Picture.of(Vocabulary(blocks, (responses,)), residual, declared,
                     normal_noise(np.ones((ROWS, COMPONENTS))))
    columns, left = pic.columns, pic.residual
    basis = pic.absorbed.basis
    cleared, left = columns - basis @ (basis.T @ columns), left - basis @ (basis.T @ left)
    b = cleared[:, :40] * (SCALES[5] * blocks[0].size)
    taken = b @ np.linalg.solve(np.eye(40) + b.T @ b, b.T)
    cross, onto = pic.factor(members)
    assert 5 < len(cross) < 25
    assert cross.T @ cross == pytest.approx(cleared.T @ taken @ cleared, abs=1e-7)
    assert cross.T @ onto == pytest.approx(cleared.T @ taken @ left, abs=1e-7)


def test_parameters_with_a_prior_are_integrated_out_and_pay_for_what_the_data_tell():
    rng = np.random.default_rng(8)
    blocks = (block(0, 2, 0), block(1, 1, 2))
    responses = rng.standard_normal((ROWS, COMPONENTS, 3))
    declared = rng.standard_normal((ROWS, COMPONENTS, 4))
    residual, spread = rng.standard_normal((ROWS, COMPONENTS)), np.array([1e-3, 0.05, 0.3, 10.0])
    noise, members = normal_noise(np.ones((ROWS, COMPONENTS))), Members((0, 1), (3, 2))
    pic = Picture.of(Vocabulary(blocks, (responses,)), residual, declared, noise,
                     (np.diag(1.0 / spread), np.zeros(4)))
    flat, d = responses.reshape(-1, 3), declared.reshape(-1, 4) * spread
    parts = [flat[:, blocks[i].where] * (SCALES[k] * blocks[i].size) for i, k in ((0, 3), (1, 2))]
    b = np.concatenate(parts, axis=1)
    prior_of_rows = np.eye(len(flat)) + d @ d.T
    whole, r = prior_of_rows + b @ b.T, residual.ravel()
    log_det, left = pic.quadratic(members)
    assert log_det == pytest.approx(np.linalg.slogdet(whole)[1] - np.linalg.slogdet(prior_of_rows)[1])
    assert left == pytest.approx(r @ np.linalg.solve(whole, r))
    told = np.trace(d @ np.linalg.solve(np.eye(4) + d.T @ d, d.T))
    assert pic.count == pytest.approx(r.size - told) and told < 3.5


def test_exactly_dependent_parameters_with_priors_do_not_hang_on_rounding():
    """Curves of many orders have columns that differ in the seventh digit: under a flat prior the last digits
    of the data decide which directions are free."""
    rng = np.random.default_rng(9)
    one = rng.standard_normal((ROWS, COMPONENTS, 1))
    declared = one + 3e-7 * rng.standard_normal((ROWS, COMPONENTS, 3))
    responses, residual = rng.standard_normal((ROWS, COMPONENTS, 2)), rng.standard_normal((ROWS, COMPONENTS))
    noise, prior = normal_noise(np.ones((ROWS, COMPONENTS))), (np.eye(3) / 0.1, np.zeros(3))
    weights = []
    for touched in (1.0, 1.0 + 1e-9 * rng.standard_normal(declared.shape)):
        vocabulary = Vocabulary((block(0, 2, 0),), (responses,))
        pic = Picture.of(vocabulary, residual, declared * touched, noise, prior)
        weights.append(pic.additions(Members((), ())).log_weight[0])
    assert weights[0] == pytest.approx(weights[1], abs=1e-6)


def test_additions_are_the_difference_of_two_likelihoods():
    pic = picture(2, planted=(4, 0))
    members = Members((4,), (3,))
    found = pic.additions(members)
    for index in (0, 3, 6):
        each = [pic.log_likelihood(Members((4, index), (3, s))) - pic.log_likelihood(members)
                + np.log(SCALE_WEIGHTS[s])
                for s in range(len(SCALES))]
        expected = np.logaddexp.reduce(each) + np.log(SHARE)
        assert found.log_weight[index] == pytest.approx(expected, abs=1e-8)


def test_causes_in_the_noise_leave_the_same_differences():
    """A certain cause that became part of the noise: the others weigh what they weigh beside it."""
    pic = picture(3, planted=(4, 0))
    one = Members((4,), (3,))
    beside = pic.beside(one)
    direct, absorbed = pic.additions(one).log_weight, beside.additions(Members((), ())).log_weight
    others = [i for i in range(8) if i != 4]
    assert absorbed[others] == pytest.approx(direct[others], abs=1e-8)
    assert absorbed[4] == -np.inf


def test_a_coefficient_that_cannot_be_negative_is_believed_on_one_side_only():
    for size, better in ((1.5, True), (-1.5, False)):
        free, bounded = (picture(4, planted=(1,), positive=p,
                                 size=size).additions(Members((), ())).log_weight[1] for p in (False, True))
        assert (bounded > free) == better


def test_planted_causes_are_found_and_noise_gets_no_name():
    certain, posterior = search(picture(5, planted=(1, 6)), MOST)
    names = {f"cause_{i}" for i in certain.blocks} | set(posterior.best)
    assert names == {"cause_1", "cause_6"}
    _, posterior = search(picture(6), MOST)
    assert posterior.best == () and posterior.probability(lambda labels: not labels) > 0.5


def test_probabilities_of_sets_sum_to_one_and_inclusion_follows():
    _, posterior = search(picture(7, planted=(3,), size=0.12), MOST)
    total = posterior.probability(lambda labels: True)
    assert total == pytest.approx(1.0)
    inclusion = posterior.inclusion()
    assert inclusion["cause_3"] == pytest.approx(posterior.probability(lambda labels: "cause_3" in labels))


@pytest.mark.parametrize("known", [0, 1, 3])
def test_the_prior_of_the_number_of_causes_is_a_law(known):
    each = [np.exp(log_prior_of_count(count, known)) / factorial(count) for count in range(40)]
    assert sum(each) == pytest.approx(1.0)
    assert each[3] / each[2] == pytest.approx(FURTHER)


def test_a_cause_beside_others_is_rarer_wherever_they_stand():
    """In the set, in the noise, or in the fit."""
    one, two = Members((1,), (3,)), Members((1, 6), (3, 3))
    pic = picture(9, planted=(1, 6))
    in_noise = pic.beside(one)
    gain = weight_of(in_noise, Members((6,), (3,))) - weight_of(in_noise, Members((), ()))
    # as a set of two the pair may have come in either order
    assert weight_of(pic, two) - weight_of(pic, one) == pytest.approx(gain + np.log(2.0), abs=1e-6)
    beside_fitted = picture(9, planted=(1, 6), known=2)
    first, further = (weight_of(at, one) - weight_of(at, Members((), ())) for at in (pic, beside_fitted))
    assert first - further == pytest.approx(np.log(FIRST / FURTHER), abs=1e-9)


def test_weight_of_a_set_pays_for_each_cause():
    pic = picture(8)
    assert weight_of(pic,
                     Members((0, 1), (2, 2))) < weight_of(pic,
                                                          Members((0,), (2,))) < weight_of(pic,
                                                                                           Members((), ()))


def gear_curve_picture(seed):
    """One axis whose error is a run-out and ten more orders: as a run-out, as single orders, as one curve, as
    an unknown function."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-2.5, 2.5, 300)
    waves = np.stack([f(k * phi) / k for k in range(1, 13) for f in (np.sin, np.cos)], axis=1)[:, None, :]
    curve = GearHarmonics.curve(1, 12, 1e-4, (-2.5, 2.5))
    run_out, fifth = GearEccentricity(1, (0.0,) * 4), GearHarmonics(1, (5.0, 0.0, 0.0))
    own = Unknown(turn_of(1), (Signal(Quantity.ANGLE, 1),))
    responses = np.concatenate([waves, waves[:, :, :4], waves[:, :, 8:10], basis_of(phi)[:, None, :]], axis=2)
    sizes, at, blocks = [np.full(24, 1.0), np.full(4, 1.0), np.full(2, 1.0), sizes_of(1.0)], 0, []
    for effect, unknown, size in zip((curve, run_out, fifth, None), (None, None, None, own), sizes):
        label = unknown.label if effect is None else effect.label
        blocks.append(Block(label, effect, unknown, slice(at, at + len(size)), size,
                            np.zeros(len(size), bool), np.log(0.1), False))
        at += len(size)
    residual = waves @ rng.standard_normal(24) + 0.1 * rng.standard_normal((300, 1))
    declared = np.ones((300, 1, 1))
    return Picture.of(Vocabulary(tuple(blocks), (responses,)), residual, declared,
                      normal_noise(np.full((300, 1), 0.1)))


def test_a_curve_takes_the_place_of_its_poorer_forms():
    """However large the run-out in it is: it is one cause, and neither a run-out nor an unknown function
    stands beside it."""
    pic = gear_curve_picture(11)
    assert pic.vocabulary.forms_of(0) == {0, 1, 2, 3}
    assert 2 not in pic.vocabulary.forms_of(1)  # teeth are no form of a run-out
    certain, posterior = search(pic, MOST)
    assert [*certain.blocks, *posterior.members[posterior.best].blocks] == [0]
    assert len(pic.vocabulary.beside([pic.vocabulary.blocks[0].effect]).blocks) == 0


def test_certain_poorer_forms_give_way_to_the_curve_that_includes_them():
    pic = gear_curve_picture(12)
    assert _richer(pic, Members((1, 2), (2, 2))).blocks == (0,)


def test_random_signs_by_block_are_those_of_the_rows():
    pic, rng = picture(10), np.random.default_rng(11)
    residual, visits = rng.standard_normal(ROWS * COMPONENTS), np.arange(ROWS) // 4
    onto, square = _Parts.of(pic, residual, visits).wild(5, np.random.default_rng(12))
    signs = np.random.default_rng(12).choice([-1.0, 1.0], (visits.max() + 1, 5))
    wild = residual[:, None] * np.repeat(signs[visits], COMPONENTS, axis=0)
    wild -= pic.absorbed.basis @ (pic.absorbed.basis.T @ wild)
    assert onto == pytest.approx(pic.columns.T @ wild)
    assert square == pytest.approx(np.sum(wild**2, axis=0))


def test_where_anew_too_many_act_at_once_the_causes_found_go_on(monkeypatch):
    """With more of the declared model free nothing was found at all; a tilt of 1 mrad was then an unknown
    function beside right causes."""
    result = lambda score: SimpleNamespace(
        score=score, fits=(SimpleNamespace(layout=SimpleNamespace(size=4)),),
        noise=SimpleNamespace(numbers=100, of_a_row=np.ones(3)))
    fewer, more = SimpleNamespace(size=3), SimpleNamespace(size=4)
    asked, found = [], result(10.0)

    def causes(problem, declared, progress, begun=None):
        asked.append((declared, begun))
        return found if declared is fewer else result(12.0) if begun is found else None

    monkeypatch.setattr(posterior, "_causes", causes)
    problem = SimpleNamespace(declared_under=lambda layout, sigma: more)
    assert posterior.find_causes(problem, fewer).score == 12.0
    assert asked == [(fewer, None), (more, None), (more, found)]
