"""Is a known length of the fixture another one? Everything once more with all of them free.

    d = L - f,  C = cov(d),     f: what the touches and the drawing of the arm say without any known length
    t = d_i / C_ii^(1/2)                              length i by itself: a mistake that all of a sort share
    t = (C^-1 d)_i / (C^-1)_ii^(1/2)                  beside what all others say of it: a single one

By itself C holds the tolerances of the drawing where lengths are all that gives the scale
(exactarm.identify.size_doubt is for a factor common to all); the others give it where they are right. What an
arm lacks beyond geometry moves f by more than noise would: a standard deviation is never less than the
touches scatter, and a length is doubted only far out.
"""

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import SIGMA_M, Fixture
from exactarm.errors import InputError
from exactarm.identify.closure_fit import ClosureFit, Pulls, fit_closures
from exactarm.measurement.contacts import Bar
from exactarm.measurement.known_lengths import known_lengths
from exactarm.measurement.partner import NAME as PARTNER
from exactarm.measurement.partner import Partner

# right lengths of virtual spheres, a cube, a wire, two arms: 1.1 at most; 10 mm, a factor of 2: 100 and more
_DOUBTED = 8.0
_DOUBTED_BESIDE = 5.0  # of noise alone, one right length in two million
_ANY_GAP_M = 1.0
_AS_GOOD = 0.8  # of the doubt of the one doubted most, from which another may be the wrong one
_TWICE = 0.1  # share by which a factor of two, or of a unit, may be missed
_ANOTHER = 2.0  # times, and so many times what the arm misses the touches by: no drawing is so far off
_BEYOND = 10.0
_UNITS = {"m": 1000.0, "cm": 10.0, "inches": 25.4, "feet": 304.8, "micrometres": 1e-3}  # of each in mm


def length_doubts(fit: ClosureFit, data: Dataset, pulls: Pulls, threads: int = 1) -> tuple[str, ...]:
    """One line for the known length of each sort that is doubted most; none where the fit itself is in doubt,
    or where the length runs off with the tool."""
    if not fit.fit.converged:
        return ()
    free, mask = zip(*(_released(*each) for each in zip(fit.layout.effects, fit.layout.free)))
    layout = Layout(free, mask)
    fixture = replace(pulls.fixture, distances=(), radii=())
    if layout.size == fit.layout.size and fixture == pulls.fixture and PARTNER not in data.contacts:
        return ()
    anew = fit_closures(fit.robot, layout, data, replace(pulls, fixture=fixture), worth=fit.worth,
                        threads=threads)
    if not anew.fit.converged:
        return ()
    found = list(_compared(anew, fit.layout, pulls.fixture))
    if not found:
        return ()
    apart = np.array([known - said for _, _, said, known, _, _ in found])
    rows = np.array([row for *_, row, _ in found])
    covariance = rows @ anew.fit.covariance @ rows.T + np.diag([sigma**2 for *_, sigma in found])
    inverse = np.linalg.inv(covariance)
    ways = ((apart, np.diag(covariance) ** 0.5, _DOUBTED, False),
            (inverse @ apart / np.diag(inverse), np.diag(inverse) ** -0.5, _DOUBTED_BESIDE, True))
    lines: dict[str, str] = {}
    for off, deviation, least, by_others in ways:
        if lines:  # what others say is worth nothing beside them
            break
        deviation = np.hypot(deviation, anew.sigma_position)
        doubts = np.abs(off) / deviation
        for k in np.argsort(-doubts, kind="stable"):
            sort, words, _, known, *_ = found[k]
            if doubts[k] > least and sort not in lines and known - off[k] < 2.0 * fit.robot.reach:
                enough = _AS_GOOD * doubts[k] if by_others else least
                same = [found[i][1] for i in np.flatnonzero(doubts > enough)
                        if i != k and found[i][0] == sort]
                lines[sort] = (_line(sort, words, known - off[k], deviation[k], known)
                               + _beside(same, by_others))
    return tuple(lines.values())


def require_units(nominal: ClosureFit, data: Dataset) -> None:
    """Raises InputError where a known distance is another one by far, already with the arm as declared: a fit
    would bend the arm for it."""
    missed = float(np.sqrt(np.mean(nominal.prediction.error() ** 2)))
    for each in known_lengths(nominal.layout, data.fixture):
        said, unsure = each.known - each.residual, np.sqrt(each.row @ nominal.fit.covariance @ each.row)
        times = said / max(each.known, 1e-12)
        if (each.is_distance and not 1.0 / _ANOTHER < times < _ANOTHER
                and abs(each.residual) > _BEYOND * np.hypot(missed, unsure)):
            unit = next((f"; is it given in {name}?" for name, size in _UNITS.items()
                         if abs(times / size - 1.0) < _TWICE), "")
            raise InputError(
                f"{each.name}: with the arm as its file says the touches are {1e3 * said:.4g} mm apart, the "
                f"fixture file says {1e3 * each.known:.4g} mm{unit or ': is it another one, or of others?'}",
                file=data.first_file)


def _line(sort: str, words: str, said: float, sd: float, known: float) -> str:
    is_twice = sort == "radius" and abs(known / max(said, 1e-12) / 2.0 - 1.0) < _TWICE
    return (f"{words}: the touches say {1e3 * said:.4g} mm ± {1e3 * sd:.2g} mm, expected {known * 1e3:.4g} mm"
            + ("; is a diameter given for a radius?" if is_twice else ""))


def _beside(others: list[str], rivals: bool) -> str:
    """Others of the sort that may be the wrong one instead, or that are wrong as well."""
    if not others:
        return ""
    if rivals:
        return f"; or {' or '.join(others)} is the wrong one"
    return f"; as doubtful: {', '.join(others)}"


def _released(effect, free: np.ndarray):
    """The contact without what is known of its length."""
    if isinstance(effect, Bar) and effect.absolute:
        return replace(effect, absolute=False), np.ones(len(free), bool)
    if isinstance(effect, Partner):
        return replace(effect, declared_as=replace(effect.declared_as, sigma=_ANY_GAP_M)), free
    return effect, free


def _compared(anew: ClosureFit, before: Layout, fixture: Fixture):
    """(sort, words, said by the touches, known, derivative (P,) of what is said, standard deviation of what
    is known), lengths in m."""
    kept = {each.name for each in known_lengths(anew.layout, replace(fixture, distances=(), radii=()))}
    for each in known_lengths(anew.layout, fixture):
        if each.name in kept:  # a board's square
            continue
        sort = "distance" if each.is_distance else "radius"
        yield sort, each.name, each.known - each.residual, each.known, each.row, each.sigma
    unit = np.eye(anew.layout.size)
    at = {name: k for k, name in enumerate(anew.layout.names)}
    for effect, old in zip(anew.layout.effects, before.effects):
        if isinstance(effect, Bar) and not effect.absolute and old.absolute:
            row = unit[at[effect.parameter_label(effect.parameters()[3])]]
            words = f'zero of bar {effect.number} of session {effect.session} (zero = "free" would take it)'
            yield "bar", words, effect.values[3], 0.0, row, SIGMA_M
        if isinstance(effect, Partner):
            known = old.declared_as
            yield ("partner", "distance of the balls of both arms", known.distance + effect.values[9],
                   known.distance, unit[at["partner_gap_m"]], known.sigma)
