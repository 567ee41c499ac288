"""What a refusal "robot and data do not match" asks the user.

A free tool point can follow points of any spread, so what is meant is found by trying the usual mistakes: the
one without which the robot fits is named.
"""

from __future__ import annotations

from collections.abc import Sequence

from exactarm.errors import InputError
from exactarm.first_aid.pose_mistakes import pose_mistakes
from exactarm.identify.match import Mismatch


def with_cause(error: Mismatch, found: Sequence[str] = ()) -> InputError:
    """The refusal with the mistake that its own rows show, else the first of `found`, what all rows show."""
    meant = pose_mistakes(error.robot, error.rows, error.carried, error.seed)
    if meant:
        cause = meant[0].text if meant[0].sentence else f"is it {meant[0].words}?"
    elif found:
        cause = found[0]
    else:
        return error
    return InputError(f"{error.refusal}: {cause}", file=error.file)
