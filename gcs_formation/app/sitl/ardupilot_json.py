"""ArduPilot's interface to a simulator of motion that isn't its own (`--model JSON`).

Source: libraries/SITL/examples/JSON/readme.md, SIM_JSON.cpp. The autopilot sends its outputs and waits; each answer is
a line of JSON, whose timestamp its clock then goes on to.
"""

from __future__ import annotations

import math
import socket
import struct
from typing import Final

from airlink.clock import MICROSECONDS
from airlink.endpoint import LOOPBACK
from flight_model.autopilot_model import wrap
from flight_model.earth import GeodeticOrigin
from gcs_formation.app.sitl.exchange import Exchange, ExchangeError, Sample
from gcs_formation.app.sitl.simulator import Home
from sim_vehicles.airframe.rigid_body.motion import Vector

MAGIC: Final = struct.Struct("<H")
OUTPUTS, MORE_OUTPUTS = struct.Struct("<HHI16H"), struct.Struct("<HHI32H")
LAYOUTS: Final = {MAGIC.pack(18458): OUTPUTS, MAGIC.pack(29569): MORE_OUTPUTS}
"""By their first bytes; of 32 outputs with SERVO_32_ENABLE."""
MAX_BYTES: Final = 1024
METRES_PER_DEGREE: Final = 111_318.84502145034
"""Of ArduPilot's sphere (libraries/AP_Common/Location.cpp)."""
WAITS: Final = 150
LOOK_S: Final = 0.2
"""Wall time between looks whether an autopilot that is waited for has ended; it is given up after that many."""
TIME_LIMIT: Final = struct.pack("ll", 0, round(LOOK_S * MICROSECONDS))
SPARE_S: Final = 1e-10
"""Added to each step of the timestamps, of which the autopilot drops what is left of a microsecond."""
LINE: Final = (
    '\n{"timestamp":%.12f,"imu":{"gyro":[%.7f, %.7f, %.7f],"accel_body":[%.6f, %.6f, %.6f]},'
    '"position":[%.5f, %.5f, %.5f],"quaternion":[%.9f, %.9f, %.9f, %.9f],"velocity":[%.6f, %.6f, %.6f],'
    '"airspeed":%.5f,"no_time_sync":1}\n'
)


class JsonExchange(Exchange):
    """Sensors and actuators of an ArduPilot."""

    def __init__(self, home: Home, step_s: float) -> None:
        """Listen at a free port; the vehicle begins at its home."""
        self.step_s = step_s
        self._origin = GeodeticOrigin(math.radians(home.lat_deg), math.radians(home.lon_deg), home.alt_m)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        # A time limit of the kernel's: Python's own asks before each datagram whether there is one.
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, TIME_LIMIT)
        self.port = self._socket.getsockname()[1]
        self._autopilot: tuple[str, int] = (LOOPBACK, 0)
        self._frame = -1

    def outputs_us(self) -> tuple[int, ...]:
        """Return the pulses; outputs that it sends again because the answer is late are passed over."""
        for _ in range(WAITS):
            try:
                data, self._autopilot = self._socket.recvfrom(MAX_BYTES)
            except BlockingIOError:
                if self.has_ended():
                    break
                continue
            layout = LAYOUTS.get(data[: MAGIC.size])
            if layout is None or len(data) != layout.size:
                continue
            _magic, _rate_hz, frame, *pulses = layout.unpack(data)
            if frame != self._frame:
                self._frame = frame
                return tuple(pulses)
        raise ExchangeError("its simulator asks for no sensors")

    def answer(self, sample: Sample) -> None:
        """Send the line."""
        number, accel, gyro, position_m, attitude, velocity, airspeed_mps = sample
        north_m, east_m = self._on_sphere(position_m)
        position = north_m, east_m, position_m[2]
        line = LINE % (number * (self.step_s + SPARE_S), *gyro, *accel, *position, *attitude, *velocity, airspeed_mps)
        self._socket.sendto(line.encode(), self._autopilot)

    def _on_sphere(self, position_m: Vector) -> tuple[float, float]:
        """Return north and east from home that the autopilot takes for where the body is: its Earth is a sphere.

        Its receiver then reports the body's latitude and longitude, as a real one does.
        """
        lat_rad, lon_rad, _ = self._origin.from_ned(*position_m)
        halfway_rad = (lat_rad + self._origin.lat_rad) / 2.0
        east_deg = math.degrees(wrap(lon_rad - self._origin.lon_rad))
        north_deg = math.degrees(lat_rad - self._origin.lat_rad)
        return north_deg * METRES_PER_DEGREE, east_deg * math.cos(halfway_rad) * METRES_PER_DEGREE

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
