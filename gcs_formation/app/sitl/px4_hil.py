"""PX4's interface to a simulator of motion that isn't its own: HIL messages over TCP, whose time its clock follows.

Source: PX4 user guide, "Simulation", section "Simulator MAVLink API", and "Lockstep Simulation";
src/modules/simulation/simulator_mavlink/SimulatorMavlink.cpp. Each HIL_SENSOR sets its clock, and its outputs for that
time come back. While it starts there are none, and its clock is stepped without.

The sensors' noise is from the run's seed.
"""

from __future__ import annotations

import math
import socket
import struct
from contextlib import suppress
from typing import Final

import numpy as np

from airlink import mavlink as m
from airlink.checksum import checksum
from airlink.clock import MICROSECONDS, VIRTUAL_EPOCH_US
from airlink.endpoint import LOOPBACK
from airlink.stream_parser import StreamParser
from flight_model.autopilot_model import within
from flight_model.earth import GeodeticOrigin, air_density_kgm3
from gcs_formation.app.sitl.exchange import Exchange, ExchangeError, Sample
from gcs_formation.app.sitl.simulator import Home, SimulatorError
from sim_vehicles.airframe.rigid_body.motion import to_body
from sim_vehicles.airframe.rigid_body.quadrotor import FULL_US, IDLE_US

FIRST_PORT: Final = 4560
IMU_HZ: Final = 200
"""HIL_SENSORs a second, which PX4's IMU_INTEG_RATE allows."""
EVERY: Final = 2
"""Steps of the body for each."""
MAG_EVERY, BARO_EVERY, GPS_EVERY, RANGE_EVERY = 2, 4, 20, 10
"""HIL_SENSORs for each reading."""
SENSOR: Final = struct.Struct("<Q13fIB")
GPS: Final = struct.Struct("<QiiiHHHhhhHBB")
RANGE: Final = struct.Struct("<IHHHBBBB")
CONTROLS: Final = struct.Struct("<QQ16fB")
HEADER: Final = struct.Struct("<BBBBBBBHB")
"""Of MAVLink 2, with the message's id as 16 and 8 bits."""
INERTIAL, MAGNETIC, PRESSURE, AIRSPEED = 0o77, 0o700, 0b1101000000000, 0b10000000000
"""Bits of `fields_updated`."""
DOWN: Final = (0.0, 0.0, 1.0)
NEUTRAL: Final = (1500, 1500, 1000, 1500)
BOOTING_S: Final = 0.005
"""Wall time for each step while there are no outputs: its threads start in it."""
LOOK_S, LOOKS = 0.2, 150
"""Wall time between looks whether one that is waited for has ended; it is given up after that many."""
MAG_NOISE_GAUSS: Final = 0.002
BARO_NOISE_HPA: Final = 0.02
PITOT_NOISE_HPA: Final = 0.01
"""Sensors that show the same for two seconds count as dead."""
GPS_NOISE_M, GPS_NOISE_MPS = 0.2, 0.06
RANGE_M: Final = (0.2, 100.0)
"""The rangefinder's, downward: without one a PX4 breaks every landing of a fixed wing off (FW_LND_USETER)."""
RANGE_NOISE_M: Final = 0.02
SEA_LEVEL_HPA, SEA_LEVEL_K, LAPSE_K_PER_M, EXPONENT = 1013.25, 288.15, 0.0065, 5.2559
KELVIN: Final = 273.15
MAX_BYTES: Final = 65535
MAX_CMPS: Final = 32767.0


class HilExchange(Exchange):
    """Sensors and actuators of a PX4."""

    def __init__(self, instance: int, home: Home, *, hovers: bool, random: np.random.Generator) -> None:
        """Listen at the instance's port.

        Raises:
            SimulatorError: it is taken.
        """
        self.port, self.step_s = FIRST_PORT + instance, 1.0 / (EVERY * IMU_HZ)
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind((LOOPBACK, self.port))
        except OSError as error:
            self._listener.close()
            found = f"found TCP port {self.port} taken, at which instance {instance} of PX4 asks for its sensors"
            raise SimulatorError(f"{found}; allowed: no other simulator of this instance") from error
        self._listener.listen(1)
        self._listener.settimeout(LOOK_S)
        self._socket: socket.socket | None = None
        self._hovers, self._random = hovers, random
        self._origin = GeodeticOrigin(math.radians(home.lat_deg), math.radians(home.lon_deg), home.alt_m)
        self._field_gauss = m.magnetic_field_gauss(home.lat_deg, home.lon_deg)
        self._parser = StreamParser()
        self._outputs_us: tuple[int, ...] = NEUTRAL
        self._sent_us, self._acted_us, self._count, self._sequence = 0, -1, 0, 0
        self._awaits_outputs = True
        """Whether a sample has gone out since outputs were waited for."""

    def outputs_us(self) -> tuple[int, ...]:
        """Return the pulses; while it starts, neutral ones."""
        if self._socket is None:
            self._connect()
        if self._acted_us < 0 and not self._awaits_outputs:
            return self._outputs_us
        self._awaits_outputs = False
        for _ in range(LOOKS):
            if self._acted_us >= self._sent_us:
                return self._outputs_us
            booting = self._acted_us < 0
            if not self._read(BOOTING_S if booting else LOOK_S):
                if self.has_ended():
                    break
                if booting:
                    return self._outputs_us
        raise ExchangeError("its simulator puts nothing out")

    def _connect(self) -> None:
        for _ in range(LOOKS):
            try:
                self._socket, _ = self._listener.accept()
            except TimeoutError:
                if self.has_ended():
                    break
                continue
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return
        raise ExchangeError("its simulator asks for no sensors")

    def _read(self, wait_s: float) -> bool:
        """Take what has come within a time; return whether anything has."""
        assert self._socket is not None
        self._socket.settimeout(wait_s)
        try:
            data = self._socket.recv(MAX_BYTES)
        except TimeoutError:
            return False
        except OSError:
            data = b""
        if not data:
            raise ExchangeError("its simulator has closed its connection")
        frame = self._parser.first(data)
        while frame is not None:
            if frame.message_id == m.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS:
                payload = bytes(frame.raw[HEADER.size : -2]).ljust(CONTROLS.size, b"\0")
                self._acted_us, _flags, *controls, _mode = CONTROLS.unpack(payload[: CONTROLS.size])
                self._outputs_us = _pulses(controls, hovers=self._hovers)
            frame = frame.following
        return True

    def answer(self, sample: Sample) -> None:
        """Send HIL_SENSOR, before it HIL_GPS and DISTANCE_SENSOR when they are due."""
        if sample.number % EVERY:
            return
        self._count += 1
        self._awaits_outputs = True
        self._sent_us = round(sample.number * self.step_s * MICROSECONDS)
        frames = self._gps(sample) if self._count % GPS_EVERY == 0 else b""
        if self._count % RANGE_EVERY == 0:
            frames += self._range(sample)
        assert self._socket is not None
        with suppress(OSError):  # it has ended, which is noticed when its outputs are waited for
            self._socket.sendall(frames + self._sensors(sample))

    def _sensors(self, sample: Sample) -> bytes:
        fields, noise = INERTIAL, self._random.standard_normal(5).tolist()
        field = to_body(sample.attitude, self._field_gauss)
        mag = [part + MAG_NOISE_GAUSS * each for part, each in zip(field, noise[:3], strict=True)]
        above_sea_m = self._origin.alt_m - sample.position_m[2]
        kelvin = SEA_LEVEL_K - LAPSE_K_PER_M * above_sea_m
        pressure_hpa = SEA_LEVEL_HPA * (kelvin / SEA_LEVEL_K) ** EXPONENT
        dynamic_hpa = 0.5 * air_density_kgm3(above_sea_m) * sample.airspeed_mps**2 / 100.0
        fields |= MAGNETIC if self._count % MAG_EVERY == 0 else 0
        fields |= PRESSURE | AIRSPEED if self._count % BARO_EVERY == 0 else 0
        pressure_hpa += BARO_NOISE_HPA * noise[3]
        dynamic_hpa += PITOT_NOISE_HPA * noise[4]
        payload = SENSOR.pack(
            self._sent_us,
            *sample.accel_mps2,
            *sample.gyro_rps,
            *mag,
            pressure_hpa,
            dynamic_hpa,
            above_sea_m,
            kelvin - KELVIN,
            fields,
            0,
        )
        return self._framed(m.MAVLINK_MSG_ID_HIL_SENSOR, payload)

    def _gps(self, sample: Sample) -> bytes:
        noise = self._random.standard_normal(6).tolist()
        north_m, east_m, down_m = (
            part + GPS_NOISE_M * each for part, each in zip(sample.position_m, noise[:3], strict=True)
        )
        north, east, down = (
            part + GPS_NOISE_MPS * each for part, each in zip(sample.velocity_mps, noise[3:], strict=True)
        )
        lat_rad, lon_rad, alt_m = self._origin.from_ned(north_m, east_m, down_m)
        course_cdeg = round(math.degrees(math.atan2(east, north)) * 100.0) % 36000
        payload = GPS.pack(
            VIRTUAL_EPOCH_US + self._sent_us,
            round(math.degrees(lat_rad) * 1e7),
            round(math.degrees(lon_rad) * 1e7),
            round(alt_m * 1e3),
            30,
            40,
            _cmps(math.hypot(north, east)),
            *(_cmps(each) for each in (north, east, down)),
            course_cdeg,
            3,
            10,
        )
        return self._framed(m.MAVLINK_MSG_ID_HIL_GPS, payload)

    def _range(self, sample: Sample) -> bytes:
        """Return the distance to the level ground below, along the body's axis; nothing beyond the sensor's range."""
        upright = to_body(sample.attitude, DOWN)[2]
        distance_m = -sample.position_m[2] / upright if upright > 0.0 else math.inf
        distance_m += RANGE_NOISE_M * float(self._random.standard_normal())
        if distance_m > RANGE_M[1]:
            return b""
        limits_cm = [round(100.0 * each) for each in RANGE_M]
        time_ms, distance_cm = round(self._sent_us / 1000.0), round(100.0 * max(distance_m, RANGE_M[0]))
        direction = m.MAV_SENSOR_ROTATION_PITCH_270
        payload = RANGE.pack(time_ms, *limits_cm, distance_cm, m.MAV_DISTANCE_SENSOR_LASER, 0, direction, 0)
        return self._framed(m.MAVLINK_MSG_ID_DISTANCE_SENSOR, payload)

    def _framed(self, message_id: int, payload: bytes) -> bytes:
        self._sequence = (self._sequence + 1) & 0xFF
        payload = payload.rstrip(b"\0") or b"\0"
        frame = HEADER.pack(0xFD, len(payload), 0, 0, self._sequence, 0, 50, message_id, 0) + payload
        return frame + struct.pack("<H", checksum(frame, len(frame), m.crc_extras()[message_id]))

    def close(self) -> None:
        """Close the connection, and listen no more."""
        if self._socket is not None:
            self._socket.close()
        self._listener.close()


def _cmps(speed_mps: float) -> int:
    """Return a speed in cm/s, as far as the message can say it."""
    return round(within(speed_mps * 100.0, -MAX_CMPS, MAX_CMPS))


def _pulses(controls: list[float], *, hovers: bool) -> tuple[int, ...]:
    """Return pulses, µs, for controls: 0 to 1 of motors, -1 to 1 of surfaces; NaN, of what is disarmed, is neutral."""
    given = [0.0 if math.isnan(each) else within(each, -1.0, 1.0) for each in controls[:4]]
    if hovers:
        return tuple(round(IDLE_US + (FULL_US - IDLE_US) * each) if each > 0.0 else 1000 for each in given)
    aileron, elevator, throttle, rudder = given
    surfaces = [round(1500 + 500 * each) for each in (aileron, elevator, rudder)]
    return surfaces[0], surfaces[1], round(1000 + 1000 * throttle), surfaces[2]
