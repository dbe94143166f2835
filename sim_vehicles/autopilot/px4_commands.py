"""The commands that an emulated PX4 carries out.

Source: MAVLink common message set, "MAV_CMD"; PX4 user guide, "Flight Modes";
what PX4's simulator (SIH, version 1.17, development) answers, refuses and begins with.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from airlink import mavlink as m
from airlink.messages.command import MessageInterval
from sim_vehicles.autopilot import commands, telemetry
from sim_vehicles.autopilot.commands import ACCEPTED, DENIED, FAILED, UNSUPPORTED, GivenCommand, to_mode
from sim_vehicles.autopilot.modes_and_failsafe import Px4Mode
from sim_vehicles.autopilot.px4_messages import BUILDERS

if TYPE_CHECKING:
    from sim_vehicles.px4 import Px4

REJECTED: Final = m.MAV_RESULT_TEMPORARILY_REJECTED
LEAST_CHANGES_US: Final = 500_000
"""CURRENT_MODE comes with each change, and this often otherwise, however often it is asked for."""


def _set_mode(vehicle: Px4, given: GivenCommand) -> int:
    main, sub = given.params[1], given.params[2]
    if not int(given.params[0]) & m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED or not (main % 1 == 0.0 and sub % 1 == 0.0):
        return REJECTED
    return ACCEPTED if vehicle.switch(int(main) << 16 | int(sub) << 24) else REJECTED


def _arm_disarm(vehicle: Px4, given: GivenCommand) -> int:
    force = given.params[1] == commands.FORCE
    granted = vehicle.arm(force=force) if given.params[0] == 1.0 else vehicle.disarm(force=force)
    return ACCEPTED if granted else REJECTED


def _take_off(vehicle: Px4, given: GivenCommand) -> int:
    height_m = given.z - vehicle.fleet.origin.alt_m if math.isfinite(given.z) else vehicle.parameters["MIS_TAKEOFF_ALT"]
    return ACCEPTED if vehicle.prepare(height_m) else REJECTED


def _reposition(vehicle: Px4, given: GivenCommand) -> int:
    if given.params[1] != m.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE:
        return UNSUPPORTED
    if not vehicle.switch(Px4Mode.HOLD):
        return REJECTED
    vehicle.go_to(given.lat_rad, given.lon_rad, given.z - vehicle.fleet.origin.alt_m, given.params[0])
    return ACCEPTED


def _change_speed(vehicle: Px4, given: GivenCommand) -> int:
    """Change the speed; in OFFBOARD that is accepted and has no effect, as is what is no speed."""
    if vehicle.mode is Px4Mode.HOLD and 0.0 < given.params[1] < math.inf:
        vehicle.change_speed(given.params[1])
    return ACCEPTED


def _change_altitude(vehicle: Px4, given: GivenCommand) -> int:
    """Hold, at an altitude above sea level; at the one that it has where that is none."""
    if not vehicle.switch(Px4Mode.HOLD):
        return REJECTED
    if math.isfinite(given.params[0]):
        vehicle.change_height(given.params[0] - vehicle.fleet.origin.alt_m)
    return ACCEPTED


def _start_mission(vehicle: Px4, _given: GivenCommand) -> int:
    vehicle.say(m.MAV_SEVERITY_CRITICAL, "Mission start denied! No valid mission")
    return DENIED


def _set_interval(vehicle: Px4, given: GivenCommand) -> int:
    """Set a message's interval; HEARTBEAT's is fixed, and FAILED is also the answer for what isn't known.

    A shorter one than the main loop's is taken, but in each loop a message is sent once.
    """
    message_id, interval_us = given.params[0], given.params[1]
    if message_id == m.MAVLINK_MSG_ID_HEARTBEAT or message_id not in BUILDERS or not math.isfinite(interval_us):
        return FAILED
    if message_id == m.MAVLINK_MSG_ID_CURRENT_MODE and interval_us > 0.0:
        interval_us = max(interval_us, LEAST_CHANGES_US)
    elif interval_us > 0.0:
        interval_us = max(interval_us, telemetry.SHORTEST_US)
    return ACCEPTED if vehicle.streams.set_interval(int(message_id), interval_us, vehicle.now) else DENIED


def _get_interval(vehicle: Px4, given: GivenCommand) -> int:
    """Tell a message's interval: of one that it doesn't know, that it isn't streamed."""
    if not 0.0 <= given.params[0] <= commands.HIGHEST_MESSAGE_ID:
        return DENIED
    message_id = int(given.params[0])
    vehicle.answer(MessageInterval(message_id, vehicle.streams.interval_us(message_id)))
    return ACCEPTED


def _request_message(vehicle: Px4, given: GivenCommand) -> int:
    """Send a message once; what it doesn't know is DENIED."""
    return commands.HANDLERS[m.MAV_CMD_REQUEST_MESSAGE](vehicle, given) if given.params[0] in BUILDERS else DENIED


UNHEEDED: Final = (
    m.MAV_CMD_DO_SET_ROI_LOCATION,
    m.MAV_CMD_DO_SET_ROI_NONE,
    m.MAV_CMD_DO_SET_ROI,
    m.MAV_CMD_DO_GO_AROUND,
    m.MAV_CMD_RUN_PREARM_CHECKS,
    m.MAV_CMD_REQUEST_PROTOCOL_VERSION,
)
"""Accepted without an effect here: of a camera, a landing's approach, checks, and a version that few ask for."""
HANDLERS: dict[int, Callable[[Any, GivenCommand], int]] = {
    **dict.fromkeys(UNHEEDED, lambda _vehicle, _given: ACCEPTED),
    m.MAV_CMD_DO_SET_MODE: _set_mode,
    m.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    m.MAV_CMD_NAV_TAKEOFF: _take_off,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: to_mode(Px4Mode.RTL, REJECTED),
    m.MAV_CMD_NAV_LAND: to_mode(Px4Mode.LAND, REJECTED),
    m.MAV_CMD_DO_REPOSITION: _reposition,
    m.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    m.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    m.MAV_CMD_REQUEST_MESSAGE: _request_message,
    m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: commands.reboot(DENIED),
    m.MAV_CMD_GET_HOME_POSITION: commands.HANDLERS[m.MAV_CMD_GET_HOME_POSITION],
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: commands.HANDLERS[m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES],
    m.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    m.MAV_CMD_DO_CHANGE_ALTITUDE: _change_altitude,
    m.MAV_CMD_MISSION_START: _start_mission,
}
"""All others are UNSUPPORTED."""
