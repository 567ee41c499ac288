"""The two ways a command can fail: bad input (exit 2) and a failed computation (exit 1).

Both carry one line that a person can act on. An `InputError` names the file, the row (1 = first
data row), the column and what was expected, as far as they are known.
"""


class InputError(ValueError):
    """What the user gave cannot be used."""

    def __init__(self, message: str, *, file: object = None, row: int | None = None, column: str | None = None):
        self.message, self.file, self.row, self.column = message, file, row, column
        place = [str(file)] if file is not None else []
        place += [f"row {row}"] if row is not None else []
        place += [f"column {column}"] if column is not None else []
        super().__init__(": ".join([", ".join(place), message]) if place else message)


class ComputationError(RuntimeError):
    """The input was fine, the computation did not succeed; the message says why."""
