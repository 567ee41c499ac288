"""One command, watched from inside by an audit hook of the interpreter:

    python tests/robustness/watched.py FOLDER[:FOLDER...] COMMAND ARGUMENTS...

What leaves the folders (a file written, renamed, removed or made elsewhere), asks the network or starts a
program is refused where it happens, and named on stderr, one line each. Ends with the exit code of the
command, or with 3 if anything was refused. The one program that may start is the browser that prints
(`exactarm.report.printing`).
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

REFUSED = 3
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = ("os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate",
           "os.chmod", "shutil.rmtree", "shutil.copyfile", "shutil.move")
NETWORK = ("socket.connect", "socket.bind", "socket.getaddrinfo", "socket.sendto", "urllib.Request")
PROGRAMS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.startfile", "pty.spawn")
CODE = ("pickle.find_class",)  # what is read as code and not as data


def watch(folders: list[Path], refused: list[str], printer: str | None) -> None:
    inside = [str(folder.resolve()) for folder in folders] + ["/dev/"]

    def belongs(path: object) -> bool:
        if not isinstance(path, (str, bytes, os.PathLike)):  # a descriptor that is open already
            return True
        real = os.path.realpath(os.fsdecode(path))
        return any(real == each or real.startswith(each.rstrip("/") + "/") for each in inside)

    def hook(event: str, arguments: tuple) -> None:
        if event == "open":
            path, mode, flags = arguments
            writing = isinstance(flags, int) and flags & WRITING
            bad = writing and not belongs(path)
        elif event in ("os.remove", "os.rmdir") and arguments[1] >= 0:  # of shutil.rmtree, asked before
            bad = False
        elif event in CHANGES:
            paths = arguments[:2] if event in ("os.rename", "os.link", "shutil.move") else arguments[:1]
            bad = not all(map(belongs, paths))
        elif event in PROGRAMS:
            bad = printer is None or os.fsdecode(arguments[0]) != printer
        else:
            bad = event in NETWORK + CODE
        if bad:
            refused.append(f"{event}{arguments!r}"[:300])
            raise PermissionError(f"refused: {refused[-1]}")

    sys.addaudithook(hook)


def main() -> int:
    folders = [Path(folder) for folder in sys.argv[1].split(os.pathsep)]
    import matplotlib.font_manager  # noqa: F401 (it asks the system for fonts, once for each user)

    from exactarm import cli
    from exactarm.report.printing import BROWSERS

    refused: list[str] = []
    sys.dont_write_bytecode = True
    watch(folders, refused, next(filter(None, map(shutil.which, BROWSERS)), None))
    code = cli.main(sys.argv[2:])
    for each in refused:
        print(each, file=sys.stderr)
    return REFUSED if refused else code


if __name__ == "__main__":
    sys.exit(main())
