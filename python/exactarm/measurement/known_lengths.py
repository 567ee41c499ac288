"""Known lengths of a fixture as data: residual L - f(nuisances), with its derivative, one row each.

    sockets, spheres, bars   f = |c1 - c2|
    planes                   f = |n2'(x1 - m2) - h2|     x1: the point of plane 1 next to its touches; plus or
                             minus
                                                         two tip radii where the ball's radius is known
    radius                   f = r
    square of a board        f = its size

Planes: the tip's centre keeps one radius outside of the face. Faces that look away from each other (a block
that is touched from both sides) are nearer to each other than the centres are by two radii; where the ball's
radius is not given it is taken as zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.chain.layout import Layout
from exactarm.data.fixture import Fixture
from exactarm.measurement.camera import SQUARE, Camera
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import Plane


@dataclass(frozen=True)
class KnownLength:
    """One row: known (m) as the fixture says, residual (m), row (P,) by the free parameters, sigma (m); a
    distance between contacts or a radius."""

    name: str
    session: int
    known: float
    residual: float
    row: np.ndarray
    sigma: float
    is_distance: bool


def known_lengths(layout: Layout, fixture: Fixture) -> tuple[KnownLength, ...]:
    """Every entry of the fixture that the contacts of the layout can tell, session by session."""
    places = {(e.contact, e.session, e.number): i for i, e in enumerate(layout.effects)
              if isinstance(e, Contact)}
    sessions = sorted({session for _, session, _ in places})
    found = []
    for entry in fixture.distances:
        for session in sessions if entry.session is None else (entry.session,):
            ends = [places.get((entry.contact, session, number)) for number in entry.between]
            if None not in ends:
                ball = fixture.radius_of("ball", None, session)
                length, blocks = _distance(*(layout.effects[i] for i in ends),
                                           0.0 if ball is None else ball.length)
                name = f"{entry.contact} {entry.between[0]} to {entry.between[1]} of session {session}"
                row = _row(layout, dict(zip(ends, blocks)))
                found.append(KnownLength(name, session, entry.length, entry.length - length, row,
                                         entry.sigma, True))
    for (contact, session, number), i in places.items():
        radius = fixture.radius_of(contact, number, session)
        if radius is not None:
            ball = fixture.radius_of("ball", None, session)
            length = radius.length + (ball.length if ball is not None else 0.0)
            row = _row(layout, {i: np.array([0.0, 0.0, 0.0, 1.0])})
            name = f"radius of {contact} {number} of session {session}"
            found.append(KnownLength(name, session, length, length - layout.effects[i].values[3], row,
                                     radius.sigma, False))
    for (_, session, _), i in places.items():
        if isinstance(camera := layout.effects[i], Camera):
            residual = camera.setup.square - camera.values[SQUARE]
            row = _row(layout, {i: np.eye(len(camera.values))[SQUARE]})
            found.append(KnownLength(f"square of the board of session {session}", session,
                                     camera.setup.square, residual, row, camera.setup.sigma, False))
    return tuple(found)


def distance_errors(layout: Layout, fixture: Fixture) -> dict[str, float]:
    """Name -> |estimated - known| of the distances, in m."""
    return {k.name: abs(k.residual) for k in known_lengths(layout, fixture) if k.is_distance}


def _row(layout: Layout, blocks: dict[int, np.ndarray]) -> np.ndarray:
    """(P,) from the derivatives by all parameters of some effects."""
    row = np.zeros(layout.size)
    for i, block in blocks.items():
        row[layout.slices[i]] = block[layout.free[i]]
    return row


def _distance(one: Contact, other: Contact, ball: float) -> tuple[float, list[np.ndarray]]:
    """Length and its derivative by the parameters of either contact."""
    if isinstance(one, Plane):
        return _plane_distance(one, other, ball)
    arm = np.asarray(one.values[:3]) - np.asarray(other.values[:3])
    length = float(np.linalg.norm(arm))
    towards = arm / max(length, 1e-12)
    rest = np.zeros(len(one.values) - 3)
    return length, [np.concatenate([towards, rest]), np.concatenate([-towards, rest])]


def _plane_distance(one: Plane, other: Plane, ball: float) -> tuple[float, list[np.ndarray]]:
    n1, by_tilt1 = one.normal
    n2, by_tilt2 = other.normal
    arm = one.point - np.asarray(other.reference[0])
    signed = float(n2 @ arm - other.values[2])
    sign = 1.0 if signed >= 0.0 else -1.0
    by_one = np.array([*(n2 @ by_tilt1 * one.values[2]), n2 @ n1])
    by_other = np.array([*(arm @ by_tilt2), -1.0])
    return abs(signed) - 2.0 * ball, [sign * by_one, sign * by_other]
