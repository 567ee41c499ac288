"""A tutorial's page as one script, to be run in an empty folder:

    python docs/tutorial_script.py docs/tutorial.md > tutorial.py

Its blocks of Python as they stand, its command lines as `run(...)`, in their order. The site offers the
scripts beside the pages; the tests run them (tests/python/test_tutorial.py).
"""

import re
import sys
from pathlib import Path

TUTORIALS = ("tutorial", "tutorial-gears", "tutorial-no-tracker", "tutorial-torques")
HEAD = '''"""{title}: every line of the page docs/{page}.md."""

import shlex
import subprocess


def run(line):
    print("$", line)
    subprocess.run(shlex.split(line), check=True)


'''
_BLOCK = re.compile(r"```(python|console)\n(.*?)```", re.DOTALL)


def body_of(text: str) -> str:
    """The blocks of a page: Python, and command lines by `run`."""
    parts = []
    for kind, block in _BLOCK.findall(text):
        lines = [line.removeprefix("$ ") for line in block.splitlines()]
        parts.append(block if kind == "python" else "".join(f"run({line!r})\n" for line in lines))
    return "\n".join(parts)


def script_of(page: Path) -> str:
    text = page.read_text()
    return HEAD.format(title=text.splitlines()[0].removeprefix("# "), page=page.stem) + body_of(text)


if __name__ == "__main__":
    sys.stdout.write(script_of(Path(sys.argv[1])))
