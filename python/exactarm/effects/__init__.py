"""The library of effects: every module of this folder is looked through once, and what installed packages
name under the entry point `exactarm.effects`; each subclass registers by its name."""

import importlib
import pkgutil
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points

import numpy as np

from exactarm.effects.base import RECORD_KEY, Change, DoesNotFit, Effect, Parameter, Station
from exactarm.errors import ComputationError

ENTRY_POINT = "exactarm.effects"
__all__ = ["Change", "DoesNotFit", "Effect", "Parameter", "Station", "effect_from_table", "library"]


@cache
def library() -> dict[str, type[Effect]]:
    """Name -> class of every effect found, sorted by name. Raises ComputationError for an installed package
    whose effects cannot be loaded, or bear a name that is taken."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    found = dict(_named_subclasses(Effect))
    for point in entry_points(group=ENTRY_POINT):
        _load(point)
        for name, effect in _named_subclasses(Effect):
            if found.setdefault(name, effect) is not effect:
                raise ComputationError(f"{_package(point)} calls an effect {name}, as another one is called "
                                       "already: rename it, or uninstall the package")
    return dict(sorted(found.items()))


def _load(point: EntryPoint) -> None:
    try:
        point.load()
    except Exception as error:  # whatever a foreign module does
        raise ComputationError(f"the effects of {_package(point)} cannot be loaded ({point.value}: {error}): "
                               "update or uninstall the package") from error


def _package(point: EntryPoint) -> str:
    return "an installed package" if point.dist is None else f"the installed package {point.dist.name}"


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
