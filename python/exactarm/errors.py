"""The two ways a command can fail: bad input (exit 2) and a failed computation (exit 1).

Both carry one line that a person can act on. An `InputError` names the file, the row (1 = first
data row; of a table in memory, the label of its own index) or line, the column and what was expected, as far
as they are known.
"""

import re

_BROKEN = re.compile(r"[\x00-\x1f\x7f\x85\u2028\u2029]+")  # ends of lines, and what a terminal would obey
LONGEST_MESSAGE = 900  # characters: a list of all effects' names fits, a cell of a megabyte does not
LONGEST_NAME = 200  # of a column


class InputError(ValueError):
    """What the user gave cannot be used."""

    def __init__(self, message: str, *, file: object = None, row: int | None = None,
                 column: str | None = None,
                 line: int | None = None):
        # what a file holds may stand in them, the name of a column among it
        message, column = _BROKEN.sub(" ", message), None if column is None else _BROKEN.sub(" ", column)
        message = message if len(message) <= LONGEST_MESSAGE else message[:LONGEST_MESSAGE - 3] + "..."
        self.message, self.file, self.row, self.line, self.column = message, file, row, line, column
        place = [str(file)] if file is not None else []
        place += [row_name(file, row)] if row is not None else []
        place += [line_name(file, line)] if line is not None else []
        place += [f"column {column[:LONGEST_NAME]}"] if column is not None else []
        super().__init__(": ".join([", ".join(place), message]) if place else message)

    def within(self, file: object) -> "InputError":
        """The same with the file that it is about, where it names none and is not about an option of the
        command line."""
        if self.file is not None or file is None or self.message.startswith(
            ("--", "argument ", "unrecognized arguments")
        ):
            return self
        return InputError(self.message, file=file, row=self.row, line=self.line, column=self.column)


def row_name(file: object, row: int) -> str:
    """Of row `row`, from 1: of a table in memory by its own index."""
    return file.row_name(row) if hasattr(file, "row_name") else f"row {row}"


def line_name(file: object, line: int) -> str:
    """Of line `line`, from 1; a table in memory has rows in place of the lines behind a header."""
    return row_name(file, line - 1) if hasattr(file, "row_name") else f"line {line}"


class ComputationError(RuntimeError):
    """The input was fine, the computation did not succeed; the message says why."""
