# Compiled by mypyc: it runs every tick.

"""Parameters of an emulated ArduPlane, by their present names or those of older versions."""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from flight_model.energy import GRAVITY_MPS2
from sim_vehicles.autopilot.parameters import (
    LOITER_RADIUS_M,
    SYSTEM_NAMES,
    ParameterKind,
    ParameterServer,
    as_in_file,
    fence_parameters,
    floating,
)
from sim_vehicles.config import STATION_SYSTEM, VehicleConfig

WIDER_THAN_TIGHTEST = 1.3
"""Least radius of circles, as a multiple of the radius of the tightest turn."""
ROLL_LIMIT_DEG = 45.0
OLDER_NAMES: Final = {
    "AIRSPEED_CRUISE": ("TRIM_ARSPD_CM", 0.01),
    "AIRSPEED_MAX": ("ARSPD_FBW_MAX", 1.0),
    "AIRSPEED_MIN": ("ARSPD_FBW_MIN", 1.0),
    "MAV_GCS_SYSID": ("SYSID_MYGCS", 1.0),
    "MAV_SYSID": ("SYSID_THISMAV", 1.0),
    "ROLL_LIMIT_DEG": ("LIM_ROLL_CD", 0.01),
    "RTL_ALTITUDE": ("ALT_HOLD_RTL", 0.01),
}
"""Names that parameters had before 4.5 to 4.7, and their units then, by the present names."""


def plane_parameters(config: VehicleConfig, cruise_mps: float, station_system: int = STATION_SYSTEM) -> ParameterServer:
    """Return ArduPlane's parameters for a vehicle; those of an older version if a parameter file has its names."""
    kinds, file = _defaults(config, cruise_mps, station_system), config.parameters
    older = {name: own for name, own in OLDER_NAMES.items() if own[0] in file and name not in file}
    for name, (own, unit) in older.items():
        kind = kinds.pop(name)
        kinds[own] = ParameterKind(kind.type, kind.minimum / unit, kind.maximum / unit, kind.initial / unit)
    return ParameterServer(as_in_file(kinds, file, SYSTEM_NAMES), older)


def _defaults(config: VehicleConfig, cruise_mps: float, station_system: int) -> dict[str, ParameterKind]:
    model = config.model
    bank_deg = math.degrees(math.atan(model.speed_max_mps * model.turn_rate_max_rps / GRAVITY_MPS2))
    radius_m = math.ceil(max(LOITER_RADIUS_M, WIDER_THAN_TIGHTEST * (cruise_mps / model.turn_rate_max_rps)))
    return {
        "AIRSPEED_CRUISE": floating(5, 1000, cruise_mps),
        "AIRSPEED_MAX": ParameterKind(m.MAV_PARAM_TYPE_INT16, 5, 1000, math.ceil(model.speed_max_mps)),
        "AIRSPEED_MIN": ParameterKind(m.MAV_PARAM_TYPE_INT16, 5, 1000, math.floor(model.speed_min_mps)),
        "ARMING_CHECK": ParameterKind(m.MAV_PARAM_TYPE_INT32, 0, 2**24, 1),
        "AUTOLAND_WP_ALT": ParameterKind(m.MAV_PARAM_TYPE_INT16, 10, 32767, 55),
        "AUTOLAND_WP_DIST": ParameterKind(m.MAV_PARAM_TYPE_INT16, 100, 32767, 400),
        **fence_parameters(4),
        "FS_GCS_ENABL": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 0),
        "FS_LONG_ACTN": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 0),
        "FS_LONG_TIMEOUT": floating(1, 1e6, 5),
        "LAND_DISARMDELAY": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 20),
        "MAV_GCS_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, station_system),
        "MAV_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, config.identity.system),
        "ROLL_LIMIT_DEG": floating(0, 90, max(ROLL_LIMIT_DEG, math.ceil(bank_deg))),
        "RTL_ALTITUDE": floating(-1, 1e5, 100),
        "TECS_CLMB_MAX": floating(0.1, 20, max(5.0, model.climb_max_mps)),
        "TECS_SINK_MAX": floating(0.0, 20, max(5.0, model.climb_max_mps)),
        "TKOFF_ALT": ParameterKind(m.MAV_PARAM_TYPE_INT16, 0, 32767, 50),
        "WP_LOITER_RAD": ParameterKind(m.MAV_PARAM_TYPE_INT16, -32767, 32767, radius_m),
        "WP_RADIUS": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 32767, 90),
    }
