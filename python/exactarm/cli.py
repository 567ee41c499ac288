"""The command line: `exactarm COMMAND ROBOT [FILES] --out DIR`.

Exit codes: 0 done, 1 the computation failed, 2 bad input, 130 interrupted. An error is one line on stderr,
where nothing else is written in a pipe.
Commands are modules of `exactarm.commands`; only the one that is asked for is imported.
"""

from __future__ import annotations

import difflib
import os
import shutil
import signal
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TextIO

import exactarm
from exactarm.commands.failure import FAILED, explain
from exactarm.commands.listing import COMMANDS, find_commands, import_command
from exactarm.errors import InputError
from exactarm.progress import Progress

LEAST_WIDTH = 60  # columns: a narrower table could not be read
DONE = 0
BLAS_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(argv: Sequence[str] | None = None, package: str = COMMANDS) -> int:
    """Runs one command of `package`; returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    _open_streams()
    if argv is None and "--debug" not in words:
        _quiet_libraries()
    progress = Progress(None if "--quiet" in words else _progress_stream())
    try:
        with _interruptible():
            code = _run(words, progress, package)
            sys.stdout.flush()
            return code
    except SystemExit as stop:  # of argparse: help is printed, or the words are refused
        return int(stop.code or DONE)
    except (Exception, KeyboardInterrupt) as error:
        return _report_failure(error, progress, "--debug" in words)


def _open_streams() -> None:
    """Both streams as a command needs them: there, and never failing over a character."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever started us
            setattr(sys, name, open(os.devnull, "w"))
        if hasattr(getattr(sys, name), "reconfigure"):  # a notebook's stream takes every character
            getattr(sys, name).reconfigure(errors="backslashreplace")


def _quiet_libraries() -> None:
    """What libraries have to say to developers stays off the user's terminal, where an error is one line
    alone."""
    import logging
    import warnings

    warnings.simplefilter("ignore")
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns of a cache folder that it cannot write


def _report_failure(error: BaseException, progress: Progress, debug: bool) -> int:
    """One line on stderr, as far as there is one; returns the exit code."""
    code, line = explain(error)
    try:
        progress.close()
        if debug:
            traceback.print_exception(error)
        if not isinstance(error, BrokenPipeError):  # its reader has left, and knows
            print("exactarm: error: " + visible(" ".join(line.split())), file=sys.stderr, flush=True)
    except OSError:
        code = FAILED
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # the interpreter would try again at its end, and say so
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return code


def visible(text: str) -> str:
    """The text with control characters spelled out: a name in a file must not steer the terminal."""
    return "".join(char if char.isprintable() or char in "\n\t" else char.encode("unicode_escape").decode()
                   for char in text)


def _progress_stream() -> TextIO:
    """Where progress is said: on the terminal, else on stdout, so that stderr holds nothing but the one line
    of an error."""
    return sys.stderr if sys.stderr.isatty() else sys.stdout


def _run(words: list[str], progress: Progress, package: str) -> int:
    commands = find_commands(package)
    if words[:1] == ["help"] and len(words) > 1:
        words = [words[1], "--help"]
    if not words or words[0] in ("-h", "--help", "help"):
        print(overview(commands), end="")
        return DONE
    if words[0] == "--completion":
        from exactarm.commands.completion import completion

        print(completion(words[1:], package), end="")
        return DONE
    if words[0] in ("-V", "--version"):
        print(f"exactarm {exactarm.__version__}")
        return DONE
    name = words[0]
    if name not in commands:
        close = difflib.get_close_matches(name, commands, n=1)
        meant = f"did you mean {close[0]}? Expected one of: " if close else "expected one of: "
        raise InputError(f"unknown command {name!r}, {meant}{', '.join(commands)}")
    _one_blas_thread()
    from exactarm.commands.execute import execute, parse

    module = import_command(name, package)
    arguments = parse(module, words[1:])
    published = execute(module, arguments, progress, _width())
    if not arguments.quiet:
        print(visible(published.text), end="")
    if published.result.exit_code:  # a whole result, of parts that failed
        progress.close()
        print(visible(f"exactarm: error: {arguments.out}: {published.report.verdict}"), file=sys.stderr)
    return published.result.exit_code


def _width() -> int | None:
    """Columns of the terminal; None in a pipe, where a report has its own width."""
    return max(shutil.get_terminal_size().columns, LEAST_WIDTH) if sys.stdout.isatty() else None


def overview(commands: dict[str, tuple[str, str]]) -> str:
    """The text of `exactarm --help`, as wide as the terminal, in a pipe 80 columns."""
    import textwrap

    columns = max(shutil.get_terminal_size().columns, LEAST_WIDTH)
    width = max((len(name) for name in commands), default=0)
    wrapped = lambda text, first="", rest="": textwrap.wrap(
        text, columns, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)
    lines = [line for name, (_, text) in commands.items()
             for line in wrapped(text, f"  {name:<{width}}  ", " " * (width + 4))]
    return "\n".join([
        "usage: exactarm COMMAND ROBOT [FILES] --out DIR",
        "",
        *wrapped("Calibrates a robot arm, finds the causes of the error that is left, and corrects its "
                 "programs and motions for them."),
        "",
        "Begin with data that come with the package:",
        "  exactarm calibrate ur10 ur10/series_B --out calibrated",
        "  exactarm demo --out demo",
        "",
        *lines,
        "",
        "`exactarm COMMAND --help` lists the options of a command.",
        "Tab completion: eval \"$(exactarm --completion bash)\"",
        *wrapped("Exit code: 0 done, 1 the computation failed, 2 bad input, 130 interrupted."),
        "",
    ])


def _one_blas_thread() -> None:
    """Our matrices are small: more BLAS threads would only wait for each other. --threads bounds those of the
    core.

    BLAS reads its number of threads when numpy is imported, so this comes before any such import.
    """
    for variable in BLAS_VARIABLES:
        os.environ.setdefault(variable, "1")


@contextmanager
def _interruptible() -> Iterator[None]:
    """A polite kill ends a run as Ctrl-C does, whatever comes out of it: an ImportError, of an import that it
    breaks off."""
    asked: list[int] = []

    def interrupt(number: int, _: object) -> None:
        asked.append(number)
        raise KeyboardInterrupt

    ctrl_c = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    numbers = (signal.SIGTERM, signal.SIGINT) if ctrl_c else (signal.SIGTERM,)
    try:
        earlier = {number: signal.signal(number, interrupt) for number in numbers}
    except ValueError:  # not the main thread
        yield
        return
    try:
        yield
    except Exception as error:
        if asked:
            raise KeyboardInterrupt from error
        raise
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)
