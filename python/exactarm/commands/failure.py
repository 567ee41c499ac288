"""What ends a run, as its exit code and one line: bad input, a computation that failed, the machine's limits,
or a fault of ours. For the command line, and for every job of a batch."""

import sys

from exactarm.errors import ComputationError, InputError

FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130


def explain(error: BaseException) -> tuple[int, str]:
    """Exit code and line for an exception that ends the run."""
    core = sys.modules.get("exactarm._core")
    if isinstance(error, InputError) or (core is not None and isinstance(error, core.InvalidArgument)):
        return BAD_INPUT, str(error)
    if isinstance(error, ComputationError):
        return FAILED, str(error)
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "interrupted; nothing was written"
    name = type(error).__name__
    if isinstance(error, MemoryError):
        return (
            FAILED, f"not enough memory ({error}); expected fewer rows at a time"
            if str(error) else "not enough memory"
        )
    if isinstance(error, OSError):  # the machine's limits: disk, files, pipe
        place = f"{error.filename}: " if error.filename else ""
        return FAILED, f"{place}{error.strerror or error}"
    return FAILED, f"unexpected {name}: {error} (a fault in exactarm; --debug prints the traceback)"
