"""A vehicle of one's own: what the ground station asks of an ArduPlane, by pymavlink. See own_vehicle.yaml.

It answers TIMESYNC, parameters and commands, sends what it is asked for at the intervals that are commanded, and flies
three setpoints in GUIDED: speed, altitude and heading, by the machine's own clock, as a real autopilot does. Put your
own dynamics into `fly`, or your own autopilot in its place.
"""

import math
import time

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

SYSTEM, PORT = 3, 14553
LAT_DEG, LON_DEG, ALT_M, EARTH_M = 35.0, 125.0, 0.0, 6_378_137.0
MANUAL, TAKEOFF, GUIDED = 0, 13, 15
CRUISE_MPS, TAKE_OFF_TO_M = 22.0, 60.0
PARAMETERS = {
    "MAV_GCS_SYSID": 255,
    "FS_GCS_ENABL": 1,
    "FS_LONG_ACTN": 1,
    "FS_LONG_TIMEOUT": 5,
    "TKOFF_ALT": TAKE_OFF_TO_M,
    "AIRSPEED_MIN": 14,
    "AIRSPEED_MAX": 30,
    "AIRSPEED_CRUISE": CRUISE_MPS,
    "ROLL_LIMIT_DEG": 45,
}
HEALTHY = mavlink.MAV_SYS_STATUS_PREARM_CHECK
ESTIMATES = 0b11_1111_1111 & ~mavlink.EKF_CONST_POS_MODE  # attitude, velocity and position are known
TICK_S = 0.01


class Vehicle:
    """One fixed wing: its state, what it was commanded, and how often it sends what."""

    def __init__(self) -> None:
        """Stand on the ground, disarmed, 30 m behind and to the left of the leader."""
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{PORT}", source_system=SYSTEM, source_component=1)
        self.begun = time.monotonic()
        self.mode, self.armed = MANUAL, False
        self.north_m, self.east_m, self.height_m = -30.0, -30.0, 0.0
        self.speed_mps = self.heading_rad = self.climb_mps = 0.0
        self.commanded_mps, self.commanded_rad, self.commanded_m = CRUISE_MPS, 0.0, TAKE_OFF_TO_M
        self.interval_s = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
        self.sent_at = dict[int, float]()

    def fly(self, dt_s: float) -> None:
        """Follow the setpoints by first-order time constants."""
        if not self.armed or self.mode == MANUAL:
            return
        guided = self.mode == GUIDED
        speed_mps, height_m = (self.commanded_mps, self.commanded_m) if guided else (CRUISE_MPS, TAKE_OFF_TO_M)
        self.speed_mps += (speed_mps - self.speed_mps) / 4.0 * dt_s
        off_rad = math.remainder(self.commanded_rad - self.heading_rad, math.tau) if guided else 0.0
        self.heading_rad += max(-0.25, min(0.25, off_rad / 1.5)) * dt_s
        self.climb_mps = max(-3.0, min(3.0, (height_m - self.height_m) / 4.0))
        self.height_m += self.climb_mps * dt_s
        self.north_m += self.speed_mps * math.cos(self.heading_rad) * dt_s
        self.east_m += self.speed_mps * math.sin(self.heading_rad) * dt_s

    def take(self, message: mavlink.MAVLink_message) -> None:
        """Answer what the ground station sends."""
        kind, send = message.get_type(), self.link.mav
        if kind == "TIMESYNC" and message.tc1 == 0:
            send.timesync_send(int((time.monotonic() - self.begun) * 1e9), message.ts1)
        elif kind == "PARAM_REQUEST_READ" and message.param_id in PARAMETERS:
            value = PARAMETERS[message.param_id]
            send.param_value_send(message.param_id.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32, len(PARAMETERS), 0)
        elif kind in {"COMMAND_LONG", "COMMAND_INT"}:
            send.command_ack_send(message.command, self.obey(message))

    def obey(self, command: mavlink.MAVLink_message) -> int:
        """Carry out a command; return its result."""
        number = command.command
        if number == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.interval_s[int(command.param1)] = command.param2 * 1e-6
        elif number == mavlink.MAV_CMD_DO_SET_MODE:
            self.mode = int(command.param2)
        elif number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = command.param1 == 1.0
        elif number == mavlink.MAV_CMD_GUIDED_CHANGE_SPEED:
            self.commanded_mps = command.param2
        elif number == mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE:
            self.commanded_m = command.z - ALT_M
        elif number == mavlink.MAV_CMD_GUIDED_CHANGE_HEADING:
            self.commanded_rad = math.radians(command.param2)
        elif number != mavlink.MAV_CMD_DO_CHANGE_ALTITUDE:
            return mavlink.MAV_RESULT_UNSUPPORTED
        return mavlink.MAV_RESULT_ACCEPTED

    def send_what_is_due(self) -> None:
        """Send each message whose interval has passed."""
        now = time.monotonic()
        for number, interval_s in self.interval_s.items():
            if 0.0 < interval_s <= now - self.sent_at.get(number, -math.inf):
                self.sent_at[number] = now
                self.send(number, int((now - self.begun) * 1e3))

    def send(self, number: int, boot_ms: int) -> None:
        """Send a message by its number."""
        mav, course_rad = self.link.mav, math.remainder(self.heading_rad, math.tau)
        compass_deg, flies = math.degrees(course_rad) % 360.0, self.armed and self.height_m > 1.0
        north_mps, east_mps = self.speed_mps * math.cos(course_rad), self.speed_mps * math.sin(course_rad)
        if number == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (128 if self.armed else 0)
            state = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
            kind = mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
            mav.heartbeat_send(*kind, mode, self.mode, state)
        elif number == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT:
            lat_deg = LAT_DEG + math.degrees(self.north_m / EARTH_M * 1.0034)
            lon_deg = LON_DEG + math.degrees(self.east_m / (EARTH_M * math.cos(math.radians(LAT_DEG)) * 1.0011))
            height_mm, velocity = int(1e3 * self.height_m), (north_mps, east_mps, -self.climb_mps)
            place = int(1e7 * lat_deg), int(1e7 * lon_deg), int(1e3 * ALT_M) + height_mm, height_mm
            cmps = (int(100.0 * each) for each in velocity)
            mav.global_position_int_send(boot_ms, *place, *cmps, int(100.0 * compass_deg))
        elif number == mavlink.MAVLINK_MSG_ID_ATTITUDE:
            mav.attitude_send(boot_ms, 0.0, 0.0, course_rad, 0.0, 0.0, 0.0)
        elif number == mavlink.MAVLINK_MSG_ID_VFR_HUD:
            height_m = ALT_M + self.height_m
            mav.vfr_hud_send(self.speed_mps, self.speed_mps, int(compass_deg), 50, height_m, self.climb_mps)
        elif number == mavlink.MAVLINK_MSG_ID_SYS_STATUS:
            mav.sys_status_send(HEALTHY, HEALTHY, HEALTHY, 100, 12000, -1, 80, 0, 0, 0, 0, 0, 0)
        elif number == mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT:
            mav.ekf_status_report_send(ESTIMATES, 0.1, 0.1, 0.1, 0.1, 0.1)
        elif number == mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
            mav.extended_sys_state_send(
                0, mavlink.MAV_LANDED_STATE_IN_AIR if flies else mavlink.MAV_LANDED_STATE_ON_GROUND
            )


if __name__ == "__main__":
    vehicle, last = Vehicle(), time.monotonic()
    while True:
        now = time.monotonic()
        vehicle.fly(now - last)
        last = now
        while (received := vehicle.link.recv_msg()) is not None:
            vehicle.take(received)
        vehicle.send_what_is_due()
        time.sleep(TICK_S)
