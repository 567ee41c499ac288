"""Closures: poses at rest whose target touches something known; calibration without a tracker.

    q or theta --chain--> x (target in the base frame) --contact--> numbers that a perfect model makes vanish

Entry of the chain: motor angles, as for poses; device: the contact of the row
(exactarm.measurement.contacts), the tracker where the row has x, y, z, or the other rows of its `pair` (same
pose of the target: x - mean x, log(R mean R')). The mean of a pair is projected out, so it is no parameter.
Row = one touch, or one corner in a picture (turned with the others of it, exactarm.measurement.pictures); a
row of the file with two contacts is two rows. Residual (N, 3), or (N, 6) where a row gives
an orientation too (rotation vector in the base frame): measured minus predicted. Source: Bennett and
Hollerbach, IEEE Trans. Robot. Autom. 7(5), 1991; Zhuang, Motaghedi, Roth, ICRA 1999 (planes).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from exactarm.chain import Layout, View, predict_poses
from exactarm.data.dataset import NO_CONTACT, Dataset
from exactarm.effects.base import Effect, Station
from exactarm.measurement.board_pictures import gross_corners
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import ARMS, CONTACT_CLASSES, SENSORS
from exactarm.measurement.pictures import SHARED, Pictures, rows_of_pictures
from exactarm.numerics.rotation import log, nearest
from exactarm.robot.robot import Robot

TRACKER = "tracker"
PAIR = "pair"
ANY_SESSION = 0  # of a contact that is the same one in all of them


def touches(data: Dataset) -> Dataset:
    """One row for each contact of each row, and one for x, y, z: a row has exactly one of them, `device_of`
    says which. Corners that were not found where they are, are left out."""
    parts = []
    data = without_gross_corners(data)
    for name, numbers in data.contacts.items():
        at = np.flatnonzero(numbers >= 0)
        alone = {other: np.where(other == name, values[at], NO_CONTACT)
                 for other, values in data.contacts.items()}
        bare = replace(data.select(at), contacts=alone)
        parts.append(
            (at, replace(bare, position=None if data.position is None else np.full((len(at), 3), np.nan)))
        )
    if data.position is not None:
        at = np.flatnonzero(~np.isnan(data.position).any(axis=1))
        none = {name: np.full(len(at), NO_CONTACT) for name in data.contacts}
        parts.append((at, replace(data.select(at), contacts=none)))
    order = np.argsort(np.concatenate([at for at, _ in parts]), kind="stable")
    return _stacked([part for _, part in parts]).select(order)


def without_gross_corners(data: Dataset) -> Dataset:
    """The rows but for corners far beside the others of their picture."""
    wrong = gross_rows(data)
    if not wrong.any():
        return data
    marks = np.where(wrong, NO_CONTACT, data.contacts["camera"])
    bare = replace(data, contacts=data.contacts | {"camera": marks})
    tracked = np.zeros(len(data), bool) if data.position is None else ~np.isnan(data.position).any(axis=1)
    return bare.select(tracked | np.any([numbers >= 0 for numbers in bare.contacts.values()], axis=0))


def gross_rows(data: Dataset) -> np.ndarray:
    """(N,) bool: corners far beside where the others of their picture put them."""
    wrong, setup = np.zeros(len(data), bool), data.fixture.camera
    if setup is not None:
        for rows in rows_of_pictures(data):
            wrong[rows] = gross_corners(setup.corner(data.corner[rows])[:, :2], data.pixel[rows])
    return wrong


def _stacked(parts: list[Dataset]) -> Dataset:
    """Data sets with the same columns, one below the other."""
    stack = lambda values: np.concatenate(values) if isinstance(values[0], np.ndarray) else values[0]
    changes = {}
    for name in vars(parts[0]):
        values = [getattr(part, name) for part in parts]
        if isinstance(values[0], dict):
            changes[name] = {key: stack([value[key] for value in values]) for key in values[0]}
        elif isinstance(values[0], np.ndarray):
            changes[name] = stack(values)
    return replace(parts[0], **changes)


def device_of(data: Dataset) -> np.ndarray:
    """(N,) name of what ends the chain in each row of `touches`: a contact, `pair` or `tracker`."""
    device = np.full(len(data), TRACKER, dtype=object)
    for name, numbers in data.contacts.items():
        device[numbers >= 0] = name
    return device


def noise_classes(data: Dataset) -> np.ndarray:
    """(N,) name of the sort of noise in each row of `touches`: its device; of a picture's first rows, which
    hold what its corners share, one name each."""
    names = device_of(data)
    for rows in rows_of_pictures(data):
        names[rows[: len(SHARED)]] = SHARED[: len(rows)]
    return names


def shows_a_place(data: Dataset) -> np.ndarray:
    """(N,) bool: the rows whose error is a distance; all of them where gravity alone was measured."""
    place = ~np.isin(device_of(data), list(SENSORS))
    return place if place.any() else np.ones(len(data), bool)


def contact_keys(data: Dataset) -> list[tuple[str, int, int]]:
    """(contact, session, number) of every contact touched, pairs excepted; another arm stands where it is in
    any session."""
    found = set()
    for name in CONTACT_CLASSES:
        if name in data.contacts:
            at = data.contacts[name] >= 0
            sessions = np.full(at.sum(), ANY_SESSION) if name in ARMS else data.session[at]
            found |= {(name, int(s), int(k)) for s, k in zip(sessions, data.contacts[name][at])}
    return sorted(found, key=lambda key: (key[1], key[0], key[2]))


def pair_numbers(data: Dataset) -> np.ndarray:
    """(N,) from 0, one number a pair and session; NO_CONTACT elsewhere."""
    out = np.full(len(data), NO_CONTACT)
    if PAIR in data.contacts:
        at = np.flatnonzero(data.contacts[PAIR] >= 0)
        keys = np.stack([data.session[at], data.contacts[PAIR][at]], axis=1)
        out[at] = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    return out


@dataclass(frozen=True)
class ClosurePrediction:
    """residual (N, m) measured minus predicted, 0 where a row has no such number; used (N, m) bool; jacobian
    (N, m, P) of the prediction or None; by_target (N, m, 6): the prediction by a displacement of the target
    (m, rad)."""

    residual: np.ndarray
    used: np.ndarray
    jacobian: np.ndarray | None
    by_target: np.ndarray
    view: View
    pairs: np.ndarray
    pictures: Pictures

    def error(self) -> np.ndarray:
        """(N,) m: the distance to the contact, of a pair from the mean, of a tracker's row from the
        prediction; of a corner at the board's distance; of gravity's direction what it makes at a
        lever of 1 m (mm/m, as levels are marked)."""
        return np.linalg.norm(self.seen[:, :3], axis=1)

    @cached_property
    def seen(self) -> np.ndarray:
        """(N, m) the residual row by row: of a corner in m at the distance of the board."""
        return self.pictures.turned(self.residual, back=True) * self.pictures.depth[:, None]

    def reprojection(self, rows: np.ndarray | None = None) -> float | None:
        """RMS of what the corners (of some rows) are missed by, px; None without pictures."""
        at = np.isfinite(self.pictures.focal) & (True if rows is None else rows)
        pixels = self.pictures.turned(self.residual, back=True)[at, :2] * self.pictures.focal[at, None]
        return float(np.sqrt(np.mean(np.sum(pixels**2, axis=1)))) if at.any() else None

    def through(self, displacement: np.ndarray) -> np.ndarray:
        """(N, m, k): what displacements of the targets (N, 6, k) do to the numbers."""
        return self.passage(displacement)

    @property
    def passage(self) -> Callable[[np.ndarray], np.ndarray]:
        """`through`, without holding on to the prediction."""
        return partial(_passed, self.by_target, self.pairs, self.pictures)

    def response(self, effect: Effect) -> np.ndarray:
        """(N, m, k): what the parameters of an effect that is not in the layout do to the numbers, to first
        order."""
        return self.through(self.view.response(effect))

    def projected(self, worth: np.ndarray) -> float:
        """How many of the used numbers, of which a row counts for worth (N,), the means of the pairs have
        taken."""
        first = np.unique(self.pairs, return_index=True)[1]
        first = first[self.pairs[first] >= 0]
        return float(worth[first] @ self.used[first].sum(axis=1))


def _passed(by_target: np.ndarray, pairs: np.ndarray, pictures: Pictures,
            displacement: np.ndarray) -> np.ndarray:
    return pictures.turned(cleared_of_pairs(by_target @ displacement, pairs))


def predict_closures(
    robot: Robot, layout: Layout, data: Dataset, *, tangents: bool = True, threads: int = 1,
    pictures: Pictures | None = None
) -> ClosurePrediction:
    """Prediction of every row of `data` (one device a row, see `touches`) with effects and contacts of
    `layout`; pictures: with their axes held, absent: in those of this layout."""
    chain = predict_poses(robot, layout, data, tangents=tangents, threads=threads)
    view, device, pairs = chain.view, device_of(data), pair_numbers(data)
    oriented = (device == PAIR) | ((device == TRACKER) & (data.rotation is not None))
    m = 6 if oriented.any() else 3
    rows = len(data)
    residual, used = np.zeros((rows, m)), np.zeros((rows, m), bool)
    residual[:, :3] = -chain.position
    if data.position is not None:
        at = device == TRACKER
        residual[at, :3] += data.position[at]
    by_target = np.tile(np.eye(6)[:m], (rows, 1, 1))
    for effect in layout.effects:
        if isinstance(effect, Contact):
            at = np.flatnonzero(effect.rows(data))
            used[at, : effect.numbers] = True
            by_target[at] = 0.0
            by_target[at, : effect.numbers] = effect.numbers_at(view, at)[1]
            residual[at, : effect.numbers] += effect.reading(data, at)
    used[(device == PAIR) | (device == TRACKER), :3] = True
    if m == 6:
        residual[:, 3:], used[:, 3:] = _turns(chain.rotation, data, pairs, device), oriented[:, None]
        by_target[~oriented, 3:] = 0.0
    pictures = pictures or Pictures.of(layout, view)
    residual = pictures.turned(cleared_of_pairs(np.where(used, residual, 0.0), pairs))
    jacobian = None
    if chain.jacobian is not None:
        _clear_device_frames(layout, chain.jacobian, np.isin(device, list(SENSORS)))
        jacobian = np.where(used[:, :, None], chain.jacobian[:, :m], 0.0)
        jacobian = pictures.turned(cleared_of_pairs(jacobian, pairs))
    return ClosurePrediction(residual, used, jacobian, by_target, view, pairs, pictures)


def _clear_device_frames(layout: Layout, jacobian: np.ndarray, sensors: np.ndarray) -> None:
    """A tracker's frame turns with the base in it, gravity does not: no derivative by it there."""
    if not sensors.any():
        return
    for place, effect in enumerate(layout.effects):
        if effect.frames_of is not None:
            base = np.array([parameter.name.startswith("base_") for parameter in effect.parameters()])
            columns = np.arange(layout.size)[layout.slices[place]][base[layout.free[place]]]
            jacobian[np.ix_(sensors, range(6), columns)] = 0.0


def cleared_of_pairs(values: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(N, ...) with the mean of each pair taken off its rows."""
    at = np.flatnonzero(pairs >= 0)
    if not at.size:
        return values
    count = np.bincount(pairs[at])
    sums = np.zeros((len(count), *values.shape[1:]))
    np.add.at(sums, pairs[at], values[at])
    values = values.copy()
    values[at] -= (sums / count.reshape(-1, *[1] * (values.ndim - 1)))[pairs[at]]
    return values


def _turns(rotation: np.ndarray, data: Dataset, pairs: np.ndarray, device: np.ndarray) -> np.ndarray:
    """(N, 3) rad: rotation vectors from the predicted to the measured orientation, or to the mean of the
    pair."""
    meant = rotation.copy()
    for pair in np.unique(pairs[pairs >= 0]):
        meant[pairs == pair] = nearest(rotation[pairs == pair].mean(axis=0))
    if data.rotation is not None:
        meant[device == TRACKER] = data.rotation[device == TRACKER]
    return log(meant @ np.swapaxes(rotation, -1, -2))


def turn_of_axis(prediction: ClosurePrediction, index: int) -> np.ndarray:
    """(N, m): what a unit turn of axis `index` (from 0) does to the numbers."""
    unit = np.ones((len(prediction.residual), 1, 1))
    return prediction.through(prediction.view.transfers[Station.GEAR]((index,), unit))[:, :, 0]
