"""The commands that an emulated ArduCopter carries out.

Source: ArduPilot documentation, "Copter Commands in Guided Mode"; answers of ArduCopter 4.7, and what it flew by them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from airlink import mavlink as m
from flight_model.autopilot_model import finite, wrap
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.commands import ACCEPTED, DEGREE, DENIED, FAILED, FULL_TURN_DEG, GivenCommand, to_mode
from sim_vehicles.autopilot.modes import CopterMode

if TYPE_CHECKING:
    from sim_vehicles.copter import Copter

CM: Final = 100.0
SLEW_RPS: Final = math.radians(60.0)
"""Rate at which its nose comes round where none is told, and the highest (ATC_SLEW_YAW)."""
SPEEDS: Final = {
    m.SPEED_TYPE_AIRSPEED: "WPNAV_SPEED",
    m.SPEED_TYPE_GROUNDSPEED: "WPNAV_SPEED",
    m.SPEED_TYPE_CLIMB_SPEED: "WPNAV_SPEED_UP",
    m.SPEED_TYPE_DESCENT_SPEED: "WPNAV_SPEED_DN",
}
"""SPEED_TYPE -> the parameter that DO_CHANGE_SPEED stands in for."""
LIKE_PLANES: Final = (
    m.MAV_CMD_DO_SET_MODE,
    m.MAV_CMD_COMPONENT_ARM_DISARM,
    m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
    m.MAV_CMD_DO_REPOSITION,
    m.MAV_CMD_GET_MESSAGE_INTERVAL,
    m.MAV_CMD_SET_MESSAGE_INTERVAL,
    m.MAV_CMD_REQUEST_MESSAGE,
    m.MAV_CMD_GET_HOME_POSITION,
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
)


def _take_off(vehicle: Copter, given: GivenCommand) -> int:
    """Take off to a height above home, which no other frame gives."""
    if given.frame != m.MAV_FRAME_GLOBAL_RELATIVE_ALT:
        return DENIED
    return ACCEPTED if vehicle.take_off(given.z) else FAILED


def _turn_nose(vehicle: Copter, given: GivenCommand) -> int:
    """Turn the nose to a direction or by an angle; in other modes than GUIDED that is accepted and has no effect."""
    degrees, rate_dps, direction, relative = given.params
    if (
        not 0.0 <= degrees <= FULL_TURN_DEG
        or relative not in (0.0, 1.0)
        or not (finite(rate_dps) and finite(direction))
    ):
        return FAILED
    angle_rad, nose_rad = degrees * DEGREE, vehicle.nose_rad
    by_rad = angle_rad if direction > -1.0 else -angle_rad
    if not relative:
        by_rad = wrap(angle_rad - nose_rad)
        if abs(direction) >= 1.0 and by_rad * direction < 0.0:
            by_rad += math.copysign(math.tau, direction)
    if vehicle.guided:
        vehicle.flier.turn(nose_rad, by_rad, min(rate_dps * DEGREE, SLEW_RPS) if rate_dps > 0.0 else SLEW_RPS)
    return ACCEPTED


def _look(vehicle: Copter, given: GivenCommand) -> int:
    """Turn the nose to a place, and keep it there; likewise."""
    if vehicle.guided:
        north_m, east_m, _ = vehicle.fleet.origin.to_ned(given.lat_rad, given.lon_rad, 0.0)
        vehicle.flier.look_at((north_m, east_m))
    return ACCEPTED


def _look_ahead(vehicle: Copter, _given: GivenCommand) -> int:
    vehicle.flier.look_at(None)
    return ACCEPTED


def _change_speed(vehicle: Copter, given: GivenCommand) -> int:
    """Change the speed to places under way, until it is told velocities or another mode."""
    kind, speed_mps = given.params[0], given.params[1]
    if not 0.0 < speed_mps < math.inf:
        return DENIED
    if kind not in SPEEDS or vehicle.pilot.mode not in (CopterMode.GUIDED, CopterMode.RTL, CopterMode.SMART_RTL):
        return FAILED
    vehicle.flier.told_cmps[SPEEDS[int(kind)]] = CM * speed_mps
    return ACCEPTED


def _pause(vehicle: Copter, given: GivenCommand) -> int:
    """Stand until it is told to go on."""
    goes_on = given.params[0]
    if goes_on not in (0.0, 1.0):
        return DENIED
    if not vehicle.guided:
        vehicle.say(m.MAV_SEVERITY_INFO, "Failed to resume" if goes_on else "Failed to pause")
        return FAILED
    vehicle.flier.paused = not goes_on
    if vehicle.flier.paused:
        vehicle.flier.stand()
    return ACCEPTED


def _choose_item(vehicle: Copter, given: GivenCommand) -> int:
    if given.params[0] == 0.0 and not vehicle.missions.flyable:
        return FAILED
    return commands.HANDLERS[m.MAV_CMD_DO_SET_MISSION_CURRENT](vehicle, given)


HANDLERS: dict[int, Callable[[Any, GivenCommand], int]] = {
    **{command: commands.HANDLERS[command] for command in LIKE_PLANES},
    m.MAV_CMD_NAV_TAKEOFF: _take_off,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: to_mode(CopterMode.RTL),
    m.MAV_CMD_NAV_LAND: to_mode(CopterMode.LAND),
    m.MAV_CMD_NAV_LOITER_UNLIM: to_mode(CopterMode.LOITER),
    m.MAV_CMD_MISSION_START: to_mode(CopterMode.AUTO),
    m.MAV_CMD_CONDITION_YAW: _turn_nose,
    m.MAV_CMD_DO_SET_ROI_LOCATION: _look,
    m.MAV_CMD_DO_SET_ROI_NONE: _look_ahead,
    m.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    m.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    m.MAV_CMD_DO_SET_MISSION_CURRENT: _choose_item,
}
"""All others are UNSUPPORTED, as MAV_CMD_GUIDED_CHANGE_SPEED and its like are by a real one."""
