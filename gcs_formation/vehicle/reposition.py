"""A vehicle is commanded to fly to a position and circle or hover there."""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.messages.command import CommandInt
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.startup_step import Command
from gcs_formation.vehicle.telemetry import Telemetry

AS_USUAL: Final = -1.0
"""A speed that isn't changed."""


def fly_to_home(autopilot: Autopilot, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
    """Return MAV_CMD_DO_REPOSITION to a vehicle's home, at a height above the origin; empty if its home is unknown."""
    if seen.home_m is None:
        return ()
    lat_rad, lon_rad, above_sea_m = autopilot.origin.from_ned(*seen.home_m, -height_m)
    return (
        CommandInt(
            autopilot.system,
            m.MAV_COMP_ID_AUTOPILOT1,
            m.MAV_FRAME_GLOBAL_INT,
            m.MAV_CMD_DO_REPOSITION,
            param1=AS_USUAL,
            param2=m.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE,
            param4=math.nan,
            x=round(math.degrees(lat_rad) * 1e7),
            y=round(math.degrees(lon_rad) * 1e7),
            z=above_sea_m,
        ),
    )
