"""Verdict: what a diagnosis says in one word and in one sentence.

    explained              effects were found, and what is left is noise
    no_undeclared_effect   nothing was found, and nothing is missing
    unexplained            something else is at work: its posterior probability is above one half, the error
                           on held-out rows is far above what the fit lets expect, repeated visits scatter
                           far less than the model errs, waves in time stand out of its noise (gear runs), it
                           changes slowly along a tracked path,
                           held-out rows speak against the effects found (held_out_evidence.py), unless
                           by all rows there may well be no cause: then nothing was found; they are left out
                           as wrong more often than fitted ones, or, of poses, more of them than chance makes
                           err farther than all fitted ones
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from exactarm.diagnose.decisions import CREDIBLE, DOUBT, FEW, NAMED_AT, UNLIKELY
from exactarm.diagnose.dossier import Dossier
from exactarm.diagnose.held_out_evidence import AGAINST
from exactarm.diagnose.noise import NoiseFloor
from exactarm.diagnose.not_noise import not_noise
from exactarm.diagnose.posterior import Causes
from exactarm.diagnose.selected import Undecided
from exactarm.diagnose.signal import Structure

EXPLAINED, NOTHING, UNEXPLAINED = "explained", "no_undeclared_effect", "unexplained"
_NOISE_REACHED = 1.25  # RMS after, beside the noise floor
_FAR_ABOVE_NOISE = 1.5  # RMS after, beside a measured noise floor: something is left, whatever it follows
_MOST_TOLD = 2  # unknown structures in the verdict's sentence; the report has all
_NO_CHANGE = 0.005  # of the RMS error: less is no change in words
_SHARE_EXPLAINED = 0.5  # of the square sum above the noise; less, and the cause is not found
_CARRIES_OVER = 1.6  # held-out error beside the expected one
# of what the held-out error had above noise and spread of the fit; more, and the structure left counts
_SHARE_STRAY = 0.25
# of the RMS of a torque: drives are noisy, but a model that leaves half of it has not explained it
_MUCH_LEFT = 0.5


def verdict_of_causes(causes: Causes, after, noise: NoiseFloor, excess: float, structure: bool,
                      chance: float = 0.0) -> str:
    """From the posterior; held-out rows, repeated visits and a structure that is left beyond chance may only
    object. chance: as in `far_above`."""
    judged = "validation" if after["validation"].n else "identification"
    far = noise.measured and far_above(after[judged].rms, noise, chance)
    if causes.probability_something_else >= NAMED_AT or not_noise(causes.noise):
        return UNEXPLAINED
    if carries_badly(excess) or far:
        return UNEXPLAINED
    if causes.places:
        return UNEXPLAINED if structure else EXPLAINED
    return NOTHING if causes.probability_nothing >= UNLIKELY else UNEXPLAINED


def without_refuted(causes: Causes | None, sure: Sequence[float], gain: float) -> Causes | None:
    """Causes without those named where held-out rows, which leave them the probabilities `sure`, refute all,
    and by all rows there may well be none; else None: something else may have looked like them. gain: of the
    held-out rows with all of them, in nats, which takes as much from what could stand in their place. No
    cause at all has then its share of what is left."""
    if causes is None or not causes.places or max(sure) >= NAMED_AT:
        return None
    none, any_cause = causes.probability_nothing, 1.0 - causes.probability_nothing
    by_all_rows = none / (none + any_cause * np.exp(min(gain, 0.0)))
    nothing = min(place.nothing for place in causes.places)
    if min(by_all_rows, nothing) < UNLIKELY:
        return None
    return replace(causes, fits=causes.fits[:1], places=(), probability_nothing=nothing)


def rms_of(values: np.ndarray) -> float:
    """NaN where there are none."""
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def judged_of(errors: dict[str, np.ndarray]) -> np.ndarray:
    """Errors that the model is judged by: of the validation rows, where there are any."""
    values = errors["validation"] if errors["validation"].size else errors["identification"]
    return values[np.isfinite(values)]


def held_out_excess(errors: dict[str, np.ndarray], unit: float, spread: float = 0.0) -> float:
    """How many times more the model errs on held-out rows than its fit lets expect; 1 where nothing is held
    out.

    RMS of the two sets (N,), each without its worst tenth (wrong rows are no lack of the model). A fit with
    few degrees of freedom errs less on its own rows, and more on others, than the noise `unit`: by about the
    same factor. spread: mean square of the held-out errors that the uncertainty of the parameters may
    explain.
    """
    held, fitted = (np.sort(np.abs(values[np.isfinite(values)]))
                    for values in (errors["validation"], errors["identification"]))
    if not held.size or not fitted.size:
        return 1.0
    most = lambda values: rms_of(values[: max(1, int((1.0 - FEW) * len(values)))])
    return float(np.sqrt(max(most(held) ** 2 - spread, 0.0)) / max(most(fitted), 1e-300)
                 / max(1.0, unit / max(rms_of(fitted), 1e-300)) ** 2)


def verdict_by_rules(problem, before, after, noise: NoiseFloor, left: Dossier, found: bool, spread: float,
                     excess: float, share: float = 0.0, chance: float = 0.0) -> str:
    """share: RMS of what is left over that of what was measured, where that starts at nothing; spread: mean
    square of the held-out errors that the uncertainty of the parameters explains; chance: as in
    `far_above`."""
    if carries_badly(excess):
        return UNEXPLAINED
    judged = "validation" if after["validation"].n else "identification"
    rms_before, rms_after = before[judged].rms, after[judged].rms
    above, remaining = rms_before**2 - noise.value**2, rms_after**2 - noise.value**2
    strongest = left.strongest
    still = left.structure and strongest.share > problem.share_left
    if noise.measured:
        still = still or (rms_after > _NOISE_REACHED * noise.value and left.structure)
        still = still and remaining > (1.0 - _SHARE_EXPLAINED) * max(above, 1e-300)
        still = still or far_above(rms_after, noise, chance)
    elif still:
        # What follows the signal is structure, the rest at most noise.
        structure = strongest.share * rms_after**2
        taken = max(rms_before**2 - rms_after**2, 0.0)
        still = (
            strongest.share > _SHARE_EXPLAINED or structure > (1.0 - _SHARE_EXPLAINED) * (taken + structure))
        still = still or (spread > 0.0 and remaining - spread > _SHARE_STRAY * max(above - spread, 1e-300))
    if still:
        return UNEXPLAINED
    if found:
        return EXPLAINED
    # a floor that comes from the fit proves nothing by itself
    return NOTHING if noise.measured or share < _MUCH_LEFT else UNEXPLAINED


def far_above(rms: float, noise: NoiseFloor, chance: float) -> bool:
    """Whether an error is no measured noise, even less the mean square `chance` that the uncertainty of the
    parameters may make of it on rows that were not fitted."""
    return rms**2 - chance > (_FAR_ABOVE_NOISE * noise.value) ** 2


def more_left_out(fitted: int, fitted_rows: int, held: int, held_rows: int) -> bool:
    """Whether rows that were not fitted are left out more often, beyond chance, than fitted ones (Fisher's
    exact test): wrong readings fall on all alike; what a fit has followed in its own rows shows in others."""
    k = np.arange(max(0, fitted + held - fitted_rows), min(held_rows, fitted + held) + 1)
    ways = np.exp(_log_ways(held_rows, k) + _log_ways(fitted_rows, fitted + held - k)
                  - _log_ways(held_rows + fitted_rows, np.array(fitted + held)))
    return bool(np.sum(ways[k >= held]) < DOUBT)


def farther_out(errors: dict[str, np.ndarray], poses: dict[str, np.ndarray], unit: float) -> int:
    """How many of the held-out poses err farther than all fitted ones, if that is more than chance makes;
    else 0. errors, poses: of both sets, by row; a pose that was visited again errs by the RMS of its visits.
    Of poses that are all alike the k worst are all held out with

        p = C(held, k) / C(all, k)

    A fit follows its own rows: theirs are lessened by as much as in `held_out_excess`. Jumps that a smooth
    curve passes over show in some rows alone, whose square sum many good rows outweigh."""
    held, fitted = (_by_pose(errors[name], poses[name]) for name in ("validation", "identification"))
    if not held.size or not fitted.size:
        return 0
    k = np.count_nonzero(held > fitted.max() * max(1.0, unit / max(rms_of(fitted), 1e-300)) ** 2)
    chance = _log_ways(held.size, np.array(k)) - _log_ways(held.size + fitted.size, np.array(k))
    return k if np.exp(chance) < DOUBT else 0


def _by_pose(errors: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """RMS of the finite errors of every pose that has one."""
    kept = np.isfinite(errors)
    _, pose = np.unique(poses[kept], return_inverse=True)
    return np.sqrt(np.bincount(pose, errors[kept] ** 2) / np.bincount(pose))


def _log_ways(rows: int, chosen: np.ndarray) -> np.ndarray:
    """Of so many rows to choose so many."""
    return special.gammaln(rows + 1) - special.gammaln(chosen + 1) - special.gammaln(rows - chosen + 1)


def rises(before, after) -> bool:
    """Whether the error of held-out rows is larger with the effects than without."""
    if not after["validation"].n:
        return False
    return after["validation"].rms > (1.0 + _NO_CHANGE) * before["validation"].rms


def falls(before, after, least: float = _NO_CHANGE) -> bool:
    """Whether the error that judges is smaller with the effects than without, by more than this share."""
    judged = "validation" if after["validation"].n else "identification"
    return after[judged].rms < (1.0 - least) * before[judged].rms


def carries_badly(excess: float) -> bool:
    """Whether held-out rows err so much more than the fit lets expect that the fit says little of them."""
    return excess > _CARRIES_OVER


def remains(left: Dossier, excess: float, unknown: tuple[Structure, ...] = (),
            most: int | None = None) -> str:
    """What is known of a structure that nothing explains; unknown: what the posterior says of it, of which
    `most` are told, None: all."""
    if unknown:
        known = "; ".join(map(str, unknown[:most]))
        known += f"; and {more} more" if (more := len(unknown) - len(unknown[:most])) else ""
    elif left.structure:
        known = f"it follows best the {left.strongest.signal}, along {left.strongest.direction}"
    else:
        known = "it follows no single signal beyond chance"
    if carries_badly(excess):
        known += (f", and on rows that were not fitted the error is {excess:.1f} times what the fit predicts")
    return known


def sentence_of(verdict, findings, alternatives, before, after, left: Dossier, excess: float,
                unknown: tuple[Structure, ...] = (), gain: float = 0.0,
                undecided: Undecided | None = None, withdrawn: tuple[str, ...] = (), dropped=(),
                faint: bool = False, along: str = "") -> str:
    """The verdict in one sentence that a technician understands; gain: of the held-out rows, in nats;
    undecided: causes of which one is missing; withdrawn: of those that held-out rows refute where
    nothing need be missing; dropped: effects that are no longer in the model; faint: what is left takes less
    away than an effect must; along: which component the error is, in words."""
    unnamed = "too small for a cause to be named" if faint else "that nothing in the library explains"
    judged = "validation" if after["validation"].n else "identification"
    if findings or dropped:
        stood, refuted = stood_and_refuted(findings)
        asked = refuted or dropped  # what is not in the model stands in a sentence of its own
        named = [f.effect.title for f in stood]
        fall = 1.0 - after[judged].rms / before[judged].rms
        it = "it" if len(named or asked) == 1 else "them"
        falls = (f"{'falls' if fall > 0.0 else 'rises'} by {100 * abs(fall):.0f} %"
                 if abs(fall) >= _NO_CHANGE else "does not change")
        asked_for = f"The fitted rows ask for {_listed([f.effect.title for f in asked])}"
        text = f"{_lacks(stood) if named else asked_for}; with {it} the {judged} RMS error{along} {falls}."
        text += beside(refuted if named else (), dropped if findings else ())
        doubtful = [a for a in alternatives if a.collides]
        if doubtful:
            a = doubtful[0]
            own = next(f.effect for f in findings if f.effect.label == a.instead_of)
            text += f" This data cannot tell {own.title} from {a.effect.title}."
        if gain < AGAINST or not named:
            likelier = [str(f.likelier) for f in (*refuted, *dropped) if f.likelier]
            return text + (outdone(likelier) if likelier and gain >= AGAINST
                           else spoken_against(len(stood or asked)))
        if undecided:
            return text + (f" Another cause is {'' if undecided.sure else 'probably '}missing, but this data "
                           f"cannot tell which: {undecided}.")
        if verdict == UNEXPLAINED:
            text += f" A structure is left {unnamed}; {remains(left, excess, unknown, _MOST_TOLD)}."
        return text
    if undecided:
        return (f"The model {'' if undecided.sure else 'probably '}lacks something, but this data cannot "
                f"tell which: {undecided}.")
    if verdict == UNEXPLAINED:
        return f"The residual has a structure {unnamed}; {remains(left, excess, unknown, _MOST_TOLD)}."
    if left.structure:
        like = ", as noise does that neighbouring rows share" if left.strongest.signal.of_time else ""
        share = 100.0 * left.strongest.share
        return (f"The data support no effect of the library: the residual follows the {left.strongest.signal}"
                f" beyond chance, but only with {f'{share:.0f}' if share >= 1.0 else 'less than 1'} % of its "
                f"square sum{like}.")
    text = "Nothing is missing: the residual of the declared model cannot be told from noise."
    return text + (f" (The fitted rows alone asked for {_listed(withdrawn)}; rows that were not fitted speak "
                   f"against {'it' if len(withdrawn) == 1 else 'them'}.)" if withdrawn else "")


def _lacks(stood) -> str:
    """The model and its findings, those that may be another cause last."""
    sure = [finding.effect.title for finding in stood if finding.probability >= CREDIBLE]
    unsure = [finding.effect.title for finding in stood if finding.probability < CREDIBLE]
    if not sure:
        return f"The model probably lacks {_listed(unsure)}"
    return f"The model lacks {_listed([*sure, *(f'probably {title}' for title in unsure)])}"


def stood_and_refuted(findings) -> tuple[list, list]:
    """Findings that the model lacks, and those that held-out rows, or unknown functions beside them, leave
    less likely than not."""
    stood = [finding for finding in findings if finding.probability >= NAMED_AT]
    return stood, [finding for finding in findings if finding.probability < NAMED_AT]


def beside(refuted, dropped=()) -> str:
    """After the sentence on what the others do: of findings that do not stand but are in the model, and of
    effects that are not."""
    worse = [finding.effect.title for finding in refuted if finding.likelier]
    unsure = [finding.effect.title for finding in refuted if not finding.likelier]
    held = [*([f"{_listed(unsure)}, less likely than not"] if unsure else []),
            *([f"{_listed(worse)}, where something else is likelier"] if worse else [])]
    text = f" The model also holds {'; and '.join(held)}." if held else ""
    outdone = [each.effect.title for each in dropped if not each.contradicted]
    asked = _listed([each.effect.title for each in dropped if each.contradicted])
    text += f" Something else is likelier than {_listed(outdone)}, left out of the model." if outdone else ""
    return text + (f" The fitted rows also ask for {asked}, which rows that were not fitted contradict."
                   if asked else "")


def _listed(titles: list[str]) -> str:
    titles = list(dict.fromkeys(titles))  # waves of one gear are one cause
    more = f" and {len(titles) - 3} more" if len(titles) > 3 else ""
    return ", ".join(titles[:3]) + more


def spoken_against(count: int) -> str:
    """Of so many effects, where held-out rows are predicted worse with them."""
    it = "it" if count == 1 else "them"
    return f" Rows that were not fitted speak against {it}: nothing is explained until other data say so."


def outdone(likelier: list[str]) -> str:
    """Where unknown functions, by their titles, explain better what the effects explain."""
    return (f" But it is likelier that {_listed(likelier)}: something else is at work, and nothing is "
            "explained until other data say so.")


def no_verdict(unconverged: tuple[str, ...]) -> str:
    """The sentence where a fit that the verdict would rest on has not arrived."""
    return (f"No verdict can rest on this: {unconverged[0]}. Check the data for gross errors, and the poses "
            "for what they can tell (exactarm identifiable).")
