"""The next poses to measure: those that tell most about which cause it is, in bits per minute.

Candidates are random poses inside the joint limits (or the measured range) with the target inside the
measured space, each approached from both directions, with the flange as it was and with a known payload on
it. Poses are chosen one by one (cause_information.py) until they would tell most of what is not known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy import linalg

from exactarm.chain import View, predict_poses
from exactarm.data.columns import PAYLOAD, PAYLOAD_CENTRE
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.design.pose_space import Box, PoseSpace
from exactarm.diagnose.cause_information import Field, Hypothesis, chosen_for
from exactarm.diagnose.confusion import Place
from exactarm.diagnose.decisions import CREDIBLE, WIDE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.scan import free_mask, linear_columns
from exactarm.effects.base import Effect
from exactarm.errors import ComputationError
from exactarm.robot.robot import Robot

PAYLOAD_KG = 5.0  # of the payload that is proposed, in the flange's centre: what most arms carry
# to drive to a pose and measure; to mount a payload: assumed
MINUTES = MappingProxyType({"visit": 0.25, "payload": 5.0})
_LISTED = 4  # poses in a sentence
_CANDIDATES = 200
_MOST_POSES = 24
_LEAST = 0.01  # of what is open, for one more pose: thirty seconds that tell less are better spent otherwise
_LITTLE = 0.3  # of what is open: below it an experiment does not part the causes
_RIDGE = 1e-9  # of a column's square sum


@dataclass(frozen=True)
class Experiment:
    """q (K, n) in the controller's angles, rad; each pose is approached from both directions with
    `payload_kg` on the flange.

    bits: told about the cause, of `open_bits` that are not known; between: the causes, in words.
    """

    q: np.ndarray
    payload_kg: float
    bits: float
    open_bits: float
    between: str

    @property
    def title(self) -> str:
        return "poses" if not self.payload_kg else f"poses with {self.payload_kg:g} kg at the flange"

    def minutes(self, cost: Mapping[str, float] = MINUTES) -> float:
        return 2.0 * len(self.q) * cost["visit"] + (cost["payload"] if self.payload_kg else 0.0)

    def bits_per_minute(self, cost: Mapping[str, float] = MINUTES) -> float:
        return self.bits / self.minutes(cost)

    @property
    def parts(self) -> bool:
        """Whether it tells enough to be worth its time."""
        return self.bits > _LITTLE * self.open_bits


def sentence_of(experiments: Sequence[Experiment]) -> str:
    """What to measure next, and what it would tell; the best experiment stands first."""
    best = experiments[0]
    told = f"{best.bits:.2f} of {best.open_bits:.2f} bits"
    if not best.parts:
        return (f"No poses inside the limits tell whether it is {best.between} ({len(best.q)} poses from "
                f"both directions, with and without {PAYLOAD_KG:g} kg: {told} at most): measure at another "
                "temperature or speed, or the gear of the axis alone.")
    load = f" with {best.payload_kg:g} kg at the flange" if best.payload_kg else ""
    minutes = round(best.minutes())
    time = "less than a minute" if minutes < 1 else f"some {minutes} minute{'s' * (minutes > 1)}"
    return (f"Measure {_named(best.q)}{load}, approached from both directions: in {time} this tells {told} "
            f"about whether it is {best.between}. `exactarm design --for result.json` writes these poses.")


def _named(q: np.ndarray) -> str:
    """Few poses by their angles, many by their number."""
    names = ["(" + ", ".join(str(round(float(angle))) for angle in np.rad2deg(each)) + ")" for each in q]
    different = list(dict.fromkeys(names))
    if len(different) > _LISTED:
        return f"{len(names)} poses"
    counted = (name if names.count(name) == 1 else f"{name} {names.count(name)} times" for name in different)
    return f"q = {'; '.join(counted)} degrees"


def next_poses(robot: Robot, fitted: Fitted, places: Sequence[Place], seed: int) -> tuple[Experiment, ...]:
    """The best poses with and without payload, most bits per minute first (those that part the causes before
    all others)."""
    q = _candidate_poses(robot, fitted, seed)
    states = [_State.of(fitted, place) for place in places]
    found = []
    for payload in (0.0, PAYLOAD_KG) if robot.links is not None else (0.0,):
        fields, rows = _seen(robot, fitted, states, q, payload)
        chosen, _ = chosen_for(fields, rows, _MOST_POSES, CREDIBLE, _LEAST)
        unknown = sum(f.entropy for f in fields)
        for count in range(1, len(chosen) + 1):
            bits = _simulated(fields, rows, chosen[:count], seed)
            if bits >= CREDIBLE * unknown:
                break
        found.append(Experiment(q[chosen[:count]], payload, bits, unknown,
                                "; ".join(place.titles for place in places)))
    return tuple(sorted(found, key=lambda e: (not e.parts, -e.bits_per_minute())))


def _seen(robot: Robot, fitted: Fitted, states: list[_State], q: np.ndarray,
          payload_kg: float) -> tuple[list[Field], list[np.ndarray]]:
    """The field of each place, and in its parameters the rows (K, 6, P) of every pose."""
    view = _view(robot, fitted, q, payload_kg)
    fields, rows = [], []
    for state in states:
        block = state.rows(view, fitted).reshape(len(q), 6, -1)
        scale = state.scale_with(block)
        fields.append(state.field(scale))
        rows.append(block * scale)
    return fields, rows


def _simulated(fields: list[Field], rows: list[np.ndarray], chosen: list[int], seed: int) -> float:
    rng = np.random.default_rng(seed)
    return float(sum(field.simulated_bits(each[chosen].reshape(6 * len(chosen), -1), rng)
                     for field, each in zip(fields, rows)))


@dataclass(frozen=True)
class _State:
    """What the data so far know of one place: columns are the declared parameters, then those of every cause
    of the field.

    information (P, P) and right (P,): normal equations of the data; prior (P,): of the causes' coefficients;
    own: for every cause, which columns are its own.
    """

    keep: np.ndarray
    effects: tuple[Effect, ...]
    probabilities: tuple[float, ...]
    information: np.ndarray
    right: np.ndarray
    prior: np.ndarray
    own: tuple[slice, ...]

    @staticmethod
    def of(fitted: Fitted, place: Place) -> _State:
        labels = [effect.label for effect in fitted.layout.effects]
        keep, base = np.ones(fitted.layout.size, bool), fitted
        if place.effect.label in labels:
            index = labels.index(place.effect.label)
            keep[fitted.layout.slices[index]] = False
            base = fitted.without(index)
        effects = (place.effect, *(rival for rival, _ in place.rivals))
        total = place.probability + sum(p for _, p in place.rivals)
        probabilities = tuple(p / total for p in (place.probability, *(p for _, p in place.rivals)))
        declared = np.concatenate([base.standard(base.jacobian), base.prior_rows])
        causes = [linear_columns(base, effect) for effect in effects]
        columns = np.concatenate([declared, *causes], axis=1)
        prior, own, at = [np.zeros(declared.shape[1])], [], declared.shape[1]
        for effect, cause in zip(effects, causes):
            sizes = [WIDE * max(p.plausible, abs(v))
                     for p, v, free in zip(effect.parameters(), effect.values, free_mask(effect)) if free]
            prior.append(1.0 / np.square(sizes))
            own.append(slice(at, at + cause.shape[1]))
            at += cause.shape[1]
        return _State(keep, effects, probabilities, columns.T @ columns, columns.T @ base.whitened,
                      np.concatenate(prior), tuple(own))

    def rows(self, view: View, fitted: Fitted) -> np.ndarray:
        """(N, 3, P) whitened sensitivities of new rows."""
        causes = [view.response(effect)[:, :3, free_mask(effect)] for effect in self.effects]
        columns = np.concatenate([view.tangents["measured"][:, :3, self.keep], *causes], axis=2)
        return columns / fitted.sigma[:3, None]

    def scale_with(self, blocks: np.ndarray) -> np.ndarray:
        """(P,) that gives all columns, over old data and the average new pose, unit length."""
        seen = np.diag(self.information) + np.mean(np.sum(blocks**2, axis=1), axis=0) + self.prior
        return 1.0 / np.sqrt(np.where(seen > 0.0, seen, 1.0))

    def field(self, scale: np.ndarray) -> Field:
        """Every cause in turn fitted to the data so far, with all declared parameters."""
        declared = np.arange(len(self.right)) < self.own[0].start
        found = []
        for own, probability in zip(self.own, self.probabilities):
            which = declared.copy()
            which[own] = True
            square = (self.information + np.diag(self.prior))[np.ix_(which, which)] * np.outer(scale[which],
                                                                                               scale[which])
            inverse = linalg.inv(square + _RIDGE * np.eye(len(square)))
            mean, covariance = np.zeros(len(which)), np.zeros((len(which), len(which)))
            mean[which] = inverse @ (self.right * scale)[which]
            covariance[np.ix_(which, which)] = 0.5 * (inverse + inverse.T)
            found.append(Hypothesis(probability, mean, covariance))
        return Field(tuple(found))


def _view(robot: Robot, fitted: Fitted, q: np.ndarray, payload_kg: float) -> View:
    """Every pose from both directions, (2 K) rows."""
    data, both_ways = fitted.view.data, np.repeat(q, 2, axis=0)
    means = {name: float(values.mean()) for name, values in data.covariates.items()}
    if payload_kg:  # in place of what the rows carried, at the flange's origin
        means = {name: mean for name, mean in means.items() if name not in PAYLOAD_CENTRE}
        means[PAYLOAD] = payload_kg
    new = Dataset.of_arrays(POSES.name,
                            {"q": both_ways, "approach": np.tile([[-1.0], [1.0]], (len(q), robot.axes))},
                            session=np.full(len(both_ways), data.session[0]),
                            position=np.zeros((len(both_ways), 3)),
                            covariates={name: np.full(len(both_ways), mean) for name, mean in means.items()})
    return predict_poses(robot, fitted.layout, new).view


def _candidate_poses(robot: Robot, fitted: Fitted, seed: int) -> np.ndarray:
    """(C, n) poses with the target in the measured space, where the device sees it; an axis without limits
    stays in its measured range. Where hardly any pose of the whole range leads there, all axes do; at last
    the target may be anywhere. Raises ComputationError where even so hardly any pose is clear of the arm."""
    measured = fitted.view.q
    low, high = measured.min(axis=0), measured.max(axis=0)
    joints = tuple(replace(joint, q_min=low[i] if joint.q_min is None else joint.q_min,
                           q_max=high[i] if joint.q_max is None else joint.q_max)
                   for i, joint in enumerate(robot.joints))
    open_space = PoseSpace.of(replace(robot, joints=joints), Box(np.full(3, -np.inf), np.full(3, np.inf)))
    seen = open_space.target(measured)
    space = replace(open_space, box=Box(seen.min(axis=0), seen.max(axis=0)))
    near = replace(space, lower=np.maximum(low, space.lower), upper=np.minimum(high, space.upper))
    for each in (space, near):
        try:
            return each.draw(_CANDIDATES, np.random.default_rng(seed))
        except ComputationError:
            continue
    return open_space.draw(_CANDIDATES, np.random.default_rng(seed))
