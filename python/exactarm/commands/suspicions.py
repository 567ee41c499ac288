"""First aid around the work of a command: what looks like a mistake of the user's is said with the result, or
with the refusal."""

from collections.abc import Iterator
from contextlib import contextmanager

from exactarm.data.dataset import Dataset
from exactarm.errors import ComputationError, InputError
from exactarm.first_aid.first_aid import first_aid, with_cause
from exactarm.identify.match import Mismatch
from exactarm.robot.robot import Robot


@contextmanager
def suspicions(robot: Robot, data: Dataset, *placed: Dataset) -> Iterator[tuple[str, ...]]:
    """The warnings of `first_aid` and what reading decided, of `data` and of what is `placed` by its frames;
    the likeliest mistake also stands in the line of what the block refuses."""
    others = (text for each in placed for text in first_aid(robot, each, placed=True))
    found = tuple(dict.fromkeys((*first_aid(robot, data), *others)))
    notes = dict.fromkeys(note for each in (data, *placed) for note in each.notes)
    try:
        yield (*found, *notes)
    except (InputError, ComputationError) as error:
        if isinstance(error, Mismatch):
            raise with_cause(error, found) from error
        if not found:
            raise
        message = f"{getattr(error, 'message', error)}; {found[0]}"
        if isinstance(error, ComputationError):
            raise ComputationError(message) from error
        raise InputError(message, file=error.file, row=error.row, column=error.column) from error
