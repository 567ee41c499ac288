"""Is a known length of the fixture another one? Everything once more with all of them free.

    t = (L - f) / sd(L - f),    f: what the touches and the drawing of the arm say without any known length

Told apart from the scale: where the lengths are all that gives it, sd holds the tolerances of the drawing
(exactarm.identify.size_doubt is for a factor common to all). What an arm lacks beyond geometry moves f by
more than noise would: sd is never less than the touches scatter, and a length is doubted only far out.
"""

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import SIGMA_M, Fixture
from exactarm.identify.closure_fit import ClosureFit, Pulls, fit_closures
from exactarm.identify.reach import reach
from exactarm.measurement.contacts import Bar
from exactarm.measurement.known_lengths import known_lengths
from exactarm.measurement.partner import NAME as PARTNER
from exactarm.measurement.partner import Partner

# right lengths of virtual spheres, a cube, a wire, two arms: 1.1 at most; 10 mm, a factor of 2: 100 and more
_DOUBTED = 8.0
_ANY_GAP_M = 1.0
_TWICE = 0.1  # share by which a factor of two may be missed


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
    worst: dict[str, tuple[float, str]] = {}
    for sort, words, said, known, sd in _compared(anew, fit.layout, pulls.fixture):
        sd = float(np.hypot(sd, anew.sigma_position))
        doubt = abs(said - known) / sd
        if said < 2.0 * reach(fit.robot) and doubt > max(_DOUBTED, worst.get(sort, (0.0, ""))[0]):
            is_twice = sort == "radius" and abs(known / max(said, 1e-12) / 2.0 - 1.0) < _TWICE
            twice = "; is a diameter given for a radius?" if is_twice else ""
            worst[sort] = (doubt, f"{words}: the touches say {1e3 * said:.4g} mm ± {1e3 * sd:.2g} mm, "
                                  f"expected {known * 1e3:.4g} mm{twice}")
    return tuple(line for _, line in worst.values())


def _released(effect, free: np.ndarray):
    """The contact without what is known of its length."""
    if isinstance(effect, Bar) and effect.absolute:
        return replace(effect, absolute=False), np.ones(len(free), bool)
    if isinstance(effect, Partner):
        return replace(effect, declared_as=replace(effect.declared_as, sigma=_ANY_GAP_M)), free
    return effect, free


def _compared(anew: ClosureFit, before: Layout, fixture: Fixture):
    """(sort, words, said by the touches, known, standard deviation), lengths in m."""
    covariance = anew.fit.covariance
    for each in known_lengths(anew.layout, fixture):
        sort = "distance" if each.is_distance else "radius"
        sd = np.sqrt(each.row @ covariance @ each.row + each.sigma**2)
        yield sort, each.name, each.known - each.residual, each.known, sd
    deviation = np.sqrt(np.diag(covariance))
    at = {name: k for k, name in enumerate(anew.layout.names)}
    for effect, old in zip(anew.layout.effects, before.effects):
        if isinstance(effect, Bar) and not effect.absolute and old.absolute:
            sd = deviation[at[effect.parameter_label(effect.parameters()[3])]]
            words = f'zero of bar {effect.number} of session {effect.session} (zero = "free" would take it)'
            yield "bar", words, effect.values[3], 0.0, np.hypot(sd, SIGMA_M)
        if isinstance(effect, Partner):
            known = old.declared_as
            sd = deviation[at["partner_gap_m"]]
            yield ("partner", "distance of the balls of both arms", known.distance + effect.values[9],
                   known.distance, np.hypot(sd, known.sigma))
