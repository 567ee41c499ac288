"""Usual mistakes in the angles of touches, each tried: would the touches meet without it?

    minimise over the tool t:  sum_rows e(p_i + R_i t)^2,   p_i, R_i: flange by the robot file, mistake undone
    e: what a point lacks to the contact that fits all its points best (seat, pair: their mean; face: the
       plane of least squares; ball, wire: the algebraic sphere of known or equal radius)

in shares of the flange's travel: angles that hardly turn the arm would meet anything. Mistakes are the same
changes of angles as for poses, tried in one batch. Nothing is corrected.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from exactarm.data.dataset import NO_CONTACT, Dataset
from exactarm.first_aid.axis_mistakes import SUSPICIOUS_SHARE, scales_and_zeros
from exactarm.first_aid.misfit import flanges
from exactarm.first_aid.pose_candidates import of_angles
from exactarm.first_aid.pose_mistakes import spread
from exactarm.first_aid.suspicion import FALL, Suspicion, in_order
from exactarm.identify.declared import carried_layout
from exactarm.identify.judged_rows import JUDGED_FROM, touched_contacts
from exactarm.identify.match import WORST_SHARE
from exactarm.measurement.closures import PAIR, touches
from exactarm.robot.robot import Placement, Robot

_MOST_CONTACTS, _MOST_ROWS, _LEAST_ROWS = 40, 240, 10  # evenly spread: a mistake shows in every row
# numbers beyond the unknowns, four an axis: 13 met by chance in one of 480 right data sets
_LEAST_FREEDOM = 24
_TOOLS_M = 0.15 * np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0.3], [-1, 0, 0.3], [0, 1, 0.3], [0, -1, 0.3]])
_STEPS, _STEPS_TO_THE_END, _TO_THE_END = 3, 12, 10
_DIFFERENCE_M = 1e-5
_PULL = 1e-3  # a tool of 1 m counts as 1 mm: none runs off
_LEVER_M = 0.1  # at which turns of the flange count as travel
_STILL_RAD = 0.1  # an axis that turns by less is at rest: faces meet in the plane of an arm whose axis 1 is

Contacts = list[tuple[str, np.ndarray, np.ndarray | None]]  # sort, rows, known lengths


def unused_distances(robot: Robot, data: Dataset) -> list[Suspicion]:
    """Known distances of contacts that no row touches, while others are touched that none of them names, or
    of other sorts of contacts than are touched."""
    found, listed = [], lambda numbers: ", ".join(map(str, sorted(numbers)))
    for contact in sorted({each.contact for each in data.fixture.distances} & data.contacts.keys()):
        touched = set(data.contacts[contact][data.contacts[contact] != NO_CONTACT].tolist())
        named = {k for each in data.fixture.distances if each.contact == contact for k in each.between}
        if named - touched and touched - named:
            found.append(Suspicion(
                f"the fixture's distances name {contact} {listed(named)}, the rows touch {listed(touched)}: "
                f"is one numbered from {min(named)}, the other from {min(touched)}? A distance of what is "
                "not touched counts for nothing"))
    touched = [contact for contact, numbers in data.contacts.items() if np.any(numbers != NO_CONTACT)]
    known = sorted({each.contact for each in data.fixture.distances})
    if known and touched and not set(known) & set(touched):
        found.append(Suspicion(
            f"the fixture's distances are those of {' and '.join(known)}, the rows touch "
            f"{' and '.join(sorted(touched))}: is it another fixture file, or a column of another name? They "
            "count for nothing"))
    return found


def touch_mistakes(robot: Robot, data: Dataset) -> list[Suspicion]:
    """The mistakes that explain the touches better, best first."""
    if not data.contacts.keys() & JUDGED_FROM.keys():
        return []
    data = touches(data)
    found = [(key, np.flatnonzero(rows)) for key, rows in touched_contacts(data)]
    found = [each for each in found if len(each[1]) >= JUDGED_FROM[each[0][0]]]
    found = [found[k] for k in spread(len(found), _MOST_CONTACTS)] if found else []
    most = max(_MOST_ROWS // max(len(found), 1), _LEAST_ROWS)
    found = [(key, rows[spread(len(rows), most)]) for key, rows in found]
    freedom = sum(3 * (len(rows) - 1) if key[0] in ("socket", PAIR) else len(rows) - JUDGED_FROM[key[0]] + 1
                  for key, rows in found)
    if freedom < _LEAST_FREEDOM + _TOOLS_M.shape[1]:
        return []
    some = data.select(np.concatenate([rows for _, rows in found]))
    ends = np.cumsum([0, *(len(rows) for _, rows in found)])
    contacts = [(key[0], np.arange(first, last), _lengths(some, key, first, last))
                for (key, _), first, last in zip(found, ends, ends[1:])]
    bare, carried = replace(robot, base=Placement(), tool=Placement()), carried_layout(robot, some)
    turns = _turns(bare, some)
    words, tried = zip(("", some), *(each for each in of_angles(bare, some)
                                     if _turns_enough(turns, _turns(bare, each[1]))))

    def left(tried: Sequence[Dataset]) -> tuple[np.ndarray, np.ndarray]:
        points, rotations = flanges([(bare, carried, each) for each in tried])
        return _best(points, rotations, contacts, robot.tool.position)

    missed, shares = left(tried)
    falls = _falls(shares[0], missed, shares, robot.reach)
    found = [Suspicion(words[k], float(falls[k])) for k in np.flatnonzero(falls >= FALL)]
    if missed[0] > SUSPICIOUS_SHARE * robot.reach:
        found += scales_and_zeros(bare, some, found, lambda each: _falls(shares[0], *left(each), robot.reach))
    return in_order(found)


def _falls(share: float, missed: np.ndarray, shares: np.ndarray, reach: float) -> np.ndarray:
    """(K,) how many times smaller than `share`; 0 where the robot file would be refused all the same."""
    return np.where(missed < WORST_SHARE * reach, share / np.maximum(shares, 1e-12), 0.0)


def _turns_enough(given: np.ndarray, meant: np.ndarray) -> bool:
    """Whether the axes that turn still do, and as many as it takes to touch anything."""
    turns = meant > _STILL_RAD
    return bool(turns[given > _STILL_RAD].all() and turns.sum() >= min(3, len(turns)))


def _turns(robot: Robot, data: Dataset) -> np.ndarray:
    """(n,) rad, m: the range of every joint."""
    return np.min([np.ptp(angles, axis=0) / (np.abs(robot.controller_ratios) if name == "theta" else 1.0)
                   for name, angles in data.joints.items() if name in ("theta", "q")], axis=0)


def _lengths(data: Dataset, key: tuple[str, int, int], first: int, last: int) -> np.ndarray | None:
    """(n,) m: distances from the contact's centre that are known."""
    name, session, number = key
    radius = data.fixture.radius_of(name, number, session)
    if name == "bar" and data.length is not None and number not in data.fixture.free_bars:
        read = data.length[first:last]
        return None if np.isnan(read).any() else read
    return None if name != "sphere" or radius is None else np.full(last - first, radius.length)


def _best(points: np.ndarray, rotations: np.ndarray, contacts: Contacts,
          own: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Of K sets of flanges (K, N, ...) what the best tool leaves: RMS in m and in shares of the travel, inf
    where it is not among the best ones. The first set is always searched to the end."""
    spreads = lambda values: np.mean(np.sum((values - values.mean(axis=1, keepdims=True)) ** 2, axis=2),
                                     axis=1)
    travel = np.sqrt(spreads(points) + _LEVER_M**2 * spreads(rotations.reshape(*rotations.shape[:2], 9)))
    travel = np.maximum(travel, 1e-12)
    starts = np.concatenate([_TOOLS_M, [own]])
    each = [_searched(points, rotations, contacts, np.tile(start, (len(points), 1)), _STEPS)
            for start in starts]
    rough = np.stack([rms for _, rms in each])
    start = np.argmin(rough, axis=0)
    tools = np.stack([tool for tool, _ in each])
    chosen = np.argsort(rough.min(axis=0) / travel)[:_TO_THE_END]
    left = np.full(len(points), np.inf)
    left[chosen] = _searched(points[chosen], rotations[chosen], contacts, tools[start[chosen], chosen],
                             _STEPS_TO_THE_END)[1]
    again = np.zeros(len(starts), int)
    left[0] = _searched(points[again], rotations[again], contacts, tools[:, 0], _STEPS_TO_THE_END)[1].min()
    return left, left / travel


def _searched(points: np.ndarray, rotations: np.ndarray, contacts: Contacts, tools: np.ndarray,
              steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Tools (K, 3) and what they leave (K,), RMS in m, after some Levenberg-Marquardt steps from `tools`."""
    def missed(tools: np.ndarray) -> np.ndarray:
        return _missed(points + np.einsum("knij,kj->kni", rotations, tools), rotations, contacts)

    count = points.shape[1]
    square = lambda numbers, tools: (numbers**2).sum(axis=1) + count * _PULL**2 * (tools**2).sum(axis=1)
    damping, numbers = np.full(len(points), 1e-3), missed(tools)
    cost = square(numbers, tools)
    for _ in range(steps):
        columns = np.stack([missed(tools + _DIFFERENCE_M * unit) - numbers for unit in np.eye(3)], axis=2)
        columns /= _DIFFERENCE_M
        normal = np.swapaxes(columns, 1, 2) @ columns + count * _PULL**2 * np.eye(3)
        gradient = np.einsum("kmi,km->ki", columns, numbers) + count * _PULL**2 * tools
        normal *= 1.0 + damping[:, None, None] * np.eye(3)
        other = tools - np.linalg.solve(normal, gradient[..., None])[..., 0]
        numbers_there = missed(other)
        there = square(numbers_there, other)
        better = there < cost
        tools, cost = np.where(better[:, None], other, tools), np.where(better, there, cost)
        numbers = np.where(better[:, None], numbers_there, numbers)
        damping = np.where(better, 0.1 * damping, 10.0 * damping)
    return tools, np.sqrt((numbers**2).sum(axis=1) / count)


def _missed(points: np.ndarray, rotations: np.ndarray, contacts: Contacts) -> np.ndarray:
    """(K, M) m: numbers that points (K, N, 3) lack to the contacts that fit them best, and the turns
    (K, N, 3, 3) of pairs to each other at a lever."""
    out = []
    for name, rows, lengths in contacts:
        arm = points[:, rows] - points[:, rows].mean(axis=1, keepdims=True)
        if name in ("socket", PAIR):
            out.append(arm.reshape(len(arm), -1))
            if name == PAIR:
                turned = rotations[:, rows] - rotations[:, rows].mean(axis=1, keepdims=True)
                out.append(_LEVER_M * turned.reshape(len(arm), -1))
        elif name == "plane":
            normal = np.linalg.eigh(np.swapaxes(arm, 1, 2) @ arm)[1][:, :, 0]
            out.append(np.einsum("kni,ki->kn", arm, normal))
        else:
            out.append(_of_sphere(arm, lengths))
    return np.concatenate(out, axis=1)


def _of_sphere(arm: np.ndarray, lengths: np.ndarray | None) -> np.ndarray:
    """(K, n) m: distances of points (K, n, 3) from the best centre, less the lengths or their own mean:
    2 c'p + k = |p|^2 - l^2."""
    size = np.maximum(np.sqrt(np.mean(arm**2, axis=(1, 2))), 1e-9)[:, None, None]
    columns = np.concatenate([arm / size, np.ones((*arm.shape[:2], 1))], axis=2)
    right = np.sum(arm**2, axis=2) - (0.0 if lengths is None else lengths**2)
    turned = np.swapaxes(columns, 1, 2)
    normal = turned @ columns + 1e-9 * arm.shape[1] * np.eye(4)
    centre = 0.5 * np.linalg.solve(normal, turned @ right[..., None])[:, None, :3, 0] / size
    distance = np.linalg.norm(arm - centre, axis=2)
    return distance - (distance.mean(axis=1, keepdims=True) if lengths is None else lengths)
