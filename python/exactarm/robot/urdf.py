"""URDF -> Robot and back.

    read_urdf("robot.urdf" or "robot.urdf#tip" or "robot.urdf#base:tip") -> Robot        write_urdf(path,
    robot)

In: the serial chain from base to tip, fixed joints merged, everything that hangs on a link with its mass;
frames by `mdh_chain`. `robot.base` keeps the place of DH frame 0 in the base link, `robot.tool` what lies
behind frame n, so that the pose of the tip in the base link is exactly that of the URDF. Of a file written
here, unless base or tip are given, the arm is what lies between `base_link` and `flange`; device and target
are where they were, and the base stands upright.
Out: root `device` (the measuring device), `base_link` and `flange` (the controller's), `link_i`, `tool` (the
target). The joint angle of the written file is the one that the controller reports, so calibrated
offsets stand in the joints' origins. What URDF cannot carry is listed in a comment.
"""

from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from exactarm.errors import InputError
from exactarm.files.table import atomic_file
from exactarm.robot.controller_frames import base_in_device, joined, target_on_flange
from exactarm.robot.generic_masses import with_declared_masses
from exactarm.robot.keys import ANGLE_LIMIT, MOST_AXES, RATE_LIMIT
from exactarm.robot.mdh_frames import Axis, behind_axis, compose, mdh_chain, relative, rotation_z
from exactarm.robot.robot import GRAVITY_M_S2, Controller, Joint, Link, Placement, Robot, frame_of
from exactarm.robot.urdf_tree import MOVING, UrdfJoint, UrdfTree, read_tree

NOT_DECLARED = 1e9  # URDF demands a velocity and an effort limit beside an angle limit


# -- in ----------------------------------------------------------------------------------------------
def read_urdf(path: str | Path, base: str | None = None, tip: str | None = None) -> Robot:
    """The robot between the links `base` and `tip`, which may also follow the path after a #."""
    file, _, ends = str(path).partition("#")
    if ends:
        base, tip = ends.split(":", 1) if ":" in ends else (base, ends)
    tree = read_tree(file)
    setup = _setup(tree) if base is None and tip is None else None
    if setup is not None:
        base, tip = "base_link", "flange"
    way = tree.chain(base or None, tip or None)
    places = _places(tree, way[0].parent)
    axes, moving = [], [joint for joint in way if joint.type in MOVING]
    if len(moving) > MOST_AXES:
        raise InputError(f"{len(moving)} joints move between base and tip; expected at most {MOST_AXES}",
                         file=file)
    for joint in moving:
        place = places[joint.child]
        kind = "prismatic" if joint.type == "prismatic" else "revolute"
        axes.append(Axis(place.position, place.rotation @ joint.axis, kind))
    chain = mdh_chain(axes, places[way[-1].child])
    joints = tuple(_joint(geometry, source) for geometry, source in zip(chain.joints, moving))
    root = Placement() if setup else _places(tree, tree.root)[way[0].parent]
    gravity = chain.base.rotation.T @ root.rotation.T @ np.array([0.0, 0.0, -GRAVITY_M_S2])
    gravity = np.where(np.abs(gravity) < 1e-12, 0.0, gravity)
    links = _links(tree, way, moving, places, chain.frames)
    names = tuple(joint.name for joint in moving)
    controller = Controller(tuple(map(frame_of, joints)), chain.base, chain.tool, joint_names=names)
    device, target = setup or (Placement(), Placement())
    return Robot(tree.name, joints, links, gravity, joined(device, chain.base), joined(chain.tool, target),
                 controller=controller)


def _setup(tree: UrdfTree) -> tuple[Placement, Placement] | None:
    """The base in the device and the target on the flange, of a file that `write_urdf` has written."""
    named = {joint.name: joint for joints in tree.children.values() for joint in joints}
    ours = {"device_to_base": ("device", "base_link"), "flange_to_tool": ("flange", "tool")}
    if tree.root != "device" or any(name not in named or named[name].type != "fixed"
                                    or (named[name].parent, named[name].child) != ends
                                    for name, ends in ours.items()):
        return None
    device, target = (named[name].origin for name in ours)
    return device, target


def _places(tree: UrdfTree, start: str) -> dict[str, Placement]:
    """Every link from `start` on, in its frame, with all joints at zero."""
    places, todo = {start: Placement()}, [start]
    while todo:
        link = todo.pop()
        for joint in tree.children[link]:
            places[joint.child] = compose(places[link], joint.origin)
            todo.append(joint.child)
    return places


def _joint(geometry: Joint, source: UrdfJoint) -> Joint:
    numbers = source.numbers
    declared = lambda key: numbers[key] if 0.0 < numbers.get(key, 0.0) < NOT_DECLARED else None
    limits = (None, None) if source.type == "continuous" else (numbers.get("lower"), numbers.get("upper"))
    if limits[0] is not None and limits[1] is not None and limits[0] >= limits[1]:
        limits = (None, None)
    turning = source.type != "prismatic"
    if turning and any(bound is not None and not ANGLE_LIMIT[0](bound) for bound in limits):
        limits = (None, None)  # as -1e16 to 1e16: without an end
    velocity = declared("velocity")
    if turning and velocity is not None and not RATE_LIMIT[0](velocity):
        velocity = None
    fields = {name: getattr(geometry, name) for name in ("type", "sign", "zero", "d", "a", "alpha", "beta")}
    return Joint(**fields, ratio=numbers.get("ratio"), coulomb=numbers.get("friction"),
                 viscous=numbers.get("damping"), q_min=limits[0], q_max=limits[1],
                 q_dot_max=velocity, torque_max=declared("effort"))


def _links(tree: UrdfTree, way: tuple[UrdfJoint, ...], moving: list[UrdfJoint], places: dict[str, Placement],
           frames: tuple[Placement, ...]) -> tuple[Link, ...] | None:
    """Mass properties of each moving link with all that is fixed to it, in its DH frame."""
    on_the_way = {joint.child for joint in moving}
    bodies: list[list[str]] = []
    for joint in moving:
        body, todo = [], [joint.child]
        while todo:
            link = todo.pop()
            body.append(link)
            todo += [child.child for child in tree.children[link] if child.child not in on_the_way]
        bodies.append(body)
    if not any(link in tree.inertials for body in bodies for link in body):
        return None
    return tuple(merged_link((tree.inertials[link], relative(frame, places[link]))
                             for link in body if link in tree.inertials)
                 for body, frame in zip(bodies, frames))


def merged_link(parts: Iterable[tuple[Link, Placement]]) -> Link:
    """Several rigid bodies as one: mass properties of each in its own frame, and that frame's placement."""
    moved = [Link(part.mass, place.rotation @ part.centre_of_mass + place.position,
                  place.rotation @ part.inertia @ place.rotation.T)
             for part, place in parts]
    mass = sum(part.mass for part in moved)
    weighted = sum((part.mass * part.centre_of_mass for part in moved), np.zeros(3))
    centre = weighted / mass if mass > 0.0 else np.zeros(3)
    inertia = np.zeros((3, 3))
    for part in moved:
        arm = part.centre_of_mass - centre
        inertia += part.inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Link(mass, centre, 0.5 * (inertia + inertia.T))


# -- out ---------------------------------------------------------------------------------------------
def write_urdf(path: str | Path, robot: Robot) -> None:
    """Write `robot` as URDF; whole or not at all."""
    with atomic_file(path) as temporary:
        temporary.write_text(urdf_text(robot), encoding="utf-8")


def urdf_text(robot: Robot) -> str:
    """The content of the URDF file."""
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name} declares no geometry; expected one for a URDF", file=robot.file)
    robot = with_declared_masses(robot)
    lines = ['<?xml version="1.0"?>', f"<!-- {_comment(robot)} -->",
             f"<robot name={quoteattr(_xml_text(robot.name))}>"]
    lines += ['  <link name="device"/>', '  <link name="base_link"/>']
    lines += _fixed("device_to_base", "device", "base_link", base_in_device(robot.base, robot.controller))
    before, parent = robot.controller.base, "base_link"
    for number, joint in enumerate(robot.joints, start=1):
        behind = behind_axis(joint)
        lines += _link(number, robot.links[number - 1] if robot.links else None, behind)
        lines += _moving(number, joint, robot, before, parent)
        before, parent = behind, f"link_{number}"
    lines += ['  <link name="flange"/>', *_fixed("link_to_flange", parent, "flange",
                                                          joined(before, robot.controller.flange))]
    lines += ['  <link name="tool"/>',
              *_fixed("flange_to_tool", "flange", "tool", target_on_flange(robot.tool, robot.controller))]
    for number, joint in enumerate(robot.joints, start=1):
        lines += _transmission(number, joint)
    return "\n".join([*lines, "</robot>"]) + "\n"


def _xml_text(text: str) -> str:
    """Without the characters that XML cannot hold, however they are written."""
    return "".join(char if char in "\t\n\r" or " " <= char < "\ufffe" or char > "\uffff" else "?"
                   for char in text)


def reported_shift(robot: Robot, index: int) -> float:
    """q of the real axis (rad or m) where the controller reports 0: rigid, by the constant ratios alone."""
    scale = robot.controller_ratios[index] / robot.ratios[index]
    return float(robot.offsets[index] - scale * robot.controller_offsets[index])


def _moving(number: int, joint: Joint, robot: Robot, before: Placement, parent: str) -> list[str]:
    index = number - 1
    shift, limited = reported_shift(robot, index), joint.q_min is not None and joint.q_max is not None
    prismatic = joint.type == "prismatic"
    along = np.array([0.0, 0.0, joint.sign * shift if prismatic else 0.0])
    start = Placement(rotation_z(joint.zero + (0.0 if prismatic else joint.sign * shift)), along)
    kind = "prismatic" if prismatic else "revolute" if limited else "continuous"
    lines = [f'  <joint name="joint_{number}" type="{kind}">',
             f'    <parent link="{parent}"/>', f'    <child link="link_{number}"/>',
             f"    {_origin(compose(before, start))}", f'    <axis xyz="0 0 {int(joint.sign)}"/>']
    numbers = {"velocity": joint.q_dot_max or NOT_DECLARED, "effort": joint.torque_max or NOT_DECLARED}
    if limited:
        numbers = {"lower": joint.q_min - shift, "upper": joint.q_max - shift} | numbers
    elif prismatic:
        numbers = {"lower": -NOT_DECLARED, "upper": NOT_DECLARED} | numbers
    lines.append(f"    <limit {_attributes(numbers)}/>")
    if joint.coulomb is not None or joint.viscous is not None:
        lines.append("    <dynamics "
                     f"{_attributes({'damping': joint.viscous or 0.0, 'friction': joint.coulomb or 0.0})}/>")
    return [*lines, "  </joint>"]


def _link(number: int, link: Link | None, behind: Placement) -> list[str]:
    if link is None or link.mass == 0.0:
        return [f'  <link name="link_{number}"/>']
    inertia = behind.rotation @ link.inertia @ behind.rotation.T
    centre = behind.rotation @ link.centre_of_mass + behind.position
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    return [f'  <link name="link_{number}">', "    <inertial>",
            f"      {_origin(Placement(position=centre))}",
            f"      <mass {_attributes({'value': link.mass})}/>",
            f"      <inertia {_attributes({name: inertia[at] for name, at in names.items()})}/>",
            "    </inertial>", "  </link>"]


def _fixed(name: str, parent: str, child: str, placement: Placement) -> list[str]:
    ends = [f'    <parent link="{parent}"/>', f'    <child link="{child}"/>']
    return [f'  <joint name="{name}" type="fixed">', *ends, f"    {_origin(placement)}", "  </joint>"]


def _transmission(number: int, joint: Joint) -> list[str]:
    if joint.ratio is None:
        return []
    return [
        f'  <transmission name="gear_{number}">',
        "    <type>transmission_interface/SimpleTransmission</type>",
        f'    <joint name="joint_{number}"/>',
        '    <actuator '
        f'name="motor_{number}"><mechanicalReduction>{float(joint.ratio)!r}</mechanicalReduction></actuator>',
        "  </transmission>"]


def _attributes(numbers: dict[str, float]) -> str:
    return " ".join(f'{name}="{float(value)!r}"' for name, value in numbers.items())


def _origin(placement: Placement) -> str:
    roll, pitch, yaw = roll_pitch_yaw(placement.rotation)
    triple = lambda values: " ".join(repr(float(value)) for value in values)
    return f'<origin xyz="{triple(placement.position)}" rpy="{triple((roll, pitch, yaw))}"/>'


def roll_pitch_yaw(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles with Rot_z(yaw) Rot_y(pitch) Rot_x(roll) = rotation, to rounding also at pitch +-90 degrees."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    # The other two are taken from what yaw leaves, so an arbitrary yaw at +-90 degrees costs no accuracy.
    rest = rotation_z(yaw).T @ rotation
    return np.arctan2(-rest[1, 2], rest[1, 1]), np.arctan2(-rest[2, 0], rest[0, 0]), yaw


def _comment(robot: Robot) -> str:
    lost = [f"effect {effect.label}" for effect in robot.effects]
    for number, (joint, ratio, known) in enumerate(zip(robot.joints, robot.ratios, robot.controller_ratios),
                                                   start=1):
        lost += [f"gear harmonics of joint {number}"] if joint.has_harmonics else []
        lost += [f"spring of joint {number}"] if joint.spring_linear is not None else []
        lost += [f"rotor inertia of joint {number}"] if joint.rotor_inertia is not None else []
        lost += [f"acceleration limit of joint {number}"] if joint.q_ddot_max is not None else []
        lost += [f"gear ratio of joint {number} other than the controller's"] if ratio != known else []
    coupled = robot.controller.coupling_in_words
    text = "Written by exactarm. Joint angles are those that the controller reports"
    text += f", but for {coupled}: give q." if coupled else "."
    text += f" A limit of {NOT_DECLARED:g} is not declared."
    if lost:
        text += " Not in this file, for URDF cannot carry it: " + "; ".join(lost) + "."
    return text.replace("--", "- -")
