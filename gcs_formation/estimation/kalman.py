"""The extended Kalman filter of a vehicle's state through model (7).

Height and climb are a filter of their own: nothing of them is in the motion over ground, nor the other way round. A
sample's values have independent noise, so they are taken one after another, which is the same as all at once.

Source: Gelb, "Applied Optimal Estimation" (1974), chapter 6.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot import AutopilotModel, FlightState, wrap

NORTH: Final = 0
EAST: Final = 1
SPEED: Final = 2
HEADING: Final = 3
WIND_NORTH: Final = 4
WIND_EAST: Final = 5
LEVEL_STATES: Final = 6
"""States of the motion over ground, in the order of their covariances."""
EVERY: Final = range(LEVEL_STATES)


class LevelCovariance:
    """Covariance of north, east, airspeed, heading, and the wind north and east: m, m/s and rad."""

    __slots__ = ("rows",)

    def __init__(self, variances: list[float]) -> None:
        """Begin with `variances` and no correlation."""
        self.rows = [
            [0.0] * place + [value] + [0.0] * (LEVEL_STATES - 1 - place) for place, value in enumerate(variances)
        ]

    def carry(self, state: FlightState, elapsed_s: float, model: AutopilotModel) -> None:
        """Carry it on by the derivative F of the states `elapsed_s` after `state` by that state: F P F^T.

        The heading is taken to be constant for that.
        """
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        speed_left, heading_left = math.exp(-elapsed_s / model.tau_v_s), math.exp(-elapsed_s / model.tau_psi_s)
        speed_s, across_m = model.tau_v_s * (1.0 - speed_left), model.tau_psi_s * (1.0 - heading_left)
        across_m *= state.airspeed_mps
        north_v, north_psi, east_v, east_psi = cos * speed_s, -sin * across_m, sin * speed_s, cos * across_m
        north, east, speed, heading, wind_north, wind_east = self.rows
        moved = [
            [north[j] + north_v * speed[j] + north_psi * heading[j] + elapsed_s * wind_north[j] for j in EVERY],
            [east[j] + east_v * speed[j] + east_psi * heading[j] + elapsed_s * wind_east[j] for j in EVERY],
            [speed_left * speed[j] for j in EVERY],
            [heading_left * heading[j] for j in EVERY],
            wind_north,
            wind_east,
        ]
        self.rows = [
            [
                row[NORTH] + north_v * row[SPEED] + north_psi * row[HEADING] + elapsed_s * row[WIND_NORTH],
                row[EAST] + east_v * row[SPEED] + east_psi * row[HEADING] + elapsed_s * row[WIND_EAST],
                speed_left * row[SPEED],
                heading_left * row[HEADING],
                row[WIND_NORTH],
                row[WIND_EAST],
            ]
            for row in moved
        ]

    def grow(self, variances: list[float], share: float) -> None:
        """Add `share` times `variances`."""
        for place, variance in enumerate(variances):
            self.rows[place][place] += share * variance

    def gust(self, variance: float, elapsed_s: float) -> None:
        """Add a change of the wind, of `variance` north and east, that came at any time of the last `elapsed_s`."""
        for place, wind in ((NORTH, WIND_NORTH), (EAST, WIND_EAST)):
            self.rows[wind][wind] += variance
            self.rows[wind][place] += variance * elapsed_s / 2
            self.rows[place][wind] += variance * elapsed_s / 2
            self.rows[place][place] += variance * elapsed_s**2 / 3

    def seen(self, sensitivity: Sensitivity) -> list[float]:
        """Return the covariances of the states with a measured value."""
        first, wind = sensitivity.first, sensitivity.wind
        if wind < 0:
            return [row[first] for row in self.rows]
        by_speed, by_heading = sensitivity.by_speed, sensitivity.by_heading
        return [by_speed * row[SPEED] + by_heading * row[HEADING] + row[wind] for row in self.rows]

    def take(self, seen: list[float], gain: list[float]) -> None:
        """Take away what a value tells: `gain` times its covariances with the states."""
        for place, row in enumerate(self.rows):
            share = gain[place]
            self.rows[place] = [row[j] - share * seen[j] for j in EVERY]


class Sensitivity:
    """The derivative of a measured value by the states: one of them, or a ground velocity by three."""

    __slots__ = ("by_heading", "by_speed", "first", "wind")

    def __init__(self, first: int, wind: int = -1, by_speed: float = 0.0, by_heading: float = 0.0) -> None:
        """Measure state `first`; or, with a `wind`, that plus the given shares of airspeed and heading."""
        self.first = first
        self.wind = wind
        self.by_speed = by_speed
        self.by_heading = by_heading

    def of(self, states: list[float]) -> float:
        """Return what a change of the states changes the value by; or a value's variance from its covariances."""
        if self.wind < 0:
            return states[self.first]
        return self.by_speed * states[SPEED] + self.by_heading * states[HEADING] + states[self.wind]


class HeightCovariance:
    """Covariance of height and climb, m and m/s."""

    __slots__ = ("climb", "cross", "height")

    def __init__(self, height: float, climb: float) -> None:
        """Begin with two variances and no correlation."""
        self.height = height
        self.cross: float = 0.0
        self.climb = climb

    def carry(self, elapsed_s: float, model: AutopilotModel) -> None:
        """Carry it on by `elapsed_s` through the height's two poles; their difference 0 makes them a double pole."""
        slow_s, fast_s = max(model.tau_ha_s, model.tau_hb_s), min(model.tau_ha_s, model.tau_hb_s)
        slow, fast = math.exp(-elapsed_s / slow_s), math.exp(-elapsed_s / fast_s)
        apart = elapsed_s / slow_s - elapsed_s / fast_s
        between_s = elapsed_s * slow * (math.expm1(apart) / apart if apart != 0.0 else 1.0)
        a, b, c, d = slow + between_s / slow_s, between_s, -between_s / (slow_s * fast_s), fast - between_s / slow_s
        height, cross, climb = self.height, self.cross, self.climb
        self.height = a * a * height + 2.0 * a * b * cross + b * b * climb
        self.cross = a * c * height + (a * d + b * c) * cross + b * d * climb
        self.climb = c * c * height + 2.0 * c * d * cross + d * d * climb


def expected(state: FlightState) -> list[float]:
    """Return the sample that a vehicle in `state` would give: north, east, height, their rates, airspeed, heading."""
    north_mps = state.airspeed_mps * math.cos(state.heading_rad) + state.wind_north_mps
    east_mps = state.airspeed_mps * math.sin(state.heading_rad) + state.wind_east_mps
    place = [state.north_m, state.east_m, state.height_m]
    return [*place, north_mps, east_mps, state.climb_mps, state.airspeed_mps, state.heading_rad]


def innovation(sample: list[float], state: FlightState) -> list[float]:
    """Return the sample minus the expected one."""
    values = expected(state)
    difference = [seen - values[row] for row, seen in enumerate(sample)]
    difference[-1] = wrap(difference[-1])
    return difference


def level_sensitivities(state: FlightState) -> list[Sensitivity]:
    """Return those of north and east, their rates, airspeed and heading."""
    cos, sin, speed = math.cos(state.heading_rad), math.sin(state.heading_rad), state.airspeed_mps
    return [
        Sensitivity(NORTH),
        Sensitivity(EAST),
        Sensitivity(NORTH, WIND_NORTH, cos, -speed * sin),
        Sensitivity(EAST, WIND_EAST, sin, speed * cos),
        Sensitivity(SPEED),
        Sensitivity(HEADING),
    ]


def correct_level(
    covariance: LevelCovariance, sensitivities: list[Sensitivity], difference: list[float], variances: list[float]
) -> list[float]:
    """Return by how much a sample's values correct the states, and take what they tell from the covariance."""
    correction = [0.0] * LEVEL_STATES
    for sensitivity, off, variance in zip(sensitivities, difference, variances, strict=True):
        seen = covariance.seen(sensitivity)
        spread = sensitivity.of(seen) + variance
        gain = [each / spread for each in seen]
        left = off - sensitivity.of(correction)
        correction = [correction[j] + left * gain[j] for j in EVERY]
        covariance.take(seen, gain)
    return correction


def correct_height(
    covariance: HeightCovariance, difference: tuple[float, float], variances: tuple[float, float]
) -> tuple[float, float]:
    """Return by how much a measured height and climb correct them, and take what they tell from the covariance."""
    height, cross, climb = covariance.height, covariance.cross, covariance.climb
    by_height = height + variances[0]
    first, second = height / by_height, cross / by_height
    height_m, climb_mps = first * difference[0], second * difference[0]
    climb -= second * cross
    cross -= first * cross
    height -= first * height
    by_climb = climb + variances[1]
    left, first, second = difference[1] - climb_mps, cross / by_climb, climb / by_climb
    covariance.height = height - first * cross
    covariance.cross = cross - first * climb
    covariance.climb = climb - second * climb
    return height_m + first * left, climb_mps + second * left
