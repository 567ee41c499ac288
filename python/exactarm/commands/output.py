"""The folder of results: every file whole or absent, `result.json` last.

Files are written into DIR/.partial, then renamed into place. A `result.json` of an earlier run is removed
before the work begins, so that a run that was killed leaves none. A folder has one owner at a time: a second
run is refused by a lock on the folder itself, which ends with the process that holds it, however that ends.
`result.json` names the run (`run`) and the files that belong to it with their SHA-256 (`files`). `.written`
lists every file that a run has put here: a result takes the place of those alone, never of a user's own file.
A file of the user among the plots is no reason to refuse: a picture of its name gets a number.
"""

from __future__ import annotations

import argparse
import errno
import fcntl
import itertools
import json
import os
import shutil
import uuid
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from exactarm.commands.plain import plain, sha256
from exactarm.errors import InputError
from exactarm.files.arrow_columns import column_of
from exactarm.files.file_bytes import real_path

RESULT = "result.json"
PARTIAL = ".partial"
WRITTEN = ".written"  # names, one a line; grows before a file is put in place, so a killed run knows its own
PLOTS = "plots"
ALWAYS = (RESULT, "report.html")
PICTURES = (f"{PLOTS}/*.svg", f"{PLOTS}/*.png")
ROBOT_FILES = ("robot.toml", "robot.urdf")
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # disk, quota, largest file: said without a name


def may_write(module: Any, arguments: argparse.Namespace) -> list[str]:
    """Names (patterns of fnmatch) that a command may write: its `WRITES`, or what that makes of arguments."""
    own = getattr(module, "WRITES", ())
    return [*ALWAYS, *(own(arguments) if callable(own) else own)]


class OutputFolder:
    """DIR of one run; a context manager that leaves nothing half written, and no empty folder."""

    def __init__(self, path: Path, writes: Iterable[str] = ALWAYS, inputs: Iterable[Any] = ()):
        """writes: patterns of the names that may be written; inputs: files that the run reads."""
        self.path, self._partial = Path(path), Path(path) / PARTIAL
        self._writes, self._inputs = tuple(writes), tuple(inputs)
        self.run, self._owned = uuid.uuid4().hex, -1
        self._made: list[Path] = []  # folders that were not there before, the deepest first

    def __enter__(self) -> OutputFolder:
        mine = False  # until the folder is, .partial may be that of another run
        try:
            self._made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock()
            mine = True
            shutil.rmtree(self._partial, ignore_errors=True)
            self._partial.mkdir()
            self._own_files_of(self.path / RESULT)
            if (self.path / WRITTEN).exists():
                self._note(())
            self._require_free(self._writes, self._inputs)
            (self.path / RESULT).unlink(missing_ok=True)
        except OSError as error:
            self.__exit__() if mine else self._unlock()
            raise InputError(f"cannot write here ({error.strerror}), expected a folder",
                             file=self.path) from error
        except BaseException:  # a signal here would find no `with` to end
            if mine:
                self.__exit__()
            raise
        return self

    def __exit__(self, _: object = None, error: object = None, *__: object) -> None:
        shutil.rmtree(self._partial, ignore_errors=True)
        with suppress(OSError):  # what holds something stays
            for folder in self._made:
                folder.rmdir()
        self._unlock()
        if isinstance(error, OSError) and error.errno in _FULL and error.filename is None:
            error.filename = str(self.path)  # so that the line says which disk

    def _lock(self) -> None:
        self._owned = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(self._owned, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._unlock()
            raise InputError("another run is writing here; expected a folder of its own",
                             file=self.path) from None
        except OSError:  # a file system without locks: two runs at once then show in the hashes of `files`
            pass

    def _unlock(self) -> None:
        if self._owned >= 0:
            os.close(self._owned)
            self._owned = -1

    def place(self, name: str) -> Path:
        """Where to write the file `name` before it is published."""
        path = self._partial / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def write_text(self, name: str, text: str) -> None:
        self.place(name).write_text(text, encoding="utf-8", errors="backslashreplace")

    def write_table(self, name: str, columns: Mapping[str, Sequence]) -> None:
        """Columns (N,) as .csv (round-trip digits, missing values empty) or .parquet."""
        if name.endswith(".parquet"):
            import pandas

            pandas.DataFrame(dict(columns)).to_parquet(self.place(name), index=False)
            return
        table = pa.table({column: _cells(values) for column, values in columns.items()})
        try:
            content = _csv(table, "none")
        except pa.ArrowInvalid:  # a text that has to be quoted; then Arrow quotes all texts
            content = _csv(table, "needed")
        with self.place(name).open("wb") as file:
            file.write((",".join(columns) + "\n").encode())
            file.write(content)

    def write_result(self, result: Mapping[str, Any]) -> None:
        """`result` with the run's id and the files that belong to it; it is published last."""
        self._leave_pictures_of_others()
        own = {"run": self.run, "files": {str(name): sha256(self._partial / name) for name in self._names()}}
        self.write_text(RESULT, json.dumps(plain(dict(result) | own), indent=1, allow_nan=False,
                                           ensure_ascii=False) + "\n")

    def publish(self, inputs: Iterable[Any] = ()) -> list[Path]:
        """Renames all files into place, `result.json` last, over none that the run has read or that no run
        has written. Returns their paths."""
        own = self._written()
        self._require_free([escape(str(name)) for name in self._names()], inputs)
        self._note(str(name) for name in self._names() if str(name) not in own)
        names = sorted(self._names(), key=lambda name: name == Path(RESULT))
        for name in names:
            target = self.path / name
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(self._partial / name, target)
        return [self.path / name for name in names]

    def _require_free(self, patterns: Sequence[str], inputs: Iterable[Any]) -> None:
        """Refuses what results of such names could not, or must not, replace."""
        read, own = {real_path(path) for path in inputs}, self._written()
        there = [*self.path.iterdir()]
        if any(pattern.startswith(f"{PLOTS}/") for pattern in patterns) and os.path.lexists(
            plots := self.path / PLOTS
        ):
            if plots.is_symlink() or not plots.is_dir() or not os.access(plots, os.W_OK):
                raise InputError("stands where a folder of plots is to be written; expected another --out",
                                 file=plots)
            there += (target for target in plots.iterdir() if real_path(target) in read)
        for target in there:
            name = target.relative_to(self.path).as_posix()
            if not any(fnmatchcase(name, pattern) for pattern in patterns):
                continue
            if target.is_dir():
                raise InputError("is a folder where a result is to be written; expected another --out",
                                 file=target)
            if real_path(target) in read or name not in own:
                raise InputError("would be overwritten by the result of the same name; expected another "
                                 "--out", file=target)

    def _leave_pictures_of_others(self) -> None:
        """Pictures whose name a file has that no run has written get a number; the page has them inside."""
        own = self._written()
        taken = lambda name: os.path.lexists(self.path / name) and (
            str(name) not in own or (self.path / name).is_dir())
        for name in self._names():
            if name.parts[0] == PLOTS and taken(name):
                numbered = (name.with_stem(f"{name.stem}_{k}") for k in itertools.count(2))
                free = next(other for other in numbered
                            if not taken(other) and not (self._partial / other).exists())
                (self._partial / name).rename(self._partial / free)

    def _note(self, names: Iterable[str]) -> None:
        with (self.path / WRITTEN).open("a", encoding="utf-8") as file:
            file.writelines(f"{name}\n" for name in names)

    def _own_files_of(self, result: Path) -> None:
        """Notes what a result names as its own: a folder of an earlier version, or a copy, has no list."""
        try:
            known = json.loads(result.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return
        if not isinstance(known, dict) or "exactarm" not in known:
            return
        own, files = self._written(), known.get("files")
        names = [RESULT, *(files if isinstance(files, dict) else ())]
        self._note(name for name in names if name not in own and "\n" not in name)

    def _written(self) -> set[str]:
        """Names of files that runs have put here."""
        try:
            return set((self.path / WRITTEN).read_text(encoding="utf-8").splitlines())
        except OSError:
            return set()

    def _names(self) -> list[Path]:
        return [path.relative_to(self._partial) for path in sorted(self._partial.rglob("*"))
                if path.is_file()]


def _cells(values: Sequence) -> pa.Array:
    """A column; NaN and None become empty cells."""
    array = np.asarray(values)
    return column_of(np.where(array, "True", "False") if array.dtype == bool else array)


def _csv(table: pa.Table, quoting: str) -> pa.Buffer:
    stream = pa.BufferOutputStream()
    pa.csv.write_csv(table, stream, pa.csv.WriteOptions(include_header=False, quoting_style=quoting))
    return stream.getvalue()
