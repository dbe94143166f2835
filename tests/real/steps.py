"""Steps of setpoints commanded to one vehicle over UDP by pymavlink, and the time that it takes for them."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from pymavlink import mavutil

from airlink import mavlink as m

VELOCITY_AND_YAW = 0x9C7
WANTED_HZ = {m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 20, m.MAVLINK_MSG_ID_ATTITUDE: 20, m.MAVLINK_MSG_ID_VFR_HUD: 20}
READY_EKF = 831
SETPOINT_EVERY_S = 0.1
Values = tuple[float, ...]


class Step(NamedTuple):
    """From one setpoint to another, and the quantity that is measured."""

    name: str
    before: Values
    after: Values
    watched: str
    settles_s: float


class Family(NamedTuple):
    """How a family takes off and takes setpoints."""

    guided: int
    take_off: Callable[[Pilot], None]
    tell: Callable[[Pilot, Values], None]
    steps: tuple[Step, ...]


@dataclass
class Pilot:
    """One vehicle's ground station; its time is the vehicle's since boot, so simulation may run at any speed."""

    port: int
    family: Family
    seen: dict[str, list[tuple[float, float]]] = field(default_factory=dict[str, list[tuple[float, float]]])
    now_s: float = 0.0
    ready: bool = False

    def __post_init__(self) -> None:
        """Listen at the port until the vehicle is received."""
        self.link: Any = mavutil.mavlink_connection(
            f"udpin:127.0.0.1:{self.port}", source_system=255, dialect="ardupilotmega"
        )
        self.link.wait_heartbeat(timeout=60)
        self._beat_s = self._reported_s = -math.inf
        self._healthy = False
        for message, rate_hz in (*WANTED_HZ.items(), (m.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 2)):
            self.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, message, 1e6 / rate_hz)
        self.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_SYS_STATUS, 5e5)

    def command(self, command: int, *values: float) -> None:
        self.link.mav.command_long_send(1, 1, command, 0, *(*values, 0, 0, 0, 0, 0, 0, 0)[:7])

    def value(self, name: str) -> float:
        return self.seen[name][-1][1]

    def fly(self, seconds: float, values: Values | None = None) -> None:
        """Fly for a time, repeating the same setpoint ten times a second."""
        self.turn()
        until_s = self.now_s + seconds
        while self.now_s < until_s:
            if self.now_s >= self._beat_s + 1.0:
                self.link.mav.heartbeat_send(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
                self._beat_s = self.now_s
            if values is not None and self.now_s >= self._reported_s + SETPOINT_EVERY_S:
                self.family.tell(self, values)
                self._reported_s = self.now_s
            self.turn()

    def turn(self) -> None:
        """Take one message."""
        message = self.link.recv_match(blocking=True, timeout=10)
        assert message is not None, "it fell silent"
        kind = message.get_type()
        if kind == "GLOBAL_POSITION_INT":
            self._take_position(message)
        elif kind == "ATTITUDE":
            self._see("heading", message.yaw)
        elif kind == "VFR_HUD":
            self._see("airspeed", message.airspeed)
        elif kind == "SYS_STATUS":
            self._healthy = bool(message.onboard_control_sensors_health & m.MAV_SYS_STATUS_PREARM_CHECK)
        elif kind == "EKF_STATUS_REPORT":
            self.ready = self._healthy and message.flags & READY_EKF == READY_EKF

    def _take_position(self, message: Any) -> None:
        self.now_s = message.time_boot_ms / 1e3
        self._see("north", message.vx / 100)
        self._see("east", message.vy / 100)
        self._see("up", -message.vz / 100)
        self._see("height", message.relative_alt / 1e3)

    def _see(self, name: str, value: float) -> None:
        self.seen.setdefault(name, []).append((self.now_s, value))

    def step(self, step: Step) -> tuple[float, float]:
        """Return the times at which 63 % and 90 % of a step were done, s."""
        self._reported_s = -math.inf
        self.fly(step.settles_s, step.before)
        self._reported_s = -math.inf
        begun_s, first = self.now_s, len(self.seen[step.watched])
        self.fly(step.settles_s, step.after)
        series = np.array(self.seen[step.watched])
        if step.watched == "heading":
            series[:, 1] = np.unwrap(series[:, 1])
        before = series[:first][series[:first, 0] > begun_s - 1.0, 1].mean()
        times_s, values = series[first:, 0] - begun_s, series[first:, 1]
        share = (values - before) / (values[times_s > step.settles_s - 1.0].mean() - before)
        return crossing_s(times_s, share, 0.63), crossing_s(times_s, share, 0.9)


def crossing_s(times_s: np.ndarray, share: np.ndarray, level: float) -> float:
    """Return when a step first reached a share of its size, between two samples."""
    after = int(np.argmax(share >= level))
    before = max(after - 1, 0)
    if share[after] == share[before]:
        return float(times_s[after])
    part = (level - share[before]) / (share[after] - share[before])
    return float(times_s[before] + part * (times_s[after] - times_s[before]))


def copter_rises(pilot: Pilot) -> None:
    pilot.command(m.MAV_CMD_DO_SET_MODE, 1, pilot.family.guided)
    pilot.fly(1.0)
    pilot.command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    pilot.fly(2.0)
    pilot.command(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 60)
    while pilot.value("height") < 59.0:
        pilot.fly(1.0)


def tell_velocity(pilot: Pilot, values: Values) -> None:
    north, east, up, yaw = values
    frame = m.MAV_FRAME_LOCAL_NED
    pilot.link.mav.set_position_target_local_ned_send(
        0, 1, 1, frame, VELOCITY_AND_YAW, 0, 0, 0, north, east, -up, 0, 0, 0, yaw, 0
    )


def plane_rises(pilot: Pilot) -> None:
    pilot.command(m.MAV_CMD_DO_SET_MODE, 1, 13)
    pilot.fly(1.0)
    pilot.command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    while pilot.value("height") < 45.0:
        pilot.fly(1.0)
    pilot.command(m.MAV_CMD_DO_SET_MODE, 1, pilot.family.guided)
    pilot.fly(40.0, (22.0, 150.0, 0.0))


def tell_flight(pilot: Pilot, values: Values) -> None:
    speed, height, heading = values
    send = pilot.link.mav.command_int_send
    send(1, 1, 0, m.MAV_CMD_GUIDED_CHANGE_SPEED, 0, 0, 0, speed, 0, 0, 0, 0, 0)
    send(1, 1, 3, m.MAV_CMD_GUIDED_CHANGE_ALTITUDE, 0, 0, 0, 0, 0, 0, 0, 0, height)
    send(1, 1, 0, m.MAV_CMD_GUIDED_CHANGE_HEADING, 0, 0, 1, math.degrees(heading) % 360.0, 10, 0, 0, 0, 0)


def both_ways(name: str, low: Values, high: Values, watched: str, settles_s: float) -> tuple[Step, Step]:
    return Step(f"{name}, on", low, high, watched, settles_s), Step(f"{name}, back", high, low, watched, settles_s)


COPTER = Family(
    4,
    copter_rises,
    tell_velocity,
    (
        *both_ways("speed 0 to 5", (0, 0, 0, 0), (5, 0, 0, 0), "north", 8.0),
        *both_ways("speed 5 to 6", (5, 0, 0, 0), (6, 0, 0, 0), "north", 8.0),
        *both_ways("speed 5 to 5.3", (5, 0, 0, 0), (5.3, 0, 0, 0), "north", 8.0),
        *both_ways("0.5 sideways", (-5, 0, 0, 0), (-5, 0.5, 0, 0), "east", 8.0),
        *both_ways("climb 0 to 1", (0, 0, 0, 0), (0, 0, 1, 0), "up", 6.0),
        *both_ways("climb 0 to -1", (0, 0, 0, 0), (0, 0, -1, 0), "up", 6.0),
        *both_ways("climb 0 to 0.3", (0, 0, 0, 0), (0, 0, 0.3, 0), "up", 6.0),
        *both_ways("yaw by 90", (0, 0, 0, 0), (0, 0, 0, math.pi / 2), "heading", 8.0),
        *both_ways("yaw by 20", (0, 0, 0, 0), (0, 0, 0, 0.35), "heading", 8.0),
    ),
)
PLANE = Family(
    15,
    plane_rises,
    tell_flight,
    (
        *both_ways("speed 22 to 26", (22, 150, 0), (26, 150, 0), "airspeed", 30.0),
        *both_ways("speed 22 to 24", (22, 150, 0), (24, 150, 0), "airspeed", 30.0),
        *both_ways("speed 18 to 22", (18, 150, 0), (22, 150, 0), "airspeed", 35.0),
        *both_ways("height by 10", (22, 150, 0), (22, 160, 0), "height", 30.0),
        *both_ways("height by 30", (22, 150, 0), (22, 180, 0), "height", 30.0),
        *both_ways("heading by 20", (22, 150, 0), (22, 150, 0.35), "heading", 25.0),
        *both_ways("heading by 90", (22, 150, 0), (22, 150, math.pi / 2), "heading", 30.0),
    ),
)


def times_s(port: int, family: Family) -> dict[str, tuple[float, float]]:
    """Return the times of 63 % and 90 % of each step, for a vehicle that begins on the ground."""
    pilot = Pilot(port, family)
    with closing(pilot.link):
        while not pilot.ready:
            pilot.fly(1.0)
        pilot.fly(2.0)
        family.take_off(pilot)
        return {step.name: pilot.step(step) for step in family.steps}
