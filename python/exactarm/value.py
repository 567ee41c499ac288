"""Equality, hash and pickle of frozen dataclasses that hold arrays.

    @dataclass(frozen=True, eq=False)
    class Link(Value): ...

Two values are equal when they are of one class and all their fields are, arrays number by number (NaN equals
NaN). What was computed from the fields and kept (`cached_property`) takes no part, and is not pickled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


class Value:
    """Mixin: compares, hashes and pickles by the fields of the dataclass."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or _key(self) == _key(other)

    def __hash__(self) -> int:
        return hash(_key(self))

    def __getstate__(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]


def _key(value: Any) -> Any:
    """The value as nested tuples that can be compared and hashed."""
    if is_dataclass(value) and not isinstance(value, type):
        compared = (_key(getattr(value, item.name)) for item in fields(value) if item.compare)
        return (type(value).__qualname__, *compared)
    if isinstance(value, np.ndarray):
        return (value.shape, tuple(_key(item) for item in value.ravel().tolist()))
    if isinstance(value, Mapping):
        return tuple(sorted(((str(key), _key(item)) for key, item in value.items()),
                            key=lambda pair: pair[0]))
    if isinstance(value, (list, tuple)):
        return tuple(_key(item) for item in value)
    if isinstance(value, float) and value != value:
        return "nan"
    return value
