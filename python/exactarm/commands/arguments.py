"""The arguments that commands share."""

import argparse
import os
import re
from collections.abc import Callable, Collection, Mapping
from numbers import Integral
from pathlib import Path
from typing import Any

from exactarm.data.kinds import KIND_NAMES
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.files.examples import file_or_example

_NUMBERS = re.compile(r"-(?:[\d.]|inf|nan)", re.IGNORECASE)


class NumbersParser(argparse.ArgumentParser):
    """Takes words that begin with a negative number for values, as "-0.5,1": argparse takes a single number
    without exponent alone for one, and any other for an option."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._negative_number_matcher = _NUMBERS


LARGEST_SHOWN = 10**40  # Python spells no number of thousands of digits


def add_robot(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("robot", metavar="ROBOT",
                        help="robot file (.toml, .urdf) or the name of a shipped robot")


def add_files(parser: argparse.ArgumentParser, least: int = 1,
              text: str = "measured data (.csv, .parquet), or shipped ones, as ur10/series_B",
              measured: bool = True) -> None:
    """FILES: at least one, `measured` ones of a kind that --kind may name; or any number with `least` = 0.
    They are recorded as the inputs of the run."""
    optional = {} if least else {"default": []}
    parser.add_argument("files", metavar="FILE", nargs="+" if least else "*", type=file_or_example, help=text,
                        **optional)
    if least and measured:
        parser.add_argument("--kind", choices=KIND_NAMES, help="kind of data (default: told by the columns)")
        add_map(parser)


def add_map(parser: argparse.ArgumentParser, destination: str = "map") -> None:
    """--map, kept under `destination`: "map" has FILES read with it before the command runs."""
    parser.add_argument("--map", metavar="THEIRS=OURS", action="append", default=[], type=_mapping,
                        dest=destination, help="a column by another name, as J1=q_1_deg; may be given again")


def _mapping(text: str) -> tuple[str, str]:
    theirs, equals, ours = text.rpartition("=")
    if not equals or not theirs.strip() or not ours.strip():
        raise argparse.ArgumentTypeError(f"{text!r}, expected the file's name and ours, as J1=q_1_deg")
    return theirs.strip(), ours.strip()


_mapping.__name__ = "column map"


def add_fixture(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--fixture", metavar="FILE", type=Path,
                        help="known distances and radii of what was touched (.toml), for closures")


def add_sessions(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--sessions", metavar="FILE", type=Path,
                        help="what holds for whole sessions (.csv): session, payload_kg, payload_x_m, ...")


def add_common(parser: argparse.ArgumentParser, unused: Collection[str] = ()) -> None:
    """What every command has; added by the command line itself. unused: of seed and threads, what the command
    does not read: taken, so that a script can give the same words to all commands, and not shown."""
    shown = lambda name, text: argparse.SUPPRESS if name in unused else text
    group = parser.add_argument_group("common options")
    group.add_argument("--out", metavar="DIR", type=_folder, required=True,
                       help="folder for all results (made if missing)")
    group.add_argument("--seed", metavar="N", type=_whole_number, default=DEFAULT_SEED,
                       help=shown("seed", "makes every random choice repeatable (default %(default)s)"))
    group.add_argument("--threads", metavar="N", type=_positive, default=available_cores(),
                       help=shown("threads", "most threads to use (default: all cores, here %(default)s)"))
    group.add_argument("--quiet", action="store_true", help="print nothing but errors")
    group.add_argument("--debug", action="store_true", help="print the traceback of an error")


def require_acting(arguments: argparse.Namespace, add_arguments: Callable[[argparse.ArgumentParser], None],
                   idle: Mapping[str, str]) -> None:
    """Refuses options that were given and do nothing. idle: of those that do nothing in this run the name of
    each, and with what it acts, as "with --station X,Y,Z"."""
    parser = argparse.ArgumentParser(add_help=False)
    add_arguments(parser)
    for action in parser._actions:
        if action.dest in idle and getattr(arguments, action.dest) != action.default:
            raise InputError(f"{action.option_strings[-1]} acts {idle[action.dest]} only")


def require_bounded(values: Mapping[str, Any]) -> None:
    """Whole numbers of options fit into 64 bits: beyond, no count is meant, and none becomes a float."""
    for name, value in values.items():
        for each in value if isinstance(value, (list, tuple)) else [value]:
            if isinstance(each, int) and abs(each) >= 2**63:
                size = f"a number of {len(f'{each:x}')} hexadecimal digits"
                shown = f"{each}" if abs(each) < LARGEST_SHOWN else size
                raise InputError(f"argument --{name.replace('_', '-')}: {shown}; expected a whole number of "
                                 f"at most {2**63 - 1} (64 bits)")


def require_common(options: Mapping[str, Any]) -> None:
    """`seed` and `threads` of a call in Python, as the command line takes their words; threads None: all."""
    require_bounded(options)
    for name, check in (("seed", _whole_number), ("threads", _positive)):
        if name not in options or (name == "threads" and options[name] is None):
            continue
        try:
            if not isinstance(options[name], Integral):
                raise argparse.ArgumentTypeError(f"{options[name]!r}, expected a whole number")
            check(options[name])
        except argparse.ArgumentTypeError as error:
            raise InputError(f"argument {name}: {error}") from None


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _folder(text: str) -> Path:
    """An empty name would be the working folder, which nobody who wrote --out "$UNSET" meant."""
    if not text.strip():
        raise argparse.ArgumentTypeError("is empty, expected a folder")
    return Path(text)


def _whole_number(text: str | Integral) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative, expected 0 or more")
    return value


_whole_number.__name__ = "whole number"


def _positive(text: str | Integral) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text}, expected 1 or more")
    return value


_positive.__name__ = "whole number"
