"""PX4's parameters on which a fixed wing's flight in formation depends.

Source: PX4 user guide, "Parameter Reference" and "Safety Configuration (Failsafes)".
"""

from __future__ import annotations

import struct

from airlink import mavlink as m
from airlink.messages.parameter import ParamValue
from gcs_formation.vehicle.checks import Check, Demands, envelope_checks

LEADS_AWAY = (1, 2, 3)
"""NAV_DLL_ACT: hold, return, land; 0 does nothing, 5 and 6 stop the motor."""
LARGEST_CIRCLE_M = 100.0
"""Radius for which circles at the end are kept apart, and beyond which a place 400 m ahead is no course."""


def px4_value(told: ParamValue) -> float:
    """Return a parameter's value: PX4 sends the bytes of an integer in the place of a float's."""
    if told.param_type != m.MAV_PARAM_TYPE_INT32:
        return told.param_value
    return float(struct.unpack("<i", struct.pack("<f", told.param_value))[0])


def px4_plane_checks(asked: Demands) -> tuple[Check, ...]:
    """Return what to read from a fixed-wing PX4 of which a scenario asks this much."""
    return (
        Check(
            ("NAV_DLL_ACT",),
            "1 (hold), 2 (return) or 3 (land) when our heartbeats stop; with 0 it circles where the last setpoint led",
            lambda value: value in LEADS_AWAY,
        ),
        *envelope_checks(
            asked, "FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_AIRSPD_TRIM", "FW_R_LIM", ("raised to it", "lowered to it")
        ),
        Check(
            ("NAV_LOITER_RAD",),
            f"up to {LARGEST_CIRCLE_M:g} m; wider circles may meet, and bend the course",
            lambda value: abs(value) <= LARGEST_CIRCLE_M,
        ),
    )
