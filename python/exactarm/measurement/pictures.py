"""Pictures: corners of one picture share the error of the arm that held the camera; so they are turned into
numbers that are independent.

    B = Q R,  r -> Q' r          B (2K, 6): numbers of the K corners by a motion of the camera in its own axes

An orthogonal change of axes in each picture: the first six numbers hold all that an error of the arm does to
it (across and down; about the view and along it; about the other two axes), the other 2K - 6 only what corner
detection and lens do. Each of these four classes has a standard deviation of its own; without it, forty
corners would count as forty poses. Q is taken at the present estimate; a fit holds it until its weights are
found anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import NO_CONTACT
from exactarm.data.rows import Rows
from exactarm.measurement.camera import Camera
from exactarm.view import View

SHARED = ("camera across", "camera about and along", "camera tilted")  # two numbers each


@dataclass(frozen=True)
class Pictures:
    """groups: rows (K,) of a picture with Q (2K, 2K); depth (N,) m, 1 for rows of no camera; focal (N,) px,
    NaN there."""

    groups: tuple[tuple[np.ndarray, np.ndarray], ...]
    depth: np.ndarray
    focal: np.ndarray

    @staticmethod
    def of(layout: Layout, view: View) -> Pictures:
        depth, focal = np.ones(view.rows), np.full(view.rows, np.nan)
        groups = []
        for effect in layout.effects:
            if isinstance(effect, Camera):
                at = np.flatnonzero(effect.rows(view.data))
                depth[at], focal[at] = effect.depth(view, at), effect.focal
                motion = effect.own_motion(view, at)
                place = np.full(view.rows, -1)
                place[at] = np.arange(len(at))
                for rows in rows_of_pictures(view.data, effect.session):
                    block = motion[place[rows]].reshape(-1, 6)
                    groups.append((rows, np.linalg.qr(block, mode="complete")[0]))
        return Pictures(tuple(groups), depth, focal)

    def turned(self, values: np.ndarray, back: bool = False) -> np.ndarray:
        """(N, m, ...) with the two numbers of each picture's corners in the new axes, or back in the old
        ones."""
        if not self.groups:
            return values
        values = values.copy()
        for rows, turn in self.groups:
            block = values[rows, :2].reshape(2 * len(rows), -1)
            new = (turn if back else turn.T) @ block
            values[rows, :2] = new.reshape(values[rows, :2].shape)
        return values


def rows_of_pictures(data: Rows, session: int | None = None) -> list[np.ndarray]:
    """Rows of each picture, in the order of the data."""
    if "camera" not in data.contacts:
        return []
    at = data.contacts["camera"] != NO_CONTACT
    at = np.flatnonzero(at if session is None else at & (data.session == session))
    if not at.size:
        return []
    keys = np.stack([data.session[at], data.picture[at]], axis=1)
    number = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(number, kind="stable")
    return np.split(at[order], np.flatnonzero(np.diff(number[order])) + 1)
