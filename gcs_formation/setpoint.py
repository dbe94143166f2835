"""The setpoint of one vehicle, and where it acts."""

from typing import NamedTuple


class Setpoint(NamedTuple):
    """Airspeed, heading (clockwise from north) and height above the scenario's origin."""

    speed_mps: float
    heading_rad: float
    height_m: float


class Whereabouts(NamedTuple):
    """Where a vehicle is when a setpoint acts, and the wind there: north and east of the scenario's origin."""

    north_m: float
    east_m: float
    wind_north_mps: float
    wind_east_mps: float
