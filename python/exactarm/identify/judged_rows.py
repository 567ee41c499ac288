"""Rows of closures whose error says something: those of contacts touched more often than they have unknowns.

A contact that is fitted to its own rows takes their error up: a seat touched once is where the target was, a
face of three touches goes through all three. Such rows have an error of 0, whatever the arm does, and would
lower every mean. They neither count before nor after a calibration.
"""

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.measurement.closures import PAIR, contact_keys, pair_numbers, shows_a_place
from exactarm.measurement.contact import Contact

# touches: one more than leave nothing over (3 numbers of a seat are one touch; a face has 3 unknowns, a ball
# and the end of a bar 4 with radius or zero, a number each)
JUDGED_FROM = {"socket": 2, "plane": 4, "sphere": 5, "bar": 5, PAIR: 2}


def judged_rows(data: Dataset, known: Layout | None = None) -> np.ndarray:
    """(N,) bool: the rows of `data` whose error is a distance and can be one; known: contacts that other rows
    have fitted. None at all where no contact is touched often enough."""
    judged = shows_a_place(data)
    placed = {(e.contact, e.session, e.number) for e in (known.effects if known else ())
              if isinstance(e, Contact)}
    for key, rows in touched_contacts(data):
        if key not in placed and rows.sum() < JUDGED_FROM.get(key[0], 0):
            judged &= ~rows
    return judged


def unjudged_lines(data: Dataset) -> tuple[str, ...]:
    """One line on the contacts that judge nothing."""
    few = [(key, int(rows.sum())) for key, rows in touched_contacts(data)
           if rows.sum() < JUDGED_FROM.get(key[0], 0)]
    if not few:
        return ()
    (name, session, number), touched = few[0]
    others = f", nor do those of {len(few) - 1} more" if len(few) > 1 else ""
    times = "once" if touched == 1 else f"{touched} times"
    return (f"rows of {name} {number} of session {session}, touched {times}, say nothing of the error and do "
            f"not count{others}: expected at least {JUDGED_FROM[name]} touches of a {name}",)


def touched_contacts(data: Dataset):
    """(name, session, number) and rows (N,) of every contact, and of every pair."""
    for name, session, number in contact_keys(data):
        if name in JUDGED_FROM:
            yield (name, session, number), (data.contacts[name] == number) & (data.session == session)
    pairs = pair_numbers(data)
    for each in np.unique(pairs[pairs >= 0]):
        first = int(np.flatnonzero(pairs == each)[0])
        key = (PAIR, int(data.session[first]), int(data.contacts[PAIR][first]))
        yield key, pairs == each
