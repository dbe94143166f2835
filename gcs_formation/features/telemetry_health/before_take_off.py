"""What a vehicle's telemetry says while it stands on the ground, where most of it is known: nothing moves, it's level.

A field that isn't filled, has another sign or datum, or is in another unit is found here before anybody takes off. What
only shows in motion, such as a sign of the climb, is found in flight: by `consistency`.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import wrap
from gcs_formation.mission.gate import AsFound
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Finding
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.telemetry import AIRBORNE_M, Telemetry

BANK_RAD: Final = math.radians(25.0)
PITCH_RAD: Final = math.radians(45.0)
"""Largest bank and pitch on the ground: uneven ground, a tail wheel (some 15 degrees) and a ramp (some 30)."""
HEADING_OFF_RAD: Final = math.radians(20.0)
"""Largest difference between headings of three messages, which autopilots fill from one estimate."""
DRIFT_MPS: Final = 3.0
"""Largest speed on the ground, level or vertical: what a GNSS receiver says with few satellites."""
DATUM_M: Final = 10.0
"""Largest difference of a home's heights by two messages."""
MOVED_S: Final = 1.0
"""Positions this far apart in time tell a speed."""
SPEED_OFF_MPS: Final = 5.0
"""Largest difference between that speed and the velocities', in the air."""


def findings(found: AsFound) -> list[Finding]:
    """Return what a vehicle's telemetry says that can't be true. In the air findings don't refuse."""
    autopilot, seen, flies = found.autopilot, found.seen, found.flies
    motion = seen.motion
    if motion is None:
        return []
    moved = _moved(found.first, motion, flies=flies)
    datum = _datum(seen, motion)
    if flies:
        return [Finding(text) for text in (moved, datum) if text]
    still = (
        _height(motion),
        _still(motion),
        *_attitude(autopilot, seen, motion),
        _airspeed(autopilot, seen, found.min_mps),
    )
    return [Finding(text, refuses=True) for text in (moved, datum, *still) if text]


def _moved(first: ReportedMotion, motion: ReportedMotion, *, flies: bool) -> str:
    """Return whether the position has moved otherwise than the velocity says."""
    elapsed_s = motion.stamp_s - first.stamp_s
    if elapsed_s < MOVED_S or (elapsed_s > 2.0 * MOVED_S and flies):  # it may have turned meanwhile
        return ""
    moved = (motion.north_m - first.north_m, motion.east_m - first.east_m, motion.height_m - first.height_m)
    rates = (
        (first.north_mps, motion.north_mps),
        (first.east_mps, motion.east_mps),
        (first.climb_mps, motion.climb_mps),
    )
    off = [by / elapsed_s - sum(rate) / 2.0 for by, rate in zip(moved, rates, strict=True)]
    if math.hypot(*off[:2]) <= SPEED_OFF_MPS and abs(off[2]) <= SPEED_OFF_MPS:
        return ""
    north, east, up = (each / elapsed_s for each in moved)
    by = f"vx {motion.north_mps:.1f}, vy {motion.east_mps:.1f}, vz {0.0 - motion.climb_mps:.1f} m/s"
    while_moving = f"while its position moves by {north:.1f}, {east:.1f}, {0.0 - up:.1f} m/s"
    mends = "Check what fills vx, vy and vz: north, east and down over ground, in cm/s"
    return f"GLOBAL_POSITION_INT: found {by} {while_moving}; allowed: {SPEED_OFF_MPS:g} m/s off. {mends}"


def _datum(seen: Telemetry, motion: ReportedMotion) -> str:
    """Return whether alt and relative_alt are above another home than HOME_POSITION's."""
    home_m, by_position_m = seen.home_height_m, motion.height_m - motion.above_home_m
    if not abs(home_m - by_position_m) > DATUM_M:
        return ""
    above_m = motion.height_m - home_m
    found = f"relative_alt: found {motion.above_home_m:.0f} m, where alt is {above_m:.0f} m above HOME_POSITION's"
    mends = "Set home again (MAV_CMD_DO_SET_HOME), or make what fills alt and HOME_POSITION use one datum"
    return f"{found} altitude; allowed: {DATUM_M:g} m off. {mends}: both above mean sea level"


def _height(motion: ReportedMotion) -> str:
    above_m = motion.above_home_m
    if abs(above_m) <= AIRBORNE_M:
        return ""
    found = f"relative_alt: found {above_m:.0f} m above home while it stands disarmed"
    return f"{found}; allowed: {AIRBORNE_M:g} m off. Set home where it stands (MAV_CMD_DO_SET_HOME), or restart it"


def _still(motion: ReportedMotion) -> str:
    level_mps = math.hypot(motion.north_mps, motion.east_mps)
    if level_mps <= DRIFT_MPS and abs(motion.climb_mps) <= DRIFT_MPS:
        return ""
    found = f"vx, vy: found {level_mps:.1f} m/s over ground, vz {0.0 - motion.climb_mps:.1f} m/s, while it stands"
    mends = "Wait for a better GNSS fix, or check what fills them: north, east and down, in cm/s"
    return f"{found} disarmed; allowed: {DRIFT_MPS:g} m/s. {mends}"


def _attitude(autopilot: Autopilot, seen: Telemetry, motion: ReportedMotion) -> list[str]:
    attitude = seen.attitude
    if attitude is None:
        return []
    found = list[str]()
    for name, angle_rad, max_rad in (("roll", attitude.roll_rad, BANK_RAD), ("pitch", attitude.pitch_rad, PITCH_RAD)):
        if abs(angle_rad) > max_rad:
            stands = f"ATTITUDE.{name}: found {math.degrees(angle_rad):.0f} degrees while it stands disarmed"
            mends = f"Level it, or set {autopilot.mounting_parameter} as it is mounted; angles are told in radians"
            found.append(f"{stands}; allowed: {math.degrees(max_rad):.0f} degrees. {mends}")
    others = ("GLOBAL_POSITION_INT.hdg", motion.heading_rad), ("VFR_HUD.heading", seen.hud_heading_rad)
    for name, heading_rad in others:
        if abs(wrap(heading_rad - attitude.yaw_rad)) > HEADING_OFF_RAD:
            yaw, heading = (math.degrees(each) % 360.0 for each in (attitude.yaw_rad, heading_rad))
            off = f"ATTITUDE.yaw: found {yaw:.0f} degrees, where {name} is {heading:.0f}"
            mends = "Check the compass, and what fills both: clockwise from north"
            found.append(f"{off}; allowed: {math.degrees(HEADING_OFF_RAD):.0f} degrees off. {mends}")
    return found


def _airspeed(autopilot: Autopilot, seen: Telemetry, min_mps: float) -> str:
    if autopilot.hovers or not seen.airspeed_mps >= min_mps:
        return ""
    found = f"VFR_HUD.airspeed: found {seen.airspeed_mps:.1f} m/s while it stands disarmed"
    allowed = f"less than {min_mps:g} m/s, its model's speed_min_mps"
    mends = "Calibrate the sensor out of the wind (MAV_CMD_PREFLIGHT_CALIBRATION)"
    return f"{found}; allowed: {allowed}. {mends}"
