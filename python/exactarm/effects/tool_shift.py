"""Tool shift: the target moved once on the flange (a reflector, tip or sensor that was knocked, or fastened
anew).

x -= R_n shift, R -= R_n turn   on the rows up to `after` (time or row) of one session: shift (3,) m and turn
                                (3,) rad of the target in DH frame n (rotation R_n), after the step less
                                before; the tool frame beside the effect is that of now.

Touches of all sessions share one tool, so that the effect acts on all sessions before, too; under a tracker
each session has a tool frame of its own.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.moving_frames import MovingFrames
from exactarm.effects.slow_driver import clock_of
from exactarm.effects.tracker_step import StepOfBody, shift_and_turn, size_in_words


@dataclass(frozen=True)
class ToolShift(StepOfBody):
    """Shift of the target in DH frame n, with `turn` its rotation too; in `session`, after `after`."""

    name = "tool_shift"
    plain = "a tool or reflector that was knocked"
    station = Station.GEOMETRY
    on_earlier_rows = True
    kinds = (POSES.name,)
    # A zero of the last axis that moved looks like a tool that moved along its circle: as probable as that of
    # one axis of six, so that such a move is named by what needs one number.
    log_odds = -float(np.log(6.0))
    source = "ISO 9283 (fixing of the target); ISO 10360-10 (stability of reflectors)"

    def sizes(self) -> tuple[Parameter, ...]:
        return shift_and_turn(3e-4, 1e-3, self.turn)

    def describe(self) -> str:
        size = size_in_words(self.values[1:], self.turn)
        return f"the target moves on the flange by {size} after {self.where}"

    def spans_sessions(self, data):
        return bool(data.contacts)

    def shape(self, view):
        return _both(-MovingFrames.of(view).rotations[:, -1])

    def change(self, view) -> Change:
        frames, earlier = MovingFrames.of(view), self.acts(view.data)[:, None, None]
        shape = earlier * _both(-frames.rotations[:, -1])
        value = shape @ np.asarray(self.values[1:])
        last = view.axes - 1
        by_q = np.concatenate([frames.direction_by_q(part, last) for part in (value[:, :3], value[:, 3:])],
                              axis=1)
        return Change(tuple(range(6)), value, np.concatenate([np.zeros((view.rows, 6, 1)), shape], axis=2),
                      {"q": by_q})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if "measured" not in view.signals or view.is_series:
            return
        for session, rows in view.sessions:
            step = cls(None, (0.0,) * 7, session, clock_of(view), turn=True)
            shift, turn = (np.any(part) for part in np.split(step.shown(view)[rows], 2, axis=2))
            tried = step.tried(view) if shift else ()
            for turns in (False, True)[: 1 + turn] if tried else ():
                yield replace(step, values=(tried[0],) + (0.0,) * 6, turn=turns, search=tried)


def _both(rotations: np.ndarray) -> np.ndarray:
    """(N, 6, 6) the same rotation of shift and turn."""
    out = np.zeros((len(rotations), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = rotations
    return out
