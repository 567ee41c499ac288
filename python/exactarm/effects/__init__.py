"""The library of effects: every module of this folder is looked through once; each subclass registers by its
name."""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import replace
from functools import cache

import numpy as np

from exactarm.effects.base import RECORD_KEY, Change, Effect, Parameter, Station

__all__ = ["Change", "Effect", "Parameter", "Station", "effect_from_table", "library"]


@cache
def library() -> dict[str, type[Effect]]:
    """Name -> class of every effect found in this folder, sorted by name."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return dict(sorted(_named_subclasses(Effect)))


def _named_subclasses(cls: type[Effect]):
    for sub in cls.__subclasses__():
        if vars(sub).get("name"):  # variants of one effect inherit its name and do not register again
            yield sub.name, sub
        yield from _named_subclasses(sub)


def effect_from_table(table: dict) -> Effect:
    """An effect from its entry in a robot file. Raises KeyError for an unknown name, TypeError for a wrong
    record, ValueError for a number that is not finite."""
    try:
        effect, record = library()[table["effect"]].from_table(table), table.get(RECORD_KEY, [])
    except OverflowError:  # of a whole number
        raise ValueError("a number is not finite") from None
    if not np.all(np.isfinite(effect.values)):
        raise ValueError("a number is not finite")
    if not isinstance(record, list) or not all(isinstance(entry, str) for entry in record):
        raise TypeError(RECORD_KEY)
    return replace(effect, record=tuple(record)) if record else effect
