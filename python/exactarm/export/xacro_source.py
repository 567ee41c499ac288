"""A xacro file as the URDF that it stands for, and which of its joint elements stand for which joints.

Expanded by the package `xacro` (properties, arguments with their defaults, includes, macros, conditions),
as a robot's launch does. A joint is patched where its element stands in this very file, once, and for
itself: its origin becomes numbers, whatever expression stood there. Everything is checked by expanding the
patched text again: the joints that were meant have the new origins, and no other joint has moved. What
fails is refused by the line of its element, include or macro.
"""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Mapping
from pathlib import Path
from xml.parsers.expat import ExpatError

import numpy as np

from exactarm.errors import InputError
from exactarm.robot.robot import Placement
from exactarm.robot.urdf_tree import UrdfTree

SAME = 1e-12  # m, and of a rotation's entries: numbers are written with all their digits
_JOINT = re.compile(r"<joint\b([^>]*)(?<!/)>(.*?)</joint\s*>", re.S)
_NAME = re.compile(r"\bname\s*=\s*([\"'])(.*?)\1")
_EXPRESSION = re.compile(r"\$\{[^}]*\}|\$\([^)]*\)")


def is_xacro(content: bytes) -> bool:
    return re.search(rb"xmlns:xacro\b|<xacro:", content) is not None


def without_comments(text: str) -> str:
    """The same with spaces in place of comments, lines kept."""
    return re.sub(r"<!--.*?-->", lambda match: re.sub(r"[^\n]", " ", match[0]), text, flags=re.S)


def expanded(path: str | Path, content: bytes) -> bytes:
    """The URDF that a xacro file of this content, in the place of `path`, stands for."""
    try:
        import xacro
    except ImportError:
        raise InputError("is a xacro, and the package xacro is not installed; expected it expanded, as by: "
                         "xacro FILE > robot.urdf", file=path) from None
    told = io.StringIO()
    try:
        with contextlib.redirect_stderr(told), contextlib.redirect_stdout(told):
            xacro.init_stacks(str(path))
            document = xacro.parse(content.decode(), str(path))
            xacro.process_doc(document, verbosity=0)
    except (ExpatError, UnicodeDecodeError) as error:
        raise InputError(f"is no valid XML: {error}", file=path) from None
    except Exception as error:  # what a file may ask xacro to do has no list of its failures
        line = _line_of_failure(content.decode(errors="replace"), str(error))
        raise InputError(f"xacro cannot expand it: {error}", file=path, line=line) from None
    return document.toxml().encode()


def _line_of_failure(text: str, message: str) -> int | None:
    """The first line that holds what a failure quotes: a file, a macro, a property."""
    words = re.findall(r"[\w./${}()-]{3,}", message)
    plain = without_comments(text).splitlines()
    for word in sorted(words, key=len, reverse=True):
        found = [i for i, line in enumerate(plain, start=1) if word in line]
        if found:
            return found[0]
    return next((i for i, line in enumerate(plain, start=1) if "<xacro:" in line), None)


def elements(text: str, name: str) -> list[re.Match]:
    """The joint elements (of a text without comments) that may stand for the joint `name`."""
    return [match for match in _JOINT.finditer(text)
            if re.search(r"\btype\s*=", match[1]) and _stands_for(match, name)]


def _stands_for(match: re.Match, name: str) -> bool:
    found = _NAME.search(match[1])
    if found is None:
        return False
    parts = [re.escape(part) for part in _EXPRESSION.split(found[2])]
    return re.fullmatch(".*".join(parts), name) is not None


def require_own_element(path: str | Path, text: str, name: str, found: list[re.Match]) -> re.Match:
    """The one element of a joint, with an origin that stands in it."""
    line = lambda place: text.count("\n", 0, place) + 1
    if not found:
        elsewhere = re.search(r"<xacro:(include|(?!macro|property|arg|if|unless)\w+)\b", text)
        where = _in_included(name) or (
            "another file" if elsewhere and elsewhere[1] == "include" else "what is expanded")
        raise InputError(
            f"joint {name} is not written in this file but in {where}, and an included file may stand for "
            f"other arms too; expected the expanded file: xacro {Path(path).name} > robot.urdf, then "
            "--source robot.urdf",
            file=path, line=line(elsewhere.start()) if elsewhere else None,
        )
    if len(found) > 1:
        lines = ", ".join(str(line(match.start())) for match in found)
        raise InputError(f"joint {name} may be that of the lines {lines}; expected one element for it",
                         file=path, line=line(found[0].start()))
    inner = re.search(r"<xacro:(\w+)", found[0][2])
    if inner:
        raise InputError(
            f"joint {name} holds <xacro:{inner[1]}>: where its origin comes from is not in its element; "
            "expected <origin> with xyz and rpy in it",
            file=path, line=line(found[0].start(2) + inner.start()),
        )
    return found[0]


def _in_included(name: str) -> str:
    """File and line of the element of a joint among the files that the last expansion has included."""
    import xacro

    for file in dict.fromkeys(reversed(xacro.all_includes)):
        try:
            text = without_comments(Path(file).read_text(errors="replace"))
        except OSError:
            continue
        for match in elements(text, name):
            return f"{Path(file).name} line {text.count(chr(10), 0, match.start()) + 1}"
    return ""


def stands_for_several(path: str | Path, text: str, element: re.Match, names: str) -> InputError:
    """The refusal of an element of which one origin would have to be right for more than one joint."""
    return InputError(
        f"this element stands for {names}, and one origin cannot be right for both; expected an element for "
        "each, or the expanded file (xacro FILE > robot.urdf)",
        file=path, line=text.count("\n", 0, element.start()) + 1,
    )


def require_patched(
    path: str | Path, text: str, before: UrdfTree, after: UrdfTree, origins: Mapping[str, Placement]
) -> None:
    """Refuses a patched file in which a joint has another origin than it should have."""
    then = {joint.name: joint for joints in before.children.values() for joint in joints}
    now = {joint.name: joint for joints in after.children.values() for joint in joints}
    for name, joint in now.items():
        wanted = origins.get(name, then[name].origin if name in then else joint.origin)
        away = max(np.abs(joint.origin.position - wanted.position).max(),
                   np.abs(joint.origin.rotation - wanted.rotation).max())
        if away > SAME:
            found = elements(text, name)
            if found:
                raise stands_for_several(path, text, found[0], f"{name} and another one")
            raise InputError(f"joint {name} would move, too; expected the expanded file", file=path)
    if then.keys() != now.keys():
        raise InputError("the patched file has other joints; expected the expanded one", file=path)
