"""Seeded random URDF texts, and forward kinematics straight from the text, as its specification says it."""

from __future__ import annotations

import xml.etree.ElementTree as xml

import numpy as np


def random_urdf(rng: np.random.Generator, joints: str, parallel: float = 0.4) -> str:
    """A chain; one letter a joint: r(evolute), c(ontinuous), p(rismatic), f(ixed). `parallel`: share of such
    axes."""
    lines = ['<robot name="sample">', link("link_0", rng)]
    kinds = {"r": "revolute", "c": "continuous", "p": "prismatic", "f": "fixed"}
    for number, letter in enumerate(joints, start=1):
        turned = rng.uniform(-3, 3, 3)
        if rng.random() < parallel:
            turned = np.array([0.0, 0.0, rng.choice([0.0, np.pi, rng.normal() * 1e-3])])
        elif rng.random() < 0.5:
            turned = rng.choice([0.0, np.pi / 2, -np.pi / 2, np.pi], 3)
        axis = rng.choice([-1.0, 1.0]) * (np.eye(3)[2] if rng.random() < 0.7 else rng.normal(size=3))
        lines += [
            f'<joint name="joint_{number}" type="{kinds[letter]}">',
            f'<parent link="link_{number - 1}"/><child link="link_{number}"/>',
            f'<origin xyz="{numbers(rng.uniform(-0.5, 0.5, 3) * rng.integers(0, 2, 3))}" '
            f'rpy="{numbers(turned)}"/>',
            f'<axis xyz="{numbers(axis)}"/><limit lower="-2.5" upper="2.75" velocity="3" '
            'effort="100"/></joint>',
            link(f"link_{number}", rng),
        ]
    return "\n".join([*lines, "</robot>"])


def link(name: str, rng: np.random.Generator) -> str:
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    inertia = turn @ np.diag(rng.uniform(0.2, 0.35, 3)) @ turn.T
    values = dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), inertia[np.triu_indices(3)]))
    entries = " ".join(f'{key}="{value!r}"'
                       for key, value in ((key, float(value)) for key, value in values.items()))
    origin = f'<origin xyz="{numbers(rng.uniform(-0.2, 0.2, 3))}" rpy="{numbers(rng.uniform(-3, 3, 3))}"/>'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{rng.uniform(1, 9)!r}"/><inertia '
        f'{entries}/></inertial></link>'
    )


def numbers(values) -> str:
    return " ".join(repr(float(value)) for value in values)


def urdf_pose(text: str, tip: str, q: dict[str, float]) -> np.ndarray:
    """(4, 4) pose of link `tip` in the root link; q by joint name."""
    joints = {element.find("child").get("link"): element for element in xml.fromstring(text).findall("joint")}
    pose = np.eye(4)
    while tip in joints:
        element = joints[tip]
        read = lambda part, name, default: np.array([float(word) for word in part.get(name, default).split()])
        origin = element.find("origin")
        local = np.eye(4)
        if origin is not None:
            roll, pitch, yaw = read(origin, "rpy", "0 0 0")
            local[:3, 3] = read(origin, "xyz", "0 0 0")
            local[:3, :3] = turn([0, 0, 1], yaw) @ turn([0, 1, 0], pitch) @ turn([1, 0, 0], roll)
        move = np.eye(4)
        if element.get("type") != "fixed":
            axis = read(element.find("axis"), "xyz", "1 0 0")
            axis = axis / np.linalg.norm(axis)
            if element.get("type") == "prismatic":
                move[:3, 3] = q[element.get("name")] * axis
            else:
                move[:3, :3] = turn(axis, q[element.get("name")])
        pose = local @ move @ pose
        tip = element.find("parent").get("link")
    return pose


def turn(axis, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
