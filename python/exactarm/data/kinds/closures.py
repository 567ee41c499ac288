"""Closures: poses in which the tool touches something fixed (columns socket, plane, sphere, bar, pair), a
sensor on the flange feels gravity (tilt_x, tilt_y; accel_x, accel_y, accel_z), a camera sees a board (u, v,
picture, corner) or another arm is touched (partner_q_i)."""

import numpy as np

from exactarm.data.columns import PICTURE
from exactarm.data.kinds.base import Device, Kind, check_geometry, check_joints, file_of
from exactarm.data.rows import Rows
from exactarm.errors import InputError
from exactarm.robot.robot import Robot


class _Closures(Kind):
    name, device, at_rest, alone = "closures", Device.CONTACT, True, True
    rows, row, error = "touches", "pose", "distance to the contact"
    measured_as = "closures"
    anew = "Touch the fixture at another place"

    def held_by(self, data: Rows) -> bool:
        return bool(data.contacts)

    def check(self, data: Rows, robot: Robot) -> None:
        if not data.contacts:
            message = ("column missing; expected socket, plane, sphere, bar, pair, tilt_x_rad, "
                       "accel_x_m_s2, u_px or partner_q_i_rad for closures")
            raise InputError(message, file=file_of(data), column="socket")
        check_geometry(robot)
        check_joints(data, robot)
        for name, values in (("tilt_x", data.tilt), ("accel_x", data.accel), ("u_px", data.pixel),
                             ("partner_q_1", data.partner)):
            if values is not None and (half := np.isnan(values).any(1) & ~np.isnan(values).all(1)).any():
                at = int(np.argmax(half))
                raise InputError("a reading of one axis alone; expected all axes of the sensor (of the other "
                                 "arm) or none",
                                 file=file_of(data, data.file_index[at]), row=int(data.row[at]),
                                 column=name)
        if data.pixel is not None:
            seen = data.contacts["camera"] >= 0
            for name in PICTURE:
                if (bare := seen & (getattr(data, name) < 0)).any():
                    at = int(np.argmax(bare))
                    raise InputError(f"pixels without a {name}; expected its number, from 0", column=name,
                                     file=file_of(data, data.file_index[at]), row=int(data.row[at]))
        touched = np.any([numbers >= 0 for numbers in data.contacts.values()], axis=0)
        tracked = np.zeros(len(data), bool)
        if data.position is not None:
            tracked = ~np.isnan(data.position).any(axis=1)
        if not (touched | tracked).all():
            at = int(np.argmin(touched | tracked))
            raise InputError("neither a contact nor x, y, z; expected one of them in every row",
                             file=file_of(data, data.file_index[at]), row=int(data.row[at]),
                             column=next(iter(data.contacts)))


CLOSURES = _Closures()
