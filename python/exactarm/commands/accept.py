"""`exactarm accept`: a drafted effect becomes part of the user's own library."""

from __future__ import annotations

import argparse
import hashlib
import os
from pathlib import Path

from exactarm.commands.outcome import Asked
from exactarm.commands.plain import sha256
from exactarm.commands.result import CommandResult
from exactarm.data.rows import Source
from exactarm.data.split import DEFAULT_SEED
from exactarm.effects import Effect, effect_from_table, library
from exactarm.effects.accepted import effects_folder
from exactarm.errors import InputError
from exactarm.files.toml_file import read_toml
from exactarm.report import Report, Text, Warnings
from exactarm.robot.keys import MOST_AXES
from exactarm.robot.writer import effects_text

NAME = "accept"
HELP = "make a drafted effect (draft.toml) part of your own library"
UNUSED_OPTIONS = ("seed", "threads")  # nothing in it is random
_EXPECTED = "a draft with entries [[effects]], as `exactarm diagnose` writes it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("draft", metavar="DRAFT",
                        help="draft.toml, as `exactarm diagnose` has written it, or changed by hand")


def accept(draft: str | Path) -> CommandResult:
    """Checks the draft's formulas and copies its effects into the user's library; simulate, diagnose, plan
    and robot files know them from then on."""
    entries = read_toml(draft, _EXPECTED).get("effects")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"no effects; expected {_EXPECTED}", file=str(draft))
    effects = [_effect(entry, number, str(draft)) for number, entry in enumerate(entries, start=1)]
    text = effects_text(effects)
    folder = effects_folder()
    path = folder / f"{Path(draft).stem}-{hashlib.sha256(text.encode()).hexdigest()[:8]}.toml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        whole = path.with_suffix(f".{os.getpid()}.new")  # a killed run leaves no half of a file that is read
        whole.write_text(text, encoding="utf-8")
        whole.replace(path)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror}); expected a folder for your effects, or "
                         "another one in EXACTARM_EFFECTS", file=str(folder)) from None
    titles = [effect.title for effect in effects]
    lines = tuple(f"{effect.title}: {effect.describe()}; for arms of {_axes(effect)} axes or more"
                  for effect in effects)
    empty = tuple(
        f"{effect.title}: all its values are zero: `simulate` and robot files do nothing with it, `diagnose` "
        "estimates it" for effect in effects if effect.values and not any(effect.values))
    return CommandResult(
        json={"effects": [effect.to_table() for effect in effects], "file": str(path),
              "warnings": list(empty)},
        report=Report("Accepted effects", f"Now in your library: {'; '.join(titles)}.",
                      (Text("Effects", lines), Warnings(empty)), "caution" if empty else "good"),
        asked=Asked("accept", f'exactarm.accept("{draft}")', None, (Source(str(draft), sha256(draft)),),
                    DEFAULT_SEED))


def _axes(effect: Effect) -> int:
    """How many an arm must have."""
    return max((effect.joint or 1, *effect.other_axes))


def _effect(entry: object, number: int, file: str) -> Effect:
    where = f"effects[{number}]"
    if (not isinstance(entry, dict) or not isinstance(entry.get("effect"), str)
            or entry["effect"] not in library()):
        raise InputError(f"{where}.effect is no known effect; expected {_EXPECTED}", file=file)
    try:
        effect = effect_from_table(entry).of_axes(MOST_AXES)
    except KeyError as error:
        raise InputError(f"{where}.{error.args[0]} is missing; expected {_EXPECTED}", file=file) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{where} does not fit: {error}", file=file) from None
    if effect.nothing_at_all:
        raise InputError(f"{where} is zero at all angles and loads, whatever its values; expected an effect "
                         "that moves its axis", file=file)
    if effect.joint is not None and not 1 <= effect.joint <= MOST_AXES:
        raise InputError(f"{where}.joint is {effect.joint:g}; expected 1 to {MOST_AXES}", file=file)
    return effect


def run(arguments: argparse.Namespace) -> CommandResult:
    return accept(arguments.draft)
