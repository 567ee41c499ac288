"""ROS 2 `trajectory_msgs/JointTrajectory` as YAML: `joint_names`, and `points` with `positions` (rad) and
`time_from_start`.

The points follow each other in time: at a reversal one gear table passes into the other as chain/direction.py
says. Which name is which axis: [controller] joint_names of the robot file (a URDF has them), names that end
in the number of the axis, or those of Universal Robots. Names beside them keep their positions. Positions are
corrected; velocities, accelerations and efforts stay (they change by about a thousandth). Joint states that
come back must be turned back too (`actual_of`), or planners find the start of the next motion off.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

import numpy as np
import yaml

from exactarm.compensate.program import Edit, Motion, Notation, Number, Numbers, Program, SourceText, Target
from exactarm.compensate.setting import Setting
from exactarm.errors import InputError
from exactarm.files.whole_number import whole_number
from exactarm.robot.robot import Robot

NAME, SUFFIXES = "JointTrajectory", (".yaml", ".yml")
DECIMALS = 12
RATES = ("velocities", "accelerations")
LONGEST_S = 1e9


class Nodes(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # the compiled one is ten times as fast
    """Without what nodes would mean: they are asked for their text alone, and it was a third of the time."""

    def resolve(self, kind: type, value: str | None, implicit: object) -> str:
        return ""

    def descend_resolver(self, parent: object, index: object) -> None:
        pass

    def ascend_resolver(self) -> None:
        pass


UR_NAMES = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    (source,) = sources
    document, place = _document(source)
    trajectory = _trajectory(source, document)
    names, points = trajectory.get("joint_names"), trajectory.get("points")
    if (
        not isinstance(names, yaml.SequenceNode)
        or not isinstance(points, yaml.SequenceNode)
        or not points.value
    ):
        raise source.refuse(0, "expected joint_names and points of a JointTrajectory")
    odd = next((node for node in names.value if not isinstance(node, yaml.ScalarNode)), None)
    if odd is not None:
        raise InputError("joint_names: expected a name for each axis, no list or mapping", file=source.path,
                         line=odd.start_mark.line + 1)
    columns, order = axis_order(setting.robot, [node.value for node in names.value], source)
    count = len(names.value)
    targets, motions = [], []
    for i, point in enumerate(points.value):
        fields = _fields(point, source)
        line = point.start_mark.line + 1
        positions = fields.get("positions")
        if not isinstance(positions, yaml.SequenceNode) or len(positions.value) != count:
            raise InputError(f"point {i + 1}: expected {count} positions", file=source.path, line=line)
        numbers = _numbers(source, positions, place).checked(source)
        if count > len(order):
            numbers = Numbers(*([part[k] for k in columns] for part in numbers))
        targets.append(Target(f"point {i + 1}", 0, line, *numbers, (DECIMALS,) * len(order)))
        rates = _rates(fields, columns, order, count)
        insert = None
        if i and count == len(order):
            insert = partial(_insertion, source, point, fields, place, order, len(rates))
        motions.append(
            Motion("joint", i, line, time=_time(source, fields, line), insert=insert, rates=rates))
    times = [motion.time for motion in motions]
    if None in times and any(time is not None for time in times):
        raise InputError(
            "time_from_start is given for some points alone",
            file=source.path,
            line=targets[times.index(None)].line,
        )
    if None not in times and np.any(np.diff(times) <= 0.0):
        late = int(np.argmax(np.diff(times) <= 0.0)) + 1
        raise InputError(
            f"point {late + 1}: time_from_start does not rise", file=source.path, line=targets[late].line
        )
    other = {key for point in points.value for key in _fields(point)} & {
        "velocities",
        "accelerations",
        "effort",
    }
    warnings = (
        (f"{', '.join(sorted(other))} stay as they are: they change by about a thousandth",) if other else ()
    )
    notation = Notation(joints=lambda numbers: numbers[:, np.argsort(order)], reported=lambda q: q[:, order])
    return Program(NAME, sources, tuple(targets), tuple(motions), notation, warnings, calculated=True)


def _numbers(source: SourceText, positions: yaml.SequenceNode, place: Callable[[int], int]) -> Numbers:
    start, end = place(positions.start_mark.index), place(positions.end_mark.index)
    if source.text[start] == "[" and (found := Numbers.plain(source.text, start + 1, end - 1)):
        return found
    numbers = []
    for node in positions.value:
        start = place(node.start_mark.index)
        numbers.append(Number.read(source, source.text[start : place(node.end_mark.index)], start))
    return Numbers.of(numbers)


def _rates(fields: dict, columns: list[int], order: list[int], count: int) -> tuple[np.ndarray, ...]:
    """Velocity and acceleration of each axis at a point, as far as it has them; none where they are no
    numbers."""
    rates = []
    for key in RATES:
        node = fields.get(key)
        if not isinstance(node, yaml.SequenceNode) or len(node.value) != count:
            break
        try:
            values = np.array([float(node.value[k].value) for k in columns])
        except (TypeError, ValueError):
            break
        if not np.all(np.isfinite(values)):
            break
        rates.append(np.empty(len(order)))
        rates[-1][order] = values
    return tuple(rates)


def _insertion(
    source: SourceText, point, fields: dict, place, order: list[int], rates: int, points: list
) -> Edit | None:
    """Points before one of a list in lines with dashes, whose keys are those that are written here."""
    text, at = source.text, place(point.start_mark.index)
    start = source.line_start(at)
    dash = re.fullmatch(r"([ \t]*)-([ \t]+)", text[start:at])
    newline = re.search(r"\r\n|\n|\r", text)
    keys = {"positions", "time_from_start", *RATES[:rates]}
    empty = {key for key, node in fields.items() if isinstance(node, yaml.SequenceNode) and not node.value}
    seconds = [key for key in _fields(fields.get("time_from_start")) if key in ("sec", "secs")]
    if dash is None or newline is None or set(fields) - empty != keys or len(seconds) != 1:
        return None
    nanoseconds = "nanosec" if seconds[0] == "sec" else "nsecs"
    lines = []
    for time, q, derivatives in points:
        written = zip(("positions", *RATES), (q, *derivatives))
        rows = [f"{key}: [" + ", ".join(f"{values[axis]:.{DECIMALS}f}" for axis in order) + "]"
                for key, values in written]
        whole, rest = divmod(round(1e9 * time), 10**9)
        rows.append(f"time_from_start: {{{seconds[0]}: {whole}, {nanoseconds}: {rest}}}")
        indent = dash[1] + " " + " " * len(dash[2])
        lines += [text[start:at] + rows[0], *(indent + row for row in rows[1:])]
    return Edit(0, start, start, "".join(line + newline[0] for line in lines).encode("latin-1"))


def axis_order(robot: Robot, names: list[str], source: SourceText) -> tuple[list[int], list[int]]:
    """The places of the names that are axes, and the axis (from 0) of each; refused where that is not
    certain. Names beside them (a gripper, a rail) keep their positions."""
    prefix = _common_prefix(names)
    for known, own in ((robot.controller.joint_names, names),
                       (UR_NAMES, [name.removeprefix(prefix) for name in names]),
                       ([str(axis + 1) for axis in range(robot.axes)], list(map(_number_behind, names)))):
        columns = [k for k, name in enumerate(own) if name in known]
        order = [known.index(own[k]) for k in columns]
        if sorted(order) == list(range(robot.axes)):
            return columns, order
    raise InputError(
        f"joint_names {', '.join(names)}: which axis each is, is not certain; expected {robot.axes} names as "
        "in the robot "
        "file: [controller] joint_names = [...] in the order of the axes",
        file=source.path,
    )


def _number_behind(name: str) -> str:
    end = re.search(r"(\d+)$", name)
    return str(whole_number(end[1])) if end else ""


def _common_prefix(names: list[str]) -> str:
    """Of a second arm: `left_` in `left_elbow_joint`."""
    elbow = [name for name in names if name.endswith("elbow_joint")]
    return elbow[0].removesuffix("elbow_joint") if len(elbow) == 1 else ""


def _check_events(source: SourceText, text: str) -> None:
    """Numbers that stand for others cannot be changed on their own."""
    for event in yaml.parse(text, Loader=Nodes) if "*" in text else ():  # the mark of all aliases
        if isinstance(event, yaml.AliasEvent):
            raise InputError("an alias; expected numbers", file=source.path, line=event.start_mark.line + 1)


def _document(source: SourceText):
    """The only document's node, and the place in the bytes of a place in its letters."""
    try:
        text = source.content.decode("utf-8")
        _check_events(source, text)
        nodes = list(yaml.compose_all(text, Loader=Nodes))
    except UnicodeDecodeError as error:
        raise source.refuse(error.start, "is not UTF-8") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        raise InputError(
            f"is no YAML: {getattr(error, 'problem', None) or error}",
            file=source.path,
            line=None if mark is None else mark.line + 1,
        ) from None
    nodes = [node for node in nodes if not isinstance(node, yaml.ScalarNode) or node.value]  # --- at its end
    if len(nodes) != 1 or not isinstance(nodes[0], yaml.MappingNode):
        raise source.refuse(0, "expected one document with joint_names and points")
    if len(text) == len(source.content):
        return nodes[0], lambda index: index
    bom = text.startswith("\ufeff")
    sizes = np.concatenate([[0], np.cumsum([len(letter.encode()) for letter in text])])
    return nodes[0], lambda index: int(sizes[index + bom])


def _fields(node, source: SourceText | None = None) -> dict:
    """Key -> node; with `source`, a key that is given twice, or is no word, is refused."""
    if not isinstance(node, yaml.MappingNode):
        return {}
    fields: dict = {}
    for key, value in node.value:
        name = key.value if isinstance(key, yaml.ScalarNode) else ""
        if source is not None and (name in fields or not isinstance(key, yaml.ScalarNode)):
            raise InputError(f"{name} is given twice" if name else "a key that is a list; expected a word",
                             file=source.path, line=key.start_mark.line + 1)
        fields[name] = value
    return fields


def _trajectory(source: SourceText, node) -> dict:
    """The mapping with the points: the document itself, or one below it (a goal, a message)."""
    todo, found = [node], []
    while todo:
        fields = _fields(todo.pop(), source)
        if "points" in fields and "joint_names" in fields:
            found.append(fields)
        todo += [value for value in fields.values() if isinstance(value, yaml.MappingNode)]
    found = [fields for fields in found if getattr(fields["points"], "value", None)] or found  # not the empty
    if len(found) != 1:
        raise source.refuse(0, f"{len(found)} trajectories; expected one, with joint_names and points")
    return found[0]


def _time(source: SourceText, fields: dict, line: int) -> float | None:
    given = fields.get("time_from_start")
    if given is None:
        return None
    parts = {"sec": given} if isinstance(given, yaml.ScalarNode) else _fields(given, source)
    try:
        values = {key: float(node.value) for key, node in parts.items()}
    except (TypeError, ValueError):
        raise InputError("time_from_start: expected sec and nanosec, or seconds", file=source.path,
                         line=line) from None
    time = values.get("sec", values.get("secs", 0.0)) + 1e-9 * values.get("nanosec", values.get("nsecs", 0.0))
    if not abs(time) < LONGEST_S:
        raise InputError(f"time_from_start of {time:g} s; expected less than {LONGEST_S:g}", file=source.path,
                         line=line)
    return time
