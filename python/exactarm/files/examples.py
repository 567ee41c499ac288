"""The data that come with the package, in a clone and in an installed wheel alike.

    ur10    poses under a laser tracker, two series      kr300  encoders on both sides of the gears, two runs
    ball_in_socket  five arms calibrated without a tracker
    tx40    motor angles and torques of one motion       racer  declared parameters, the thesis' poses and
            results

A file of theirs is named as a shipped robot is, without a path: "ur10/series_B", in Python and on the command
line.
"""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from exactarm.errors import InputError

EXAMPLES = Path(__file__).parent.parent / "data" / "examples"


def data_path(name: str = "") -> Path:
    """Path of a shipped folder ("ur10") or file ("ur10/series_B.csv"); of all of them without a name."""
    path = EXAMPLES / name
    if not path.exists():
        files = sorted(str(file.relative_to(EXAMPLES)) for file in EXAMPLES.rglob("*")
                       if file.suffix in (".csv", ".parquet"))
        close = meant_example(name)
        expected = f"did you mean {close}?" if close else f"expected one of {', '.join(files)}"
        raise InputError(f"no shipped data named {name!r}; {expected}")
    return path


def example(name: str = "") -> Path:
    """Path of shipped data: a folder ("ur10"), or a file with or without its ending ("ur10/series_B").

        >>> import exactarm as ea
        >>> ea.example("ur10/series_B").name
        'series_B.csv'
    """
    found = sorted(EXAMPLES.glob(f"{name}.*")) if name and not (EXAMPLES / name).exists() else []
    return found[0] if len(found) == 1 else data_path(name)


def file_or_example(path: str | Path) -> Path:
    """The file of that path; where there is none, the shipped one of that name, if there is one."""
    path = Path(path)
    try:
        if path.exists() or path.is_absolute() or ".." in path.parts:
            return path
        found = example(path.as_posix())
    except (InputError, ValueError, OSError):  # no such name, or one that no file can have
        return path
    return found if found.is_file() else path


def is_table(path: str | Path) -> bool:
    """Whether the name is that of measured data, of a file or a shipped one."""
    return file_or_example(path).suffix.lower() in (".csv", ".parquet")


def meant_example(path: str | Path) -> str:
    """The shipped file that a name without an ending may have meant; empty where none is like it."""
    names = [file.relative_to(EXAMPLES).with_suffix("").as_posix() for file in EXAMPLES.rglob("*")
             if file.suffix in (".csv", ".parquet")]
    close = get_close_matches(str(path), names, n=1)
    return close[0] if close and not Path(path).suffix else ""


def no_such_robot(text: str, names: Sequence[str]) -> str:
    """What to say of a name that is no shipped robot's; the maker's name may stand before it."""
    words = [text.lower(), *text.lower().replace("_", " ").split()]
    close = [meant for word in words for meant in get_close_matches(word, names, n=1)]
    hint = f"; did you mean {close[0]}?" if close else ""
    return f"no robot of that name; expected one of {', '.join(names)}, or a .toml or .urdf file{hint}"
