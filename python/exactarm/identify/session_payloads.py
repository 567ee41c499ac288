"""Payloads that nobody has weighed: one for each session, estimated with the springs that they bend.

At rest a payload moves nothing where no spring is known, and the springs' estimate needs loads. So first
everything else is estimated as if nothing were carried there; from these springs on, all of it together. In a
motion the drives feel it, with the links: where their masses are estimated too, a session has to be weighed.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.chain import Layout
from exactarm.data.columns import PAYLOAD, PAYLOAD_CENTRE
from exactarm.data.dataset import Dataset
from exactarm.errors import InputError
from exactarm.measurement.session_payload import SessionPayload, SessionPayloadInMotion

_KNOWN_CENTRE = PAYLOAD_CENTRE[0]


def payload_layout(data: Dataset, of: type[SessionPayload] = SessionPayload) -> Layout:
    """The payload of every unweighed session of `data`, at no mass; its centre is the data's, if any."""
    found = []
    for session in data.unweighed:
        rows = np.flatnonzero(data.session == session)
        if rows.size:
            centre = data.payload[1][rows[0]] if _KNOWN_CENTRE in data.covariates else None
            known = None if centre is None else tuple(float(x) for x in centre)
            found.append(of(None, (0.0,) * (4 if known is None else 1), session, known))
    return Layout.of(tuple(found))


def payload_layout_of_motion(train: Dataset, masses_estimated: bool) -> Layout:
    """The same for the identification rows of motions. Raises InputError where they cannot tell a payload."""
    if not train.unweighed:
        return Layout.of(())
    known = sorted(set(train.session.tolist()))
    unseen = [session for session in train.unweighed if session not in known]
    if unseen:
        raise InputError(f"session {unseen[0]}: its payload is not weighed and it has no identification "
                         "rows; expected some, or its payload_kg", file=train.first_file, column=PAYLOAD)
    if masses_estimated and not set(known) - set(train.unweighed):
        raise InputError("no session's payload is known and the masses of the links are estimated too: the "
                         "torques show their sum alone; expected the payload_kg of one session (0 for a bare "
                         "flange)", file=train.first_file, column=PAYLOAD)
    return payload_layout(train, SessionPayloadInMotion)


@dataclass(frozen=True)
class EstimatedPayload:
    """mass kg with its 95 % interval, centre (3,) m in the controller's flange frame; estimated: or given."""

    session: int
    mass: float
    interval: tuple[float, float]
    centre: np.ndarray
    estimated: bool


def session_payloads(data: Dataset, layout: Layout, bounds: np.ndarray) -> tuple[EstimatedPayload, ...]:
    """What the flange carries in each session; one whose mass the data cannot tell is left out.

    bounds (P, 2): the interval of each free parameter."""
    if not data.unweighed:
        return ()
    intervals = dict(zip(layout.names, bounds))
    fitted = {effect.session: effect for effect in layout.effects if isinstance(effect, SessionPayload)}
    found = []
    for session in np.unique(data.session).tolist():
        effect = fitted.get(session)
        if effect is not None:
            interval = intervals.get(effect.parameter_label(effect.parameters()[0]))
            if interval is not None:
                centre = _as_given(data, effect.centre_of_mass())
                found.append(
                    EstimatedPayload(session, effect.values[0], tuple(map(float, interval)), centre, True))
        elif session not in data.unweighed:
            row = int(np.argmax(data.session == session))
            mass, centre = data.payload[0][row], _as_given(data, data.payload[1][row])
            found.append(EstimatedPayload(session, float(mass), (float(mass),) * 2, centre, False))
    return tuple(found)


def _as_given(data: Dataset, centre: np.ndarray) -> np.ndarray:
    """(3,) m in the controller's flange frame, of a centre in DH frame n."""
    return (centre - data.flange.position) @ data.flange.rotation


def payload_columns(payloads: tuple[EstimatedPayload, ...]) -> dict[str, list[float]]:
    """Columns of a table for --sessions."""
    columns = {"session": [p.session for p in payloads], PAYLOAD: [p.mass for p in payloads]}
    return columns | {name: [float(p.centre[k]) for p in payloads] for k, name in enumerate(PAYLOAD_CENTRE)}
