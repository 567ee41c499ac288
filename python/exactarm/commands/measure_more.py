"""What to measure so that a structure that nothing explains shows its cause: one experiment for what it
follows.

A signal of one axis is varied alone; two signals together need rows that vary them independently; time,
temperature and place are visited again. Words alone: the experiment is the usual one of the field, no optimum
(which poses part two named causes: `diagnose/next_*.py`).
"""

import numpy as np
from scipy import special

from exactarm.data.kinds import kind_of
from exactarm.data.kinds.base import Device, Kind
from exactarm.diagnose.diagnosis import Diagnosis
from exactarm.diagnose.signal import Quantity, Signal, Structure
from exactarm.diagnose.verdict import carries_badly
from exactarm.identify.wild_rows import wild_elsewhere_line
from exactarm.report.numbers import quantity

# What is left follows, of which the first that holds counts: a signal of one of these quantities; for rows at
# rest.
_AT_REST = (
    ((Quantity.APPROACH,),
     "drive to twenty poses from both sides of axis {axis} (`exactarm design --both-ways`): the "
     "difference is what hangs on the direction"),
    ((Quantity.TWO_ANGLES,),
     "measure about as many poses again, every axis over its whole range and independent of the others "
     "(`exactarm design`): it shows at no axis alone"),
    ((Quantity.LOAD,),
     "measure the same poses with a known payload and without (column `payload_kg`): what hangs on the "
     "load of axis {axis} grows with it, what hangs on its angle does not"),
    ((Quantity.ANGLE,),
     "turn axis {axis} alone through its range in steps of 3 deg, in two postures of the others: what its"
     " angle does then shows by itself"),
    ((Quantity.TRAVEL,),
     "drive axis {axis} alone along its way in steps of a hundredth, in two postures of the others: what its"
     " guide does then shows by itself"),
    ((Quantity.POSITION, Quantity.PLACE), "{elsewhere}: what stays with the device is not the arm's"),
    ((Quantity.TIME, Quantity.ORDER),
     "visit five of the poses again every quarter of an hour: what changes with time shows there"))
_IN_MOTION = (
    ((Quantity.DIRECTION, Quantity.SPEED),
     "move axis {axis} alone to and fro, at three constant speeds from slow to fast: friction and play "
     "show at the reversals, the rest with the speed"),
    ((Quantity.ANGLE, Quantity.MOTOR_ANGLE),
     "turn axis {axis} alone through its range, slowly, both ways: what its angle does then shows by "
     "itself"),
    ((Quantity.TRAVEL,),
     "move axis {axis} alone along its way, slowly, both ways: what its guide does then shows by itself"),
    ((Quantity.LOAD,),
     "repeat the motion with a known payload: what hangs on the load of axis {axis} grows with it"),
    ((Quantity.ACCELERATION,),
     "play the same motion at half the speed: inertia and delays fall with it, friction and gears stay"),
    ((Quantity.POSITION, Quantity.PLACE), "{elsewhere}: what stays with the device is not the arm's"),
    ((Quantity.TIME,),
     "play the same motion cold, and after half an hour of work: what warms up shows in the difference"))
_WANDERS = (
    "see that nothing moved (base, device, reflector), and visit one pose again after every ten others: "
    "drift and jumps show there by themselves")
_IN_TIME = (
    "run each axis alone at half and at twice the speed: a wave of the gear leaves {hertz:.3g} Hz with the "
    "speed, one of the sensor, the mains or a swinging arm stays")
_ELSEWHERE = {
    Device.TARGET: "measure more {rows} over the whole work space, some from a second place of the tracker",
    Device.CONTACT: "touch at another place of the fixture",
}
_OTHER = "record the same once more at other values of the {signal}: what follows it shows in the difference"
_NOTHING = ("visit five poses ten times each: if they scatter as much as the error that is left, it is the "
            "device; if not, it is the arm, and more poses are needed",
            "record the same motion three times: what repeats is the arm, what does not is the sensor")
_WORTH_A_WORD, _CHANCE = 1.2, 0.01  # ratio of two errors, and how often chance alone makes one as large
_FEW_ROWS = {
    True: "measure as many poses again, elsewhere in the work space",
    False: "record at least two other motions with other speeds and postures",
}


def measure_more(result: Diagnosis) -> str:
    """One sentence for a diagnosis that leaves a structure."""
    kind = kind_of(result.kind)
    left = result.dossier_after
    told = result.unknown
    if not told and left.structure:
        told = (Structure(str(left.strongest.signal), (left.strongest.signal,)),)
    return experiment_for(kind, told, carries_badly(result.excess))


def to_tell_noise(result: Diagnosis) -> str:
    """One sentence for what is left as noise, where no repeated visit says how loud the noise is."""
    return (f"That the noise is {quantity(result.noise.value, result.unit)} (RMS) is what the fit says of "
            f"itself. If the device is better than that, {_NOTHING[not kind_of(result.kind).at_rest]}.")


def wild_elsewhere(result: Diagnosis) -> str | None:
    """One line, where single poses that were not fitted miss by far more than the others."""
    if not kind_of(result.kind).at_rest or result.unit != "m":
        return None
    spread = np.sqrt(result.problem.spread_by_row(result.selection.fits[-1]))
    return wild_elsewhere_line(result.errors_after["validation"], result.problem.held_out.place_of, spread)


def wild_among_fitted(result: Diagnosis) -> str | None:
    """One line, where single fitted poses miss by far more than the others, and count for little."""
    if not kind_of(result.kind).at_rest or result.unit != "m":
        return None
    return wild_elsewhere_line(result.errors_after["identification"], result.problem.data.place_of,
                               which="fitted rows")


def worse_elsewhere(result: Diagnosis) -> str | None:
    """One sentence for a diagnosis that finds nothing, whose rows that were not fitted err more than the
    others do, beyond chance (F-test, of one number a row: neighbours may share their errors)."""
    held, fitted = result.after["validation"], result.after["identification"]
    if not held.n or not fitted.rms > 0.0:
        return None
    ratio = held.rms / fitted.rms
    if ratio < _WORTH_A_WORD or special.fdtrc(held.n, fitted.n, ratio**2) > _CHANCE:
        return None
    kind = kind_of(result.kind)
    return (f"On {kind.rows} that were not fitted the error is {ratio:.2g} times as large as on the fitted "
            f"ones: so uncertain are the parameters there. To rely on them, {_FEW_ROWS[kind.at_rest]}.")


def experiment_for(kind: Kind, told: tuple[Structure, ...], far_larger: bool = False) -> str:
    """told: what is left; far_larger: it is, on rows that were not fitted."""
    words = _experiment(kind, told)
    if far_larger:
        words += ". The fitted rows tell too little about the others: " + _FEW_ROWS[kind.at_rest]
    return f"To find what is left, {words}."


def _experiment(kind: Kind, told: tuple[Structure, ...]) -> str:
    if any(structure.wanders for structure in told):
        return _WANDERS
    if hertz := next((structure.hertz for structure in told if structure.hertz is not None), None):
        return _IN_TIME.format(hertz=hertz)
    elsewhere = _ELSEWHERE.get(kind.device, "measure elsewhere in the work space").format(rows=kind.rows)
    signals = [signal for structure in told for signal in structure.signals]
    if any(sum(signal.places_axis for signal in structure.signals) > 1 for structure in told):
        signals.append(Signal(Quantity.TWO_ANGLES))
    for quantities, words in _AT_REST if kind.at_rest else _IN_MOTION:
        found = next((signal for signal in signals if signal.quantity in quantities), None)
        if found is not None:
            return words.format(elsewhere=elsewhere, axis=found.axis)
    if signals:
        return _OTHER.format(signal=signals[0])
    return _NOTHING[not kind.at_rest]
