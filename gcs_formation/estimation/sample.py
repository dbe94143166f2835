"""What a vehicle measured at one instant."""

from __future__ import annotations

import math

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from flight_model.autopilot_model import wrap
from flight_model.flight_state import FlightState
from gcs_formation.estimation.noise_and_plausibility import (
    Values,
)


@mypyc_attr(acyclic=True, free_list_len=1)
class Sample:
    """What a vehicle measured at one instant: ground velocity, and position north, east and up from the origin."""

    def __init__(  # noqa: PLR0913, PLR0917 - a sample's values
        self,
        stamp: Instant,
        north_m: float,
        east_m: float,
        height_m: float,
        north_mps: float,
        east_mps: float,
        climb_mps: float,
        airspeed_mps: float,
        heading_rad: float,
        *,
        by_course: bool = False,
        airspeed_ratio: float = 1.0,
    ) -> None:
        """Take the instant, the position, the velocity over ground, airspeed and heading.

        `by_course`: the vehicle is commanded by course over ground, and corrects for wind by itself.
        `airspeed_ratio`: of true airspeed to the sensor's reading.
        """
        self.stamp = stamp
        self.north_m = north_m
        self.east_m = east_m
        self.height_m = height_m
        self.north_mps = north_mps
        self.east_mps = east_mps
        self.climb_mps = climb_mps
        self.airspeed_mps = airspeed_mps
        self.heading_rad = heading_rad
        self.by_course = by_course
        self.airspeed_ratio = airspeed_ratio

    def values(self, min_mps: float) -> Values:
        """Return the values in the order of the constructor's arguments; the airspeed is at least `min_mps`."""
        return (
            self.north_m,
            self.east_m,
            self.height_m,
            self.north_mps,
            self.east_mps,
            self.climb_mps,
            max(self.airspeed_mps, min_mps),
            self.heading_rad,
        )


def heading_shown(state: FlightState, north_mps: float, east_mps: float) -> float:
    """Return the heading that a velocity over ground implies: its course less the crab angle of the vehicle's `state`.

    A vehicle commanded by course turns into a gust by itself, before the wind estimate has changed.
    """
    known_north_mps, known_east_mps = state.ground_mps()
    crabbed_rad = math.atan2(known_east_mps, known_north_mps) - state.heading_rad
    return wrap(math.atan2(east_mps, north_mps) - crabbed_rad)
