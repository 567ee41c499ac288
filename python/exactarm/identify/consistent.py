"""Identified links that are bodies: the same motion, with every pseudo-inertia positive definite.

    minimise  |A (z - z0) - e|^2 / 2 + w sum_i D(P_i | Q_i)    over bodies P_i > 0 and the others' bounds

    D(P | Q) = tr(Q^-1 P) - log det(Q^-1 P) - d      the entropic distance (Lee, Wensing and Park 2020)

z: all ten parameters of every link, rotors, friction; e, A: torque residual and Jacobian of the motion,
whitened, correlated samples counted as such; P_i (4, 4) kg m^2, kg m, kg; Q_i: prior_bodies.py; a rotor
that only a sum with a link shows is a body of one number. The problem is convex and -log det keeps P
inside: Newton's method with the bounds of trust_region.py, the weight w lowered from where the prior
rules, in steps of ten or of less where Newton's method would not come to the next centre: bodies that
are far from their priors lie at the edge of their cones by then. w is so small that D moves what the
motion shows by a part of its interval; what it does not show, D alone decides. Where the chain is not
linear in z (springs), the residual is linearised again at the result until it says what was predicted.
Limits: the bodies are possible ones, not the true ones.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from exactarm.chain import Layout, MotionRecord, predict_motion
from exactarm.effects.base import Effect
from exactarm.effects.declared_rotor import DeclaredRotor
from exactarm.effects.link_inertia import LinkInertia
from exactarm.identify.layout_fit import pulls_of
from exactarm.identify.motion_fit import MotionFit
from exactarm.identify.prior_bodies import declares_bodies, prior_bodies
from exactarm.numerics.factors import lstsq
from exactarm.numerics.trust_region import Model, bounded_step
from exactarm.robot.pseudo_inertia import BASIS, inertial_parameters
from exactarm.robot.robot import Robot

# Of the entropic distance: the size of a link is drawn to its body's with a standard deviation of
# 1 / (2 sqrt w) = 1.6 times itself. Masses of a drawing or of a bar are wrong by a factor of two or three.
WEIGHT = 0.1
_FIRST_WEIGHT = 1e6  # beside the last: the prior rules
_LOWERED, _LEAST_LOWERED = 10.0, 1.02  # times, from one weight to the next
_NEWTON_STEPS = 100
_DECREMENT = 1e-9  # half square sum in noise units, of which a standard deviation is worth 0.5
_STAY_INSIDE = 0.99  # of the way to the edge of the cone
_LINEARISATIONS = 8
_AS_PREDICTED = 1e-3  # RMS difference of the linear prediction from the chain, beside the noise


class Consistent(NamedTuple):
    """fit: the given one at the consistent estimate, links bodies; reason: "" or why it did not arrive."""

    fit: MotionFit
    reason: str


@dataclass(frozen=True)
class _Block:
    """A body: where its parameters stand in z, basis (k, d, d) of its matrix, prior Q (d, d)."""

    where: np.ndarray
    basis: np.ndarray
    prior: np.ndarray

    def matrix(self, z: np.ndarray) -> np.ndarray:
        return np.tensordot(z[self.where], self.basis, axes=1)


def consistent_fit(robot: Robot, declared: Robot, fit: MotionFit, record: MotionRecord,
                   threads: int = 1) -> Consistent:
    """`fit` of `robot` (with links in its tables) brought to bodies; `declared`: the robot of the file."""
    n = robot.axes
    baked = fit.layout.baked(robot, declared=True)
    blocks = [_Block(np.arange(10 * i, 10 * i + 10), BASIS, Q) for i, Q in enumerate(prior_bodies(declared))]
    each = enumerate(zip(fit.layout.effects, fit.layout.free))
    others = fit.layout.only(k for k, (e, mask) in each
                             if e.inertia_of != "links" and (mask.any() or not e.declared))
    lent = _lent_rotors(baked, fit.layout)
    for k, rotor in enumerate(lent):
        if rotor.values[0] > 0.0:
            blocks.append(_Block(np.array([10 * n + k]), np.ones((1, 1, 1)), np.array([[rotor.values[0]]])))
    layout = Layout.of((LinkInertia.of(baked, range(10 * n)), *lent))
    layout = layout.joined(others)
    weight = np.sqrt(np.minimum(fit.uncertainty.effective / record.keep.sum(), 1.0)) / fit.sigma

    z, reason = layout.values, "the bodies did not settle"
    start = None
    for _ in range(_LINEARISATIONS):
        residual, jacobian = _whitened(robot, layout.at(z), record, fit.axes, weight, threads)
        triangle = np.linalg.qr(np.column_stack([jacobian, residual + jacobian @ z]), mode="r")
        if start is None:
            blocks = blocks if declares_bodies(declared) else _scaled(blocks, triangle, n)
            start = _start(blocks, z)
        start, arrived = _minimised(triangle, blocks, layout, start)
        expected = residual - jacobian @ (start - z)
        z = start
        found, _ = _whitened(robot, layout.at(z), record, fit.axes, weight, threads, tangents=False)
        noise = np.sqrt(np.mean(weight**2 * fit.sigma**2))
        if arrived and np.sqrt(np.mean((found - expected) ** 2)) <= _AS_PREDICTED * noise:
            reason = ""
            break
    beside = dict(zip(map(id, others.effects), layout.at(z).effects[-len(others.effects):]))
    settled = tuple(beside.get(id(effect), effect) for effect in fit.layout.effects)
    return Consistent(_at(fit, settled, layout.at(z).baked(robot, declared=True), record, threads), reason)


def _lent_rotors(robot: Robot, layout: Layout) -> tuple[DeclaredRotor, ...]:
    """Rotors that are not estimated but may share what the links show: those of a sum, and declared ones."""
    asked = [(e, mask) for e, mask in zip(layout.effects, layout.free) if e.inertia_of == "rotor"]
    estimated = {e.index for e, mask in asked if mask.any()}
    still = {e.index for e, mask in asked if not mask.any() and not robot.joints[e.index].rotor_inertia}
    return tuple(DeclaredRotor.of(robot, i) for i in range(robot.axes) if i not in estimated | still)


def _whitened(robot, layout, record, axes, weight, threads, tangents=True):
    prediction = predict_motion(robot, layout, record, tangents=tangents, threads=threads)
    residual = (prediction.residual()[record.keep][:, axes] * weight).ravel()
    if not tangents:
        return residual, None
    return residual, (prediction.jacobian[record.keep][:, axes] * weight[:, None]).reshape(residual.size, -1)


def _scaled(blocks: list[_Block], triangle: np.ndarray, links: int) -> list[_Block]:
    """The bars as heavy together as this motion asks, all other parameters being free."""
    size = triangle.shape[1] - 1
    others = np.ones(size, bool)
    together = np.zeros(size)
    for block in blocks[:links]:
        others[block.where] = False
        together[block.where] = inertial_parameters(block.prior)
    columns = np.column_stack([triangle[:, :size] @ together, triangle[:, :size][:, others]])
    scale = lstsq(columns, triangle[:, size], rcond=None)[0][0]
    if not scale > 0.0:
        return blocks
    return [replace(block, prior=scale * block.prior) for block in blocks[:links]] + blocks[links:]


def _start(blocks: list[_Block], z: np.ndarray) -> np.ndarray:
    """The prior's bodies, and everything else as it was fitted."""
    z = z.copy()
    for block in blocks:
        z[block.where] = inertial_parameters(block.prior) if len(block.where) == 10 else block.prior[0]
    return z


def _minimised(triangle: np.ndarray, blocks: list[_Block], layout: Layout,
               z: np.ndarray) -> tuple[np.ndarray, bool]:
    """(z, whether Newton's decrement has vanished), from a z inside the cones."""
    low = np.array([p.lower for p in layout.parameters])
    high = np.array([p.upper for p in layout.parameters])
    for block in blocks:
        low[block.where], high[block.where] = -np.inf, np.inf
    z = np.clip(z, low, high)
    pull, middle = pulls_of(layout)
    A, right = np.vstack([triangle[:, :-1], pull]), np.concatenate([triangle[:, -1], pull @ middle])
    ahead, centre, factor = _FIRST_WEIGHT * WEIGHT, np.inf, _LOWERED
    while True:
        found, arrived = _centred(A, right, blocks, (low, high), z, ahead)
        if arrived:
            z, centre = found, ahead
            if ahead <= WEIGHT:
                return z, True
        else:
            factor = np.sqrt(factor)
            if factor < _LEAST_LOWERED or centre == np.inf:
                return found, False
        ahead = max(centre / factor, WEIGHT)


def _centred(A, right, blocks, bounds, z, weight) -> tuple[np.ndarray, bool]:
    """Newton's method at one weight: where it ends, and whether its decrement has vanished there."""
    low, high = bounds
    for _ in range(_NEWTON_STEPS):
        rows, residual = _newton_rows(A, right, blocks, z, weight)
        unit = np.linalg.norm(rows, axis=0)
        unit[unit == 0.0] = 1.0
        model = Model(rows / unit, residual)
        step = bounded_step(model, (low - z) * unit, (high - z) * unit, np.inf).step
        fall = model.fall(step)
        if fall <= _DECREMENT:
            return z, True
        longer = _along(A, right, blocks, z, step / unit, weight, fall)
        if longer is None:
            break
        z = np.clip(longer, low, high)
    return z, False


def _newton_rows(A, right, blocks, z, weight):
    """Rows whose square sum is the Hessian, and the residual that makes them the gradient: with P = L L',
    tr(P^-1 E P^-1 E) = |L^-1 E L^-T|^2 and tr(Q^-1 E) - tr(P^-1 E) = <L' Q^-1 L - 1, L^-1 E L^-T>."""
    rows, residual = [A], [A @ z - right]
    for block in blocks:
        L = np.linalg.cholesky(block.matrix(z))
        inside = np.linalg.inv(L)
        own = np.zeros((L.size, len(z)))
        own[:, block.where] = (inside @ block.basis @ inside.T).reshape(len(block.where), -1).T
        rows.append(np.sqrt(weight) * own)
        residual.append(np.sqrt(weight) * (L.T @ np.linalg.solve(block.prior, L) - np.eye(len(L))).ravel())
    return np.vstack(rows), np.concatenate(residual)


def _along(A, right, blocks, z, step, weight, fall):
    """z + t step, t <= 1, inside the cones, where the objective falls as promised in part; None: nowhere."""
    share = 1.0
    for block in blocks:
        inside = np.linalg.inv(np.linalg.cholesky(block.matrix(z)))
        worst = np.linalg.eigvalsh(inside @ block.matrix(step) @ inside.T)[0]
        share = min(share, -_STAY_INSIDE / worst if worst < 0.0 else 1.0)
    now = _objective(A, right, blocks, z, weight)
    while share > 1e-12:
        if _objective(A, right, blocks, z + share * step, weight) <= now - 0.1 * share * fall:
            return z + share * step
        share *= 0.5
    return None


def _objective(A, right, blocks, z, weight) -> float:
    total = 0.5 * float(np.sum((A @ z - right) ** 2))
    for block in blocks:
        P = block.matrix(z)
        total += weight * float(np.trace(np.linalg.solve(block.prior, P)) - np.linalg.slogdet(P)[1])
    return total


def _at(fit: MotionFit, effects: tuple[Effect, ...], robot: Robot, record: MotionRecord,
        threads: int) -> MotionFit:
    """The fit in the robot with bodies: the same free parameters, at the values of tables and `effects`."""
    layout = Layout(tuple(e.from_tables(robot) for e in effects), fit.layout.free)
    x = layout.values
    lower, upper = (np.array([getattr(p, side) for p in layout.parameters]) for side in ("lower", "upper"))
    at_bound = (x <= lower) | (x >= upper)
    prediction = predict_motion(robot, layout, record, threads=threads)
    found = replace(fit.fit, x=x, at_bound=at_bound)
    return replace(fit, robot=robot, layout=layout, fit=found, prediction=prediction)
