"""Reads a PX4 log (.ulg): setpoints of its fixed-wing and multirotor controllers, and the responses to them.

Sources: in PX4's msg, TecsStatus, NpfgStatus, versioned/FixedWingLateralSetpoint, versioned/TrajectorySetpoint,
versioned/VehicleLocalPosition and their predecessors since 2017, whose names of fields are taken too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from flight_model.arrays import Array
from gcs_formation.identify.logs.track import HOVERING_SEEN, OVER_GROUND_SEEN, Log, Mode, Track, modes_of, spoken
from gcs_formation.record.ulog_file import ULogFile, read_ulog_file
from gcs_formation.vehicle.velocity_setpoint import HEIGHT_S

NAV_STATES: Final = {
    0: "MANUAL", 1: "ALTCTL", 2: "POSCTL", 3: "AUTO_MISSION", 4: "AUTO_LOITER", 5: "AUTO_RTL", 6: "POSITION_SLOW",
    10: "ACRO", 12: "DESCEND", 13: "TERMINATION", 14: "OFFBOARD", 15: "STAB", 17: "AUTO_TAKEOFF", 18: "AUTO_LAND",
    19: "AUTO_FOLLOW_TARGET", 20: "AUTO_PRECLAND", 21: "ORBIT", 22: "AUTO_VTOL_TAKEOFF",
}  # fmt: skip
"""Of msg/versioned/VehicleStatus.msg."""
FLOWN_BY_ITSELF: Final = frozenset({"AUTO_MISSION", "AUTO_LOITER", "AUTO_RTL", "AUTO_TAKEOFF", "OFFBOARD", "ORBIT"})
POSITIONED: Final = FLOWN_BY_ITSELF | {"POSCTL", "POSITION_SLOW", "AUTO_FOLLOW_TARGET"}
TOPICS: Final = (
    "vehicle_status", "tecs_status", "fixed_wing_lateral_setpoint", "npfg_status", "position_controller_status",
    "trajectory_setpoint", "vehicle_local_position_setpoint", "vehicle_local_position", "airspeed_validated",
    "airspeed",
)  # fmt: skip
SETPOINTS: Final = TOPICS[1:7]
HEIGHT_SETPOINTS: Final = ("altitude_sp", "altitudeSp", "altitude_reference")
AIRSPEED_SETPOINTS: Final = ("true_airspeed_sp", "airspeed_sp", "airspeedSp")
AIRSPEEDS: Final = (
    ("tecs_status", ("true_airspeed_filtered", "airspeed_filtered", "airspeedFiltered")),
    ("airspeed_validated", ("true_airspeed_m_s",)),
    ("airspeed", ("true_airspeed_m_s",)),
)
BEARINGS: Final = (
    ("fixed_wing_lateral_setpoint", "course"), ("npfg_status", "bearing"),
    ("position_controller_status", "nav_bearing"),
)  # fmt: skip
WINGS_IDENTIFY: Final = (
    "height as TECS received it; airspeed (true) within its limits, before their rates; heading: how the guidance "
    "turns the course to its bearing"
)
TRAJECTORY_IDENTIFIES: Final = (
    "what PX4's trajectory generator, or OFFBOARD, commands its position controller: of a generated trajectory, limits "
    "of acceleration and jerk are no part of the time constants"
)
CONTROLLER_IDENTIFIES: Final = (
    "behind the position controller, whose answer to position errors is in the setpoints: how the velocity controller "
    "follows, which is quicker than the whole autopilot"
)
WANTED: Final = (
    "30 s or more of a fixed wing in a mission, hold, return or OFFBOARD with tecs_status, npfg_status (or "
    "fixed_wing_lateral_setpoint, position_controller_status) and vehicle_local_position; or of a multirotor in any "
    "mode that controls its velocity, with trajectory_setpoint or vehicle_local_position_setpoint, and "
    "vehicle_local_position"
)

Table = Mapping[str, Array]


def read_ulog(log: Path) -> Log:
    """Return the tracks of a PX4 log.

    Raises:
        OSError: it can't be read.
        ValueError: it isn't such a log.
    """
    file = read_ulog_file(log, TOPICS)
    modes = _modes(file)
    tracks = [each for each in (_wings(file), *_rotors(file)) if each is not None]
    for track in tracks:
        track.system, track.modes = int(file.parameters.get("MAV_SYS_ID", 1.0)), modes
    return Log(tracks, f"no vehicle under setpoints ({_found(file, modes)})", WANTED)


def _modes(file: ULogFile) -> list[Mode]:
    status = file.topics.get("vehicle_status", {})
    if "nav_state" not in status:
        return []
    states = zip(status["at_s"].tolist(), status["nav_state"].tolist(), strict=True)
    return modes_of((at_s, NAV_STATES.get(int(state), f"nav_state {state:.0f}")) for at_s, state in states)


def _found(file: ULogFile, modes: Sequence[Mode]) -> str:
    end_s = max((float(table["at_s"].max()) for table in file.topics.values()), default=0.0)
    there = ", ".join(name for name in TOPICS if name in file.topics) or "none of those that are read"
    lacks = ", ".join(name for name in SETPOINTS if name not in file.topics)
    return f"PX4, {spoken(modes, end_s) or 'no mode'}, topics {there}; without {lacks or 'none'}"


def _column(table: Table, names: Sequence[str]) -> Array | None:
    return next((table[name] for name in names if name in table), None)


def _put_motion(track: Track, position: Table) -> None:
    """Put course, ground speed, height above the estimator's origin, and climb."""
    at_s = position["at_s"]
    track.put("course", at_s, np.arctan2(position["vy"], position["vx"]))
    track.put("speed seen", at_s, np.hypot(position["vx"], position["vy"]))
    track.put("alt", at_s, -position["z"])
    track.put("climb", at_s, -position["vz"])


def _wings(file: ULogFile) -> Track | None:
    """Return what a fixed wing's total-energy control and guidance follow."""
    tecs, position = file.topics.get("tecs_status"), file.topics.get("vehicle_local_position")
    if tecs is None or position is None:
        return None
    track = Track(1, "tecs_status and the guidance's bearing", WINGS_IDENTIFY, "px4", OVER_GROUND_SEEN)
    track.follows = FLOWN_BY_ITSELF
    _put_motion(track, position)
    if "ref_alt" in position:
        track.put("alt", position["at_s"], position["ref_alt"] - position["z"])
    for name, columns in (("height", HEIGHT_SETPOINTS), ("speed", AIRSPEED_SETPOINTS)):
        found = _column(tecs, columns)
        if found is not None:
            track.put(name, tecs["at_s"], found)
    for topic, names in AIRSPEEDS:
        table = file.topics.get(topic, {})
        seen = _column(table, names)
        if seen is not None and np.ptp(seen) > 0.0:
            track.put("airspeed", table["at_s"], seen)
            break
    for topic, column in BEARINGS:
        if column in (table := file.topics.get(topic, {})):
            track.put("heading", table["at_s"], table[column])
            break
    return track


def _rotors(file: ULogFile) -> list[Track]:
    """Return what a multirotor's position controller receives, and what its velocity controller follows."""
    position, found = file.topics.get("vehicle_local_position"), list[Track]()
    if position is None:
        return found
    commanded = (
        ("trajectory_setpoint", TRAJECTORY_IDENTIFIES),
        ("vehicle_local_position_setpoint", CONTROLLER_IDENTIFIES),
    )
    for topic, identifies in commanded:
        table = file.topics.get(topic)
        velocity = [] if table is None else [_column(table, names) for names in _fields("velocity", "v")]
        if table is None or any(each is None for each in velocity):
            continue
        track = Track(1, topic, identifies, "px4_copter", HOVERING_SEEN, follows=POSITIONED)
        _put_motion(track, position)
        north, east, down = (np.asarray(each, dtype=np.float64) for each in velocity)
        track.put("speed", table["at_s"], np.hypot(north, east))
        track.put("heading", table["at_s"], np.arctan2(east, north))
        track.put("height", table["at_s"], _height(table, position, down))
        found.append(track)
    return found


def _fields(array: str, letter: str) -> list[tuple[str, str]]:
    """Return the names of a vector's components, of today and earlier."""
    return [(f"{array}[{index}]", f"{letter}{axis}") for index, axis in enumerate("xyz")]


def _height(table: Table, position: Table, down_mps: Array) -> Array:
    """Return height setpoints; where only the vertical velocity is set, they are where that leads."""
    height = _column(table, _fields("position", "")[2])
    seen = np.interp(table["at_s"], position["at_s"], position["z"])
    led = seen + HEIGHT_S * down_mps
    return -led if height is None else -np.where(np.isfinite(height), height, led)
