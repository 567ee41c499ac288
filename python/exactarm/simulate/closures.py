"""Closures on a virtual robot: poses in which the true target touches a fixture, as a person or a probe would
find them.

A place (session) has the fixture somewhere in the robot's reach: two sockets or two spheres apart by a known
distance, a block with three skew faces and one that is parallel to the first, two far ends of a telescopic
bar, pairs of poses, or a board before a camera; another arm stands beside this one. A gravity sensor on the
flange needs no fixture: a place is the arm set up once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup, Distance, Fixture, Radius
from exactarm.data.kinds import CLOSURES
from exactarm.errors import ComputationError
from exactarm.measurement.closures import PAIR
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import ARMS, CAMERA, SENSORS, TOUCHED, Bar, Plane, Socket, Sphere
from exactarm.measurement.touching import TOUCHES_M, predicted_at, rows_at, target_at, touching
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import GRAVITY_M_S2, Placement
from exactarm.simulate.partner import touched_partner
from exactarm.simulate.pictures import SETUP, measured_pictures
from exactarm.simulate.profiles import limit
from exactarm.simulate.sensors import Sensors, read
from exactarm.simulate.virtual_robot import VirtualRobot

CONTACTS = (*TOUCHED, PAIR, *SENSORS, *CAMERA, *ARMS)
_BESIDE = ("length", "pixel", "picture", "corner", "partner", *SENSORS)  # what rows hold beside angles
# of the fixture; shortest and longest length of the telescopic bar
APART_M, RADIUS_M, BAR_M = 0.1, 0.0127, (0.25, 0.45)
SLIP_M = 5e-3  # standard deviation of a contact that has slipped
# standard deviations of an ordinary gravity sensor: base tilt, zero, gain, bias; range of a tilt
_LEANS_RAD, _ZERO_RAD, _GAIN, _BIAS_M_S2, _RANGE_RAD = 3e-3, 3e-3, 5e-3, 0.1, 1.0
_NEAR_M = 0.35  # a search starts this near
_REACH = (0.25, 0.7)  # of the greatest distance from axis 1, and from the base: where a fixture stands
_OTHERWISE_RAD = 0.3  # nearer poses of the arm are one
_POOL = 25  # random poses for each touch
_IN_VAIN = 3  # so many pools without a single touch: out of reach


def measure_closures(
    robot: VirtualRobot, contact: str, places: int, count: int, sensors: Sensors, random: np.random.Generator,
    setup: CameraSetup = SETUP,
) -> tuple[Dataset, Fixture]:
    """`count` touches of every contact at each of `places` (pairs: `count` pairs; another arm stands at one
    place), and the fixture file's content."""
    true = VirtualRobot(robot.nominal, replace(robot.true, base=Placement()))
    parts, partner = [], None
    if contact in ARMS:
        rows, partner = touched_partner(true, count, sensors, random)
        parts.append(rows)
    for session in range(1, places + 1):
        for thing in _fixture(contact, session, _middle(true, random), random):
            parts.append(_touched(true, thing, count, sensors, random))
        if contact == PAIR:
            parts += [_pair(true, session, number, sensors, random) for number in range(count)]
        if contact in SENSORS:
            parts.append(_gravity(true, contact, session, count, sensors, random))
        if contact in CAMERA:
            parts.append(_pictures(true, session, count, sensors, random, setup))
    data = _joined(robot, parts)
    distances = (Distance(contact, (0, 1), APART_M),) if contact in ("socket", "sphere") else ()
    distances += (Distance(contact, (0, 3), APART_M),) if contact == "plane" else ()
    radii = tuple(Radius(contact, number, RADIUS_M) for number in (0, 1)) if contact == "sphere" else ()
    fixture = Fixture(distances, radii, camera=setup if contact in CAMERA else None, partner=partner)
    return read(replace(data, fixture=fixture), sensors, random), fixture


def _pictures(robot: VirtualRobot, session: int, count: int, sensors: Sensors, random: np.random.Generator,
              setup: CameraSetup) -> Dataset:
    """Corners in `count` pictures of a board."""
    limits = limit(robot.nominal, "q_min"), limit(robot.nominal, "q_max")
    for _ in range(_POOL):
        rows = measured_pictures(robot.true, robot.layout, session, _middle(robot, random), count, limits,
                                 sensors, random, setup)
        if rows is not None:
            return rows
    raise ComputationError("no place was found where the arm can look at the board from all sides")


def _gravity(robot: VirtualRobot, contact: str, session: int, count: int, sensors: Sensors,
             random: np.random.Generator) -> Dataset:
    """`count` random poses in which a sensor on the flange is read; its noise is that of an orientation."""
    sensor = SENSORS[contact](None, (), session)
    c, tilts = sensor.numbers, contact == "tilt"
    values = np.concatenate([
        np.zeros(3), random.normal(0.0, _LEANS_RAD, 2), random.normal(0.0, _GAIN, c),
        random.normal(0.0, _ZERO_RAD if tilts else _BIAS_M_S2, c), np.zeros(sensor.size() - 5 - 2 * c),
    ])
    mounting = exp(random.normal(0.0, 1.0, 3))
    sensor = replace(sensor.with_values(values), reference=tuple(tuple(map(float, row)) for row in mounting))
    q = _drawn(robot, _POOL * count if tilts else count, random)
    approach = random.choice([-1.0, 1.0], q.shape)
    unread = {contact: np.zeros((len(q), c))}
    numbers = -predicted_at(robot.true, robot.layout, q, sensor, approach, **unread).residual[:, :c]
    good = np.flatnonzero(np.abs(numbers).max(axis=1) < (_RANGE_RAD if tilts else np.inf))[:count]
    noisy = numbers[good] + random.normal(0.0, sensors.orientation_rad, (len(good), c))
    wrong = random.random(len(good)) < sensors.wrong_rows
    noisy += wrong[:, None] * random.normal(0.0, 30.0 * sensors.orientation_rad, noisy.shape)
    reading = {contact: noisy if tilts else GRAVITY_M_S2 * noisy}
    return rows_at(q[good], sensor, approach[good], **reading)


def fixture_text(fixture: Fixture) -> str:
    """The fixture file."""
    lines = []
    for entry in fixture.distances:
        lines += ["[[distances]]", f'contact = "{entry.contact}"', f"between = {list(entry.between)}",
                  f"length_mm = {1e3 * entry.length:g}"]
    for entry in fixture.radii:
        lines += ["[[radii]]", f'contact = "{entry.contact}"', f"number = {entry.number}",
                  f"radius_mm = {1e3 * entry.length:g}"]
    if (partner := fixture.partner) is not None:
        lines += ["[partner]", f'robot = "{partner.file}"', f"distance_mm = {1e3 * partner.distance:g}"]
    if (camera := fixture.camera) is not None:
        lines += ["[board]", f"squares = [{camera.columns}, {camera.rows}]",
                  f"square_mm = {1e3 * camera.square:g}", "", "[camera]",
                  f'on = "{"flange" if camera.on_flange else "stand"}"']
        lines += [] if camera.size is None else [f"size_px = {list(camera.size)}"]
    return "\n".join([*lines, ""])


def _drawn(robot: VirtualRobot, count: int, random: np.random.Generator) -> np.ndarray:
    lower, upper = limit(robot.nominal, "q_min"), limit(robot.nominal, "q_max")
    return random.uniform(lower, upper, (count, robot.nominal.axes))


def _middle(robot: VirtualRobot, random: np.random.Generator) -> np.ndarray:
    """(3,) a place for the fixture: in the middle of the reach, not beneath the floor."""
    points = target_at(robot.true, robot.layout, _drawn(robot, 400, random))
    away, far = np.linalg.norm(points[:, :2], axis=1), np.linalg.norm(points, axis=1)
    good = (away > _REACH[0] * away.max()) & (far < _REACH[1] * far.max()) & (points[:, 2] > 0.0)
    return points[random.choice(np.flatnonzero(good))]


def _fixture(contact: str, session: int, middle: np.ndarray, random: np.random.Generator) -> list[Contact]:
    turned = np.linalg.qr(random.normal(size=(3, 3)))[0]
    ends = (middle, middle + APART_M * turned[0])
    of = lambda cls, place, values: cls(None, tuple(float(v) for v in values), session, place)
    if contact == "socket":
        return [of(Socket, k, end) for k, end in enumerate(ends)]
    if contact == "sphere":
        return [of(Sphere, k, [*end, RADIUS_M]) for k, end in enumerate(ends)]
    if contact == "bar":
        return [replace(of(Bar, k, [*end, 0.0]), absolute=True)
                for k, end in enumerate((middle, middle + 0.4 * turned[0]))]
    if contact == "plane":
        faces = [(middle, turned[k], turned[(k + 1) % 3], turned[(k + 2) % 3]) for k in (0, 1, 2)]
        faces.append((middle - APART_M * turned[0], turned[0], turned[1], turned[2]))
        rows = lambda face: tuple(tuple(float(x) for x in row) for row in face)
        return [replace(of(Plane, k, (0.0, 0.0, 0.0)), reference=rows(face)) for k, face in enumerate(faces)]
    return []


def _touched(robot: VirtualRobot, thing: Contact, count: int, sensors: Sensors,
             random: np.random.Generator) -> Dataset:
    """`count` rows in which the target touches `thing` up to noise and slips."""
    lower, upper = limit(robot.nominal, "q_min"), limit(robot.nominal, "q_max")
    found, sides, lengths = np.zeros((0, len(lower))), np.zeros((0, len(lower))), np.zeros(0)
    centre = thing.point if isinstance(thing, Plane) else np.asarray(thing.values[:3])
    for attempt in range(_POOL):
        if attempt >= _IN_VAIN and not len(found):
            break
        q = _drawn(robot, _POOL * count, random)
        q = q[np.linalg.norm(target_at(robot.true, robot.layout, q) - centre, axis=1) < _NEAR_M
              + (BAR_M[0] if thing.contact == "bar" else 0.0)]
        if not len(q):
            continue
        noise = random.normal(0.0, sensors.position_m, (len(q), 3))
        noise += (random.random(len(q)) < sensors.wrong_rows)[:, None] * random.normal(0.0, SLIP_M,
                                                                                       noise.shape)
        length = random.uniform(*BAR_M, len(q)) if thing.contact == "bar" else np.zeros(len(q))
        approach = random.choice([-1.0, 1.0], q.shape)
        more = {"length": length} if thing.contact == "bar" else {}
        q, left = touching(robot.true, robot.layout, q, thing, noise[:, : thing.numbers], approach, **more)
        good = (left < TOUCHES_M) & np.all((q > lower) & (q < upper), axis=1)
        if isinstance(thing, Plane):  # a face of a block is no larger than some decimetres
            good &= np.linalg.norm(target_at(robot.true, robot.layout, q) - centre, axis=1) < _NEAR_M
        found, sides = np.concatenate([found, q[good]]), np.concatenate([sides, approach[good]])
        lengths = np.concatenate([lengths, length[good]])
        if len(found) >= count:
            more = {"length": lengths[:count]} if thing.contact == "bar" else {}
            return rows_at(found[:count], thing, sides[:count], **more)
    raise ComputationError(f"the fixture at ({', '.join(f'{x:.2f}' for x in centre)}) m is out of reach; "
                           "another seed places it elsewhere")


def _pair(robot: VirtualRobot, session: int, number: int, sensors: Sensors,
          random: np.random.Generator) -> Dataset:
    """Two poses of the arm with the same pose of the target, up to noise."""
    lower, upper = limit(robot.nominal, "q_min"), limit(robot.nominal, "q_max")
    for _ in range(_POOL):
        first = _drawn(robot, 1, random)
        side = random.choice([-1.0, 1.0], (_POOL, len(lower)))
        view = predicted_at(robot.true, robot.layout, first, None, side[:1], position=np.zeros((1, 3))).view
        position, rotation = view.signals["target"], view.signals["target_rotation"].reshape(1, 3, 3)
        position = position + random.normal(0.0, sensors.position_m, (1, 3))
        rotation = exp(random.normal(0.0, sensors.orientation_rad, (1, 3))) @ rotation
        q = _drawn(robot, _POOL, random)
        more = {"position": np.repeat(position, len(q), 0), "rotation": np.repeat(rotation, len(q), 0)}
        q, left = touching(robot.true, robot.layout, q, None, 0.0, side, **more)
        good = (left < TOUCHES_M) & np.all((q > lower) & (q < upper), axis=1)
        good &= np.max(np.abs(q - first), axis=1) > _OTHERWISE_RAD
        if good.any():
            both = (np.concatenate([one[:1], other[good][:1]]) for one, other in ((first, q), (side, side)))
            rows = rows_at(next(both), None, next(both))
            numbers = rows.contacts | {PAIR: np.full(2, number)}
            return replace(rows, contacts=numbers, session=np.full(2, session))
    raise ComputationError("no second pose of the arm reaches the same pose of the target within the joint "
                           "limits")


def _joined(robot: VirtualRobot, parts: list[Dataset]) -> Dataset:
    stack = lambda pick: np.concatenate([pick(part) for part in parts])
    marks = lambda name: stack(lambda part: part.contacts.get(name, np.full(len(part), -1)))
    used = [name for name in CONTACTS if np.any(marks(name) >= 0)]
    more = {name: stack(lambda part, name=name: getattr(part, name)) for name in _BESIDE
            if getattr(parts[0], name) is not None}
    return Dataset.of_arrays(
        CLOSURES.name, {"theta": robot.motor_angles(stack(lambda part: part.joints["q"])),
                     "approach": stack(lambda part: part.joints["approach"])},
        session=stack(lambda part: part.session),
        contacts={name: marks(name) for name in used}, **more,
    )
