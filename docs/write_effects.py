"""Writes docs/effects.md from the library itself:  python docs/write_effects.py

Everything on the page is what the effects say of themselves: docstring, stations, kinds of data, parameters.
"""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from enum import Enum
from itertools import product
from pathlib import Path

import numpy as np

from exactarm.data.kinds import ALL_KINDS
from exactarm.effects import Effect, Parameter, library

PAGE = Path(__file__).with_name("effects.md")
SHAPES = ((), (0.0,), (1.0, 0.0, 0.0))  # of the values, where the parameters depend on how many there are
HEAD = """# The library of effects

An effect is one physical cause of error on one axis or of the set-up ([design](design.md)). It is given on
the command line of `simulate` as words (`--effect "backlash joint=2 width_rad=4e-4"`), and stands in a robot
file as an entry `[[effects]]` with the same keys. *Plausible* is the magnitude that counts as ordinary: it
scales searches and priors and bounds nothing.

One that you miss is one file ([adding an effect](adding-an-effect.md)). `thesis` and bracketed numbers refer
to the source ([method](method.md)). `python docs/write_effects.py` writes this page from the library.
"""


def variants(cls: type[Effect]) -> list[Effect]:
    """The forms in which an effect comes: its subclasses without a name of their own, its switches, its
    numbers of values."""
    forms = [sub for sub in cls.__subclasses__() if not vars(sub).get("name")]
    own = {"parameters", "parameter_table"} & vars(cls).keys() and "change" in vars(cls)
    forms = [cls, *forms] if own or not forms else forms
    found = []
    for form in forms:
        switches = {field.name: (False, True) if isinstance(field.default, bool) else type(field.default)
                    for field in fields(form) if isinstance(field.default, (bool, Enum))}
        for values, setting in product(SHAPES, product(*switches.values())):
            effect = replace(form(1 if form.per_joint else None, values), **dict(zip(switches, setting)))
            try:
                effect.parameters()
            except ValueError:  # not a number of values that this effect has
                continue
            found.append(effect)
    return found


def parameters(cls: type[Effect]) -> dict[str, tuple[Parameter, bool]]:
    """Name -> parameter, and whether no form estimates it."""
    found: dict[str, tuple[Parameter, bool]] = {}
    for effect in variants(cls):
        for parameter in effect.parameters():
            fixed = parameter.fixed and found.get(parameter.name, (parameter, True))[1]
            found[parameter.name] = (parameter, fixed)
    return found


def kinds(cls: type[Effect]) -> str:
    return ", ".join(kind.replace("_", " ") for kind in ALL_KINDS if kind in cls.kinds)


def overview(classes: dict[str, type[Effect]]) -> list[str]:
    marks = ("poses", "gear_run", "motion", "tracked_motion")
    lines = ["| effect | station | " + " | ".join(mark.replace("_", " ") for mark in marks) + " | planner |",
             "| --- | --- |" + " --- |" * 5]
    for name, cls in classes.items():
        shown = " | ".join("x" if mark in cls.kinds else "" for mark in marks)
        how = "tables" if cls.bake is not Effect.bake else "path" if cls.smooth else "path, eased"
        planner = how if cls.compensable else ""
        lines.append(f"| [`{name}`](#{name}) | {cls.station.name} | {shown} | {planner} |")
    return lines


def entry(name: str, cls: type[Effect]) -> list[str]:
    document = sys.modules[cls.__module__].__doc__.strip()
    scope = "one axis" if cls.per_joint else "the whole arm or device"
    lines = [f"### {name}", "", "```", document, "```", "",
             f"Acts at {cls.station.name}, on {scope}; shown by: {kinds(cls)}."]
    if cls.source:
        lines[-1] += f" Source: {cls.source}."
    known = parameters(cls)
    if not known:
        return [*lines, "", f"Its parameters: {cls.open_parameters}.", ""]
    lines += ["", "| parameter | plausible | bounds | |", "| --- | --- | --- | --- |"]
    for parameter, fixed in known.values():
        bounded = np.isfinite(parameter.lower) or np.isfinite(parameter.upper)
        bounds = f"{parameter.lower:g} to {parameter.upper:g}" if bounded else ""
        lines.append(f"| `{parameter.name}` | {parameter.plausible:g} | {bounds} | "
                     f"{'set, not estimated' if fixed else ''} |")
    return [*lines, ""]


def page() -> str:
    effects = library()
    causes = {name: cls for name, cls in effects.items() if not cls.declared}
    tables = {name: cls for name, cls in effects.items() if cls.declared}
    lines = [HEAD, "## Causes that a diagnosis looks for", "",
             "`planner`: how a plan compensates it: in its tables of the robot, as a known function along "
             "the path, and eased at reversals where it jumps.", "", *overview(causes), ""]
    for name, cls in causes.items():
        lines += entry(name, cls)
    lines += ["## Parameters of the declared model", "",
              "Identified again in every fit where they apply; never a finding.", "", *overview(tables), ""]
    for name, cls in tables.items():
        lines += entry(name, cls)
    lines += ["## unknown", "",
              "A structure that no candidate explains. It is no entry of the library but a verdict, "
              "`unexplained`; the evidence names the signal that the "
              "residual follows best.", ""]
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
