"""The modes of an emulated ArduCopter, its failsafe's actions and its parameters: what differs from ArduPlane's tables.

Source: ArduPilot documentation, "Flight Modes", "GCS Failsafe" and "Complete Parameter List"; its simulator's defaults.
"""

from __future__ import annotations

import math

from airlink import mavlink as m
from sim_vehicles.autopilot.modes import CopterMode, FailsafeKeys
from sim_vehicles.autopilot.parameters import Kind
from sim_vehicles.config import VehicleConfig

BY_THROTTLE = frozenset({CopterMode.STABILIZE, CopterMode.ALT_HOLD, CopterMode.LOITER, CopterMode.POSHOLD})
"""Modes in which a transmitter's throttle sets the climb; there is none, and without it they sink."""
NOT_ARMABLE = frozenset({CopterMode.RTL, CopterMode.LAND, CopterMode.BRAKE, CopterMode.AUTO})
ACTIONS = dict.fromkeys((1, 2, 3, 4, 6), CopterMode.RTL) | {5: CopterMode.LAND, 7: CopterMode.BRAKE}
"""FS_GCS_ENABLE: RTL, also for SmartRTL and AUTO, which have nothing to go by; LAND; BRAKE."""
FAILSAFE = FailsafeKeys("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_GCS_ENABLE", ACTIONS)


def _floating(least: float, most: float) -> Kind:
    return Kind(m.MAV_PARAM_TYPE_REAL32, least, most)


KINDS: dict[str, Kind] = {
    "ARMING_CHECK": Kind(m.MAV_PARAM_TYPE_INT32, 0, 2**24),
    "DISARM_DELAY": Kind(m.MAV_PARAM_TYPE_INT8, 0, 127),
    "FS_GCS_ENABLE": Kind(m.MAV_PARAM_TYPE_INT8, 0, 7),
    "FS_GCS_TIMEOUT": _floating(2, 120),
    "GUID_TIMEOUT": _floating(0.1, 5),
    "LAND_SPEED": Kind(m.MAV_PARAM_TYPE_INT16, 30, 200),
    "MAV_GCS_SYSID": Kind(m.MAV_PARAM_TYPE_INT16, 1, 255),
    "MAV_SYSID": Kind(m.MAV_PARAM_TYPE_INT16, 1, 255),
    "RTL_ALT": Kind(m.MAV_PARAM_TYPE_INT32, 30, 300000),
    "WPNAV_ACCEL": _floating(50, 500),
    "WPNAV_SPEED": _floating(10, 2000),
    "WPNAV_SPEED_DN": _floating(10, 500),
    "WPNAV_SPEED_UP": _floating(10, 1000),
}


def initial_values(config: VehicleConfig) -> dict[str, float]:
    """Return the initial parameters of a multirotor, in ArduCopter's cm."""
    model = config.model
    return {
        "ARMING_CHECK": 1,
        "DISARM_DELAY": 10,
        "FS_GCS_ENABLE": 0,
        "FS_GCS_TIMEOUT": 5,
        "GUID_TIMEOUT": 3,
        "LAND_SPEED": 50,
        "MAV_GCS_SYSID": 255,
        "MAV_SYSID": config.identity.system,
        "RTL_ALT": 1500,
        "WPNAV_ACCEL": math.ceil(100 * model.accel_max_mps2),
        "WPNAV_SPEED": max(1000, math.ceil(100 * model.speed_max_mps)),
        "WPNAV_SPEED_DN": 150,
        "WPNAV_SPEED_UP": 250,
    }
