"""Torques measured at rest beside the gravity of the links, declared or generic; all measured axes at once.

A drive holds the load, a sensor behind the gear shows it: a column of torques is the one or the other, and
which one gravity tells. Where the torques run against it, they are taken with the opposite sign, and a line
says so.

The readings have noise, and those of a drive its dry friction, which no spring behind the gear carries. A
spring fitted to such readings is too stiff, and what is smooth looks likelier than it (errors in variables,
Fuller 1987). The load is what a weight can be of them,

    tau_a = Y_a(q) pi + offset_a + friction_a direction_a + sum_k h_ak (cos k q_a, sin k q_a) + noise_a,

Y pi: gravity of links of any mass and centre, of any payload in each further session; the waves of the axis'
own angle, of a counterbalance, where the readings show them. Weighted least squares over all axes, each with
its own noise. An axis of which gravity is not most keeps its readings, less the friction.

Where masses are declared, pi ~ N(declared, (spread size)^2), size: a link's mass, or that at its length; the
spread is the likeliest of a few (empirical Bayes, MacKay 1992), so that readings with noise do not undo what
the file knows, and a file that is wrong does not bind them.
"""

from dataclasses import replace

import numpy as np
from scipy import special

from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.identify.loads import LEAST_SHARE, joint_angles
from exactarm.numerics.factors import lstsq, svd
from exactarm.rest_load import TORQUE_ERROR, TORQUES, RestLoad, measured_at_rest, weighed
from exactarm.robot.generic_masses import first_moments, with_generic_masses
from exactarm.robot.robot import Robot

AGAINST = -0.5  # correlation with gravity, from which on a sign is another: friction and noise make none
_WAVES = 2  # of a counterbalance: a spring on a lever
_SIGNIFICANT = 1e-3  # chance of readings without such waves to show them
_READINGS_EACH = 2  # for every number that is estimated: fewer leave the readings as they are
_PASSES = 3  # of weights by axis: a fourth changes no noise by 1e-4 of itself (poses of test_rest_torque.py)
_LEAST_NOISE = 1e-9  # of the largest reading: arithmetic
_SPREADS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)  # of declared masses, from right to worth nothing
_WORTH_A_WORD = 0.05  # of the spread of the readings of the axis that carries most


def beside_gravity(robot: Robot, data: Dataset) -> tuple[float, float] | None:
    """Correlation with the gravity of `robot`, which has masses, and how many times as much as it the torques
    vary; None where nothing was measured or gravity does not vary."""
    load = RestLoad.of(robot, data)
    if robot.links is None or not load.fixed.any():
        return None
    gravity, measured = load.parts(joint_angles(robot, data))["own"][0], load.measured
    axes = np.flatnonzero(load.fixed.all(axis=0))
    spread = gravity[:, axes].std(axis=0) if axes.size else np.zeros(0)
    if not axes.size or not spread.max() > 0.0:
        return None
    x, y = (values[:, axes] - values[:, axes].mean(axis=0) for values in (gravity, measured))
    norm = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    together = float(np.sum(x * y)) / norm if norm > 0.0 else 0.0
    return together, float(np.sqrt(np.sum(y**2) / np.sum(x**2)))


def as_drives_hold(robot: Robot, data: Dataset) -> Dataset:
    """The data with torques at rest as those of drives, which hold the load."""
    if not robot.has_geometry or not any(name in data.joints for name in TORQUES):
        return data
    found = beside_gravity(with_generic_masses(robot), data)
    if found is None or found[0] >= AGAINST:
        return data
    note = (f"the torques measured at rest run against gravity (correlation {found[0]:.2f}): they are taken "
            "with the opposite sign, as of a sensor that shows the load; if the arm is mounted otherwise, "
            "gravity_m_s2 of its file says how")
    turned = {name: -values if name in TORQUES else values for name, values in data.joints.items()}
    return replace(data, joints=turned, notes=(*data.notes, note))


def as_springs_carry(robot: Robot, data: Dataset) -> Dataset:
    """The data with torques at rest that hold no friction and no noise; a line says what was left out, and
    TORQUE_ERROR how far the noise leaves the size of a load open."""
    known = TORQUE_ERROR in data.joints or not any(name in data.joints for name in TORQUES)
    if known or not robot.has_geometry:
        return data
    measured = measured_at_rest(robot, data)
    axes = np.flatnonzero(~np.isnan(measured).any(axis=0))
    parts = _parts_of(with_generic_masses(robot), data, measured, axes) if axes.size else None
    if parts is None:
        return data
    torque, error, (load, friction, noise) = measured.copy(), np.zeros_like(measured), parts
    torque[:, axes], error[:, axes] = load, noise / np.sqrt(len(data))
    told = max(friction.max(), noise.max()) > _WORTH_A_WORD * measured[:, axes].std(axis=0).max()
    note = ("of the torques measured at rest, what weights explain is the load: dry friction of up to "
            f"{friction.max():.3g} Nm and noise of up to {noise.max():.3g} Nm (RMS) are left out")
    return replace(data, joints=dict(data.joints) | {"tau": torque, TORQUE_ERROR: error},
                   notes=(*data.notes, *([note] if told else [])))


def _parts_of(robot: Robot, data: Dataset, measured: np.ndarray, axes: np.ndarray
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Of measured axes: load (N, k), friction (k,) at most, RMS noise (k,), Nm; None of too few readings."""
    q = joint_angles(robot, data)
    known, weights = _of_weights(robot, data, q, axes)
    sizes = _sizes(robot, weights.shape[2])
    if sizes is not None:
        known = known + _core.gravity_torque(robot.core, q, 1)[:, axes]
    readings = measured[:, axes] - known
    way = data.joints.get("approach", data.way)
    way = np.zeros_like(q) if way is None else np.nan_to_num(way)
    still = [np.column_stack([np.ones(len(q)), *([way[:, a]] if np.ptp(way[:, a]) > 0.0 else [])])
             for a in axes]
    waves = [np.column_stack([turned(k * q[:, a]) for k in range(1, _WAVES + 1)
                              for turned in (np.cos, np.sin)]) for a in axes]
    own, found = [wave[:, :0] for wave in waves], None
    for _ in range(2):  # the second with the waves that the first has left
        estimate = _estimate(readings, weights, own, still, sizes)
        if estimate is None:
            break
        found, left = estimate, readings - estimate[0] - estimate[1]
        own = [wave if _shows(left[:, k], still[k], wave) else wave[:, :0] for k, wave in enumerate(waves)]
        if not any(part.shape[1] for part in own):
            break
    if found is None:
        return None
    load, beside = found
    left, free = readings - load - beside, known + readings - beside
    spread = np.sum((free - free.mean(axis=0)) ** 2, axis=0)
    by_weight = np.sum(left**2, axis=0) <= (1.0 - LEAST_SHARE) * spread
    friction = np.ptp(beside, axis=0) / 2.0
    return np.where(by_weight, known + load, free), friction, np.where(by_weight, left.std(axis=0), 0.0)


def _of_weights(robot: Robot, data: Dataset, q: np.ndarray, axes: np.ndarray
                ) -> tuple[np.ndarray, np.ndarray]:
    """Torques (N, k) of the payloads that are known, and (N, k, p) of unit masses and first moments of every
    link, and of what the flange carries in each session but the first."""
    rest = np.zeros_like(q)
    links = _core.dynamics_regressor(robot.core, q, rest, rest)[:, axes]
    links = links.reshape(*links.shape[:2], -1, 10)[..., :4]
    flange, sessions = links[:, :, -1], np.unique(data.session)[1:]
    further = [flange * (data.session == session)[:, None, None] for session in sessions]
    known = np.einsum("nak,nk->na", flange, weighed(data))
    return known, np.concatenate([links.reshape(*links.shape[:2], -1), *further], axis=2)


def _sizes(robot: Robot, count: int) -> np.ndarray | None:
    """(count,) of the masses and first moments of declared links; inf of what further sessions carry; None
    of an arm that declares none."""
    if robot.links is None or robot.generic_masses:
        return None
    mass = np.array([link.mass for link in robot.links])
    moment = np.maximum(first_moments(robot), np.finfo(float).tiny)
    own = np.column_stack([mass, *3 * [moment]]).ravel()
    return np.append(own, np.full(count - own.size, np.inf))


def _estimate(readings: np.ndarray, weights: np.ndarray, own: list[np.ndarray], still: list[np.ndarray],
              sizes: np.ndarray | None) -> tuple[np.ndarray, np.ndarray] | None:
    """(N, k) of weights and waves `own`, and (N, k) of offset and friction `still`; None of too few."""
    blocks = [weights]
    for part, axis in ((part, axis) for each in (own, still) for axis, part in enumerate(each)):
        blocks.append(np.zeros((*readings.shape, part.shape[1])))
        blocks[-1][:, axis] = part
    design, loads = np.concatenate(blocks, axis=2), weights.shape[2] + sum(part.shape[1] for part in own)
    size = np.full(design.shape[2], np.inf)
    size[: weights.shape[2]] = np.inf if sizes is None else sizes
    noise, least = np.ones(readings.shape[1]), _LEAST_NOISE * np.abs(readings).max()
    for _ in range(_PASSES):
        whitened = (design / noise[:, None]).reshape(readings.size, -1)
        values, rank = _likeliest(whitened, (readings / noise).ravel(), size)
        if readings.size < _READINGS_EACH * rank:
            return None
        noise = np.maximum((readings - design @ values).std(axis=0), max(least, np.finfo(float).tiny))
    return design[:, :, :loads] @ values[:loads], design[:, :, loads:] @ values[loads:]


def _likeliest(design: np.ndarray, readings: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, int]:
    """Values (p,) of readings (R,) with noise of one, those of finite size drawn to zero by the likeliest of
    `_SPREADS`, and the rank of the design (R, p)."""
    values, _, rank, _ = lstsq(design, readings)
    drawn = np.isfinite(size)
    if not drawn.any():
        return values, int(rank)
    free = design[:, ~drawn]
    across = lambda y: y - free @ lstsq(free, y)[0]
    u, d, v = svd(across(design[:, drawn] * size[drawn]), full_matrices=False)
    seen, square = u.T @ across(readings), d[:, None] ** 2 * np.square(_SPREADS)
    likely = 0.5 * np.sum(square / (1.0 + square) * seen[:, None] ** 2 - np.log1p(square), axis=0)
    spread = _SPREADS[int(np.argmax(likely))]
    values[drawn] = size[drawn] * (v.T @ (spread**2 * d / (1.0 + (spread * d) ** 2) * seen))
    values[~drawn] = lstsq(free, readings - design[:, drawn] @ values[drawn])[0]
    return values, int(rank)


def _shows(left: np.ndarray, still: np.ndarray, waves: np.ndarray) -> bool:
    """Whether residuals (N,) follow waves (N, p) beyond chance (F-test), beside what stands still."""
    squares = [float(np.sum((left - columns @ lstsq(columns, left)[0]) ** 2))
               for columns in (still, np.column_stack([still, waves]))]
    free, taken = len(left) - still.shape[1] - waves.shape[1], squares[0] - squares[1]
    if free <= 0 or not squares[1] > 0.0:
        return False
    ratio = taken / waves.shape[1] / (squares[1] / free)
    return bool(special.fdtrc(waves.shape[1], free, ratio) < _SIGNIFICANT)
