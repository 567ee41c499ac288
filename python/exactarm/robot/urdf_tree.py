"""The links and joints of a URDF file as a checked tree, and the serial chain in it.

Angles in rad, lengths in m, as URDF has them. Refused, with a line that names file and element: no XML, a
joint between unknown links, more than one root, a loop, numbers that are none, a chain that branches.
"""

import xml.etree.ElementTree as xml
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from exactarm.errors import InputError
from exactarm.files.file_bytes import file_bytes
from exactarm.robot.mdh_frames import rotation_x, rotation_y, rotation_z
from exactarm.robot.robot import Link, Placement

MOVING = ("revolute", "continuous", "prismatic")
MOST_NAMES = 20  # in one message
USUAL_TIPS = ("tool0", "tool", "flange", "tcp")  # names by which robot descriptions call their end


@dataclass(frozen=True)
class UrdfJoint:
    """One joint element."""

    name: str
    type: str
    parent: str
    child: str
    origin: Placement
    axis: np.ndarray
    # lower, upper, velocity, effort, damping, friction, ratio
    numbers: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class UrdfTree:
    """All joints by their parent link, mass properties of links (in the link's frame) by name."""

    path: str
    name: str
    root: str
    children: dict[str, tuple[UrdfJoint, ...]]
    inertials: dict[str, Link]

    def chain(self, base: str | None = None, tip: str | None = None) -> tuple[UrdfJoint, ...]:
        """The joints from `base` to `tip`; by default the root and the end of the only chain that moves."""
        for given in (base, tip):
            if given is not None and given not in self.children:
                raise InputError(f"no link {given!r}; expected one of {_listed(self.children)}",
                                 file=self.path)
        start = self.root if base is None else base
        way = self._way_to(start, tip) if tip is not None else self._only_way(start)
        for joint in way:
            if joint.type not in (*MOVING, "fixed"):
                message = (
                    f"joint {joint.name}: type {joint.type!r}; expected revolute, continuous, prismatic or "
                    "fixed")
                raise InputError(message, file=self.path)
        if not any(joint.type in MOVING for joint in way):
            raise InputError("no joint moves between base and tip; expected at least one", file=self.path)
        return way

    def _way_to(self, start: str, tip: str) -> tuple[UrdfJoint, ...]:
        parent = {joint.child: joint for joints in self.children.values() for joint in joints}
        way, link = [], tip
        while link != start:
            if link not in parent:
                raise InputError(f"no way from link {start} to link {tip}; expected a chain", file=self.path)
            way.append(parent[link])
            link = parent[link].parent
        return tuple(reversed(way))

    def _only_way(self, link: str) -> tuple[UrdfJoint, ...]:
        way, moving = [], self._moving()
        while True:
            ways = [joint for joint in self.children[link] if joint.name in moving]
            if len(ways) > 1:
                tips = [tip for joint in ways for tip in self.ends(joint.child)]
                tips = [link, *tips] if any(joint.type in MOVING for joint in way) else tips
                raise InputError(f"the chain branches at link {link}; expected a tip, as in "
                                 f"{Path(self.path).name}#TIP, of {_listed(tips)}", file=self.path)
            if not ways:
                return (*way, *self._way_to(link, self._fixed_end(link)))
            way.append(ways[0])
            link = ways[0].child

    def _moving(self) -> set[str]:
        """Names of the joints that move or on which one that moves hangs."""
        moving: set[str] = set()
        for joint in reversed(self._below(self.root)):
            if joint.type != "fixed" or any(below.name in moving for below in self.children[joint.child]):
                moving.add(joint.name)
        return moving

    def ends(self, link: str) -> list[str]:
        """The links below `link` that carry nothing."""
        return [joint.child for joint in self._below(link) if not self.children[joint.child]] or [link]

    def _below(self, link: str) -> list[UrdfJoint]:
        """All joints below `link`, depth first in the file's order; a chain may be too long for recursion."""
        found, todo = [], list(reversed(self.children[link]))
        while todo:
            joint = todo.pop()
            found.append(joint)
            todo += reversed(self.children[joint.child])
        return found

    def _fixed_end(self, link: str) -> str:
        """The end of what is fixed to the last link."""
        ends = self.ends(link)
        for usual in USUAL_TIPS:
            if usual in ends:
                return usual
        if len(ends) > 1:
            name = Path(self.path).name
            tips = _listed([link, *ends])
            message = f"link {link} carries several ends; expected a tip, as in {name}#TIP, of {tips}"
            raise InputError(message, file=self.path)
        return ends[0]


def read_tree(path: str | Path, content: bytes | None = None) -> UrdfTree:
    """The tree of a URDF file; content: what stands for the file's own."""
    try:
        robot = xml.fromstring(file_bytes(path) if content is None else content)
    except FileNotFoundError:
        raise InputError("no such file; expected a robot file (.urdf)", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); expected a robot file", file=path) from None
    except (LookupError, ValueError):  # an encoding that Python does not know
        raise InputError("is in an unknown encoding; expected a robot file (.urdf) in UTF-8",
                         file=path) from None
    except xml.ParseError as error:
        raise InputError(f"is no valid XML: {error}", file=path) from None
    if robot.tag != "robot":
        raise InputError(f"root element <{robot.tag}>; expected <robot>", file=path)
    read = _TreeReader(str(path))
    links = [read.attribute(link, "name", "link") for link in robot.findall("link")]
    inertials = {link.get("name"): read.inertial(link) for link in robot.findall("link")}
    ratios = read.ratios(robot)
    joints = [read.joint(element, ratios) for element in robot.findall("joint")]
    _check_tree(str(path), links, joints)
    carried: dict[str, list[UrdfJoint]] = {name: [] for name in links}
    for joint in joints:
        carried[joint.parent].append(joint)
    children = {name: tuple(below) for name, below in carried.items()}
    ends = {joint.child for joint in joints}
    root = next(name for name in links if name not in ends)
    masses = {name: link for name, link in inertials.items() if link is not None}
    return UrdfTree(str(path), robot.get("name") or Path(path).stem, root, children, masses)


def _listed(names: Iterable[str]) -> str:
    """Some names for a message."""
    names = list(names)
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def _check_tree(path: str, links: list[str], joints: list[UrdfJoint]) -> None:
    if not links:
        raise InputError("no <link>; expected at least two", file=path)
    for names, kind in ((links, "link"), ([joint.name for joint in joints], "joint")):
        if twice := [name for name, count in Counter(names).items() if count > 1]:
            raise InputError(f"{kind} {twice[0]}: name given twice; expected once", file=path)
    seen, known = set(), set(links)
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in known:
                raise InputError(f"joint {joint.name}: no link {end!r}; expected one of the file's links",
                                 file=path)
        if joint.child in seen:
            raise InputError(f"link {joint.child}: child of two joints; expected a tree", file=path)
        seen.add(joint.child)
    roots = [name for name in links if name not in seen]
    if len(roots) != 1:
        found = f"{len(roots)} links without a parent ({_listed(roots)})" if roots else "a loop of joints"
        raise InputError(f"{found}; expected a tree with one root", file=path)
    children: dict[str, list[str]] = {name: [] for name in links}
    for joint in joints:
        children[joint.parent].append(joint.child)
    reached, todo = set(), [roots[0]]
    while todo:
        link = todo.pop()
        reached.add(link)
        todo += children[link]
    if lost := [name for name in links if name not in reached]:
        raise InputError(f"link {lost[0]} hangs in a loop; expected a tree with one root", file=path)


class _TreeReader:
    """Elements of one file -> values; every refusal names the element."""

    def __init__(self, path: str):
        self.path = path

    def attribute(self, element: xml.Element, name: str, what: str) -> str:
        value = element.get(name)
        if not value:
            raise InputError(f"{what}: attribute {name!r} is missing", file=self.path)
        return value

    def numbers(self, element: xml.Element | None, name: str, what: str,
                default: tuple[float, ...]) -> np.ndarray:
        text = None if element is None else element.get(name)
        if text is None:
            return np.array(default)
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.zeros(0)
        if values.shape != (len(default),) or not np.isfinite(values).all():
            raise InputError(f"{what}: {name}={text!r}; expected {len(default)} finite number(s)",
                             file=self.path)
        return values

    def placement(self, element: xml.Element | None, what: str) -> Placement:
        roll, pitch, yaw = self.numbers(element, "rpy", what, (0.0, 0.0, 0.0))
        rotation = rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)
        return Placement(rotation, self.numbers(element, "xyz", what, (0.0, 0.0, 0.0)))

    def joint(self, element: xml.Element, ratios: dict[str, float]) -> UrdfJoint:
        name = self.attribute(element, "name", "joint")
        what = f"joint {name}"
        ends = [element.find(end) for end in ("parent", "child")]
        if None in ends:
            raise InputError(f"{what}: parent or child is missing", file=self.path)
        parent, child = (self.attribute(end, "link", what) for end in ends)
        axis = self.numbers(element.find("axis"), "xyz", what, (1.0, 0.0, 0.0))
        kind = self.attribute(element, "type", what)
        if kind in MOVING and not np.linalg.norm(axis) > 0.0:
            raise InputError(f"{what}: axis of length 0; expected a direction", file=self.path)
        numbers = {}
        for tag, keys in (("limit", ("lower", "upper", "velocity", "effort")),
                          ("dynamics", ("damping", "friction"))):
            part = element.find(tag)
            for key in keys:
                if part is not None and part.get(key) is not None:
                    numbers[key] = float(self.numbers(part, key, what, (0.0,))[0])
        if name in ratios:
            numbers["ratio"] = ratios[name]
        origin = self.placement(element.find("origin"), what)
        return UrdfJoint(name, kind, parent, child, origin, axis / (np.linalg.norm(axis) or 1.0), numbers)

    def ratios(self, robot: xml.Element) -> dict[str, float]:
        """Gear ratio of each joint that has one simple transmission."""
        out: dict[str, float] = {}
        for transmission in robot.findall("transmission"):
            joint, reduction = transmission.find("joint"), transmission.find("actuator/mechanicalReduction")
            if joint is None or reduction is None or not joint.get("name"):
                continue
            try:
                out[joint.get("name")] = float(reduction.text)
            except (TypeError, ValueError):
                out[joint.get("name")] = 0.0
            if not (np.isfinite(out[joint.get("name")]) and out[joint.get("name")]):
                message = (
                    f"transmission of joint {joint.get('name')}: {reduction.text!r}; expected a gear ratio")
                raise InputError(message, file=self.path)
        # A reduction of 1 is what description files say where nobody looked.
        return {name: ratio for name, ratio in out.items() if ratio != 1.0}

    def inertial(self, link: xml.Element) -> Link | None:
        element, what = link.find("inertial"), f"link {link.get('name')}"
        if element is None:
            return None
        origin = self.placement(element.find("origin"), what)
        mass = float(self.numbers(element.find("mass"), "value", what, (0.0,))[0])
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        values = [float(self.numbers(element.find("inertia"), name, what, (0.0,))[0]) for name in names]
        xx, xy, xz, yy, yz, zz = values
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Link(mass, origin.position, origin.rotation @ inertia @ origin.rotation.T)
