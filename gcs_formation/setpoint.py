"""The setpoint of one vehicle."""

from typing import NamedTuple


class Setpoint(NamedTuple):
    """Airspeed, heading (clockwise from north) and height above the scenario's origin."""

    speed_mps: float
    heading_rad: float
    height_m: float
