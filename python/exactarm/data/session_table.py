"""A table of sessions: what is the same for every row of a set-up, such as its payload or the temperature.

    session,payload_kg,payload_z_mm
    1,0,0
    2,5.2,80

Every column but `session` becomes a column of the data. An empty payload_kg is a payload that nobody has
weighed: zero in the data, and its session is kept in `Rows.unweighed`. Refused: a session without a line or
with two, a column that the data have already or that is measured row by row.
"""

from dataclasses import replace

import numpy as np

from exactarm.data.column_checks import check_size
from exactarm.data.columns import PAYLOAD, parse_column
from exactarm.data.dataset import Dataset
from exactarm.errors import InputError
from exactarm.files.memory_table import AnyFile
from exactarm.files.table import read_table


def with_sessions(data: Dataset, path: AnyFile) -> Dataset:
    """The data with the columns of the table at `path` as covariates. Raises InputError."""
    table = read_table(path, may_be_empty=lambda names: {PAYLOAD} & set(names))
    if "session" not in table.columns:
        raise InputError("column missing; expected the number of the set-up", file=path, column="session")
    numbers = table.columns["session"]
    line_of = {}
    for line, number in enumerate(numbers, start=1):
        if number in line_of:
            message = f"session {number:g} a second time; expected one line for each"
            raise InputError(message, file=path, row=line, column="session")
        line_of[number] = line - 1
    missing = sorted(set(data.session.tolist()) - set(line_of))
    if missing:
        message = f"session {missing[0]} of the data has no line; expected one"
        raise InputError(message, file=path, column="session")
    lines = np.array([line_of[number] for number in data.session.tolist()])
    added: dict[str, np.ndarray] = {}
    unweighed: list[int] = []
    for name, values in table.columns.items():
        if name == "session":
            continue
        column = parse_column(name, str(path))
        if column.quantity != "covariate" or column.name in data.covariates or column.name in added:
            problem = "measured row by row" if column.quantity != "covariate" else "given already"
            raise InputError(f"is {problem}; expected what holds for a whole session", file=path, column=name)
        check_size(str(path), column, values * column.factor)
        if column.name == PAYLOAD and (values < 0.0).any():
            row = int(np.argmax(values < 0.0))
            message = f"{values[row]:g}; expected a mass of 0 or more"
            raise InputError(message, file=path, row=row + 1, column=name)
        if column.name == PAYLOAD:
            empty = set(numbers[np.isnan(values)].astype(int).tolist())
            unweighed = sorted(empty & set(data.session.tolist()))
        added[column.name] = (np.nan_to_num(values) * column.factor)[lines]
    return replace(data, covariates=data.covariates | added, unweighed=tuple(unweighed))
