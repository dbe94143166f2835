"""One vehicle's state and setpoint: position, motion relative to the air, wind."""

from __future__ import annotations

import math

from mypy_extensions import mypyc_attr


@mypyc_attr(acyclic=True, free_list_len=1)
class FlightState:
    """Position and motion of a vehicle: north, east and up from the origin.

    Airspeed and heading are relative to the air. The velocity over ground is the airspeed along the heading, plus the
    wind and any other drift. The climb rate is over ground too and includes the updraught, which lasts.
    """

    __slots__ = (
        "airspeed_mps",
        "climb_mps",
        "east_m",
        "heading_rad",
        "height_m",
        "north_m",
        "updraught_mps",
        "wind_east_mps",
        "wind_north_mps",
    )

    def __init__(  # noqa: PLR0913, PLR0917 - a state's values
        self,
        north_m: float,
        east_m: float,
        height_m: float,
        climb_mps: float,
        airspeed_mps: float,
        heading_rad: float,
        wind_north_mps: float,
        wind_east_mps: float,
        updraught_mps: float = 0.0,
    ) -> None:
        """Take position, climb rate, airspeed, heading, wind, and the updraught that is part of the climb rate."""
        self.north_m = north_m
        self.east_m = east_m
        self.height_m = height_m
        self.climb_mps = climb_mps
        self.airspeed_mps = airspeed_mps
        self.heading_rad = heading_rad
        self.wind_north_mps = wind_north_mps
        self.wind_east_mps = wind_east_mps
        self.updraught_mps = updraught_mps

    def copy(self) -> FlightState:
        """Return a copy."""
        return FlightState(
            self.north_m,
            self.east_m,
            self.height_m,
            self.climb_mps,
            self.airspeed_mps,
            self.heading_rad,
            self.wind_north_mps,
            self.wind_east_mps,
            self.updraught_mps,
        )

    def ground_mps(self) -> tuple[float, float]:
        """Return the velocity over ground, north and east."""
        return (
            self.airspeed_mps * math.cos(self.heading_rad) + self.wind_north_mps,
            self.airspeed_mps * math.sin(self.heading_rad) + self.wind_east_mps,
        )

    def values(self) -> tuple[float, float, float, float, float, float, float, float, float]:
        """Return the quantities in the order of the constructor's arguments."""
        return (
            self.north_m,
            self.east_m,
            self.height_m,
            self.climb_mps,
            self.airspeed_mps,
            self.heading_rad,
            self.wind_north_mps,
            self.wind_east_mps,
            self.updraught_mps,
        )


@mypyc_attr(acyclic=True, free_list_len=1)
class Setpoint:
    """Airspeed, heading (clockwise from north) and height above the scenario's origin."""

    __slots__ = ("heading_rad", "height_m", "speed_mps")

    def __init__(self, speed_mps: float, heading_rad: float, height_m: float) -> None:
        """Take airspeed, heading and height."""
        self.speed_mps = speed_mps
        self.heading_rad = heading_rad
        self.height_m = height_m
