"""The extended Kalman filter of a vehicle's state through model (7).

Height and climb have a filter of their own, since they are independent of the motion over ground. A sample's values
have independent noise, so they are processed one after another, which is equivalent to all at once.

Source: Gelb, "Applied Optimal Estimation" (1974), chapter 6.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import AutopilotModel, wrap
from flight_model.decay import of_climb
from flight_model.flight_state import FlightState
from gcs_formation.estimation.noise_and_plausibility import Values

Level = tuple[float, float, float, float, float, float]
"""Values for north, east, airspeed, heading, and the wind north and east. Compiled, it is six adjacent numbers."""
NORTH: Final = 0
EAST: Final = 1
SPEED: Final = 2
HEADING: Final = 3
WIND_NORTH: Final = 4
WIND_EAST: Final = 5


class LevelCovariance:
    """Covariance of north, east, airspeed, heading, and the wind north and east: m, m/s and rad."""

    def __init__(self, variances: Level) -> None:
        """Begin with `variances` and no correlation."""
        self.north: Level = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.east: Level = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.speed: Level = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.heading: Level = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.wind_north: Level = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.wind_east: Level = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.grow(variances, 1.0)

    def predict(self, jacobian: VelocityJacobian, elapsed_s: float, model: AutopilotModel) -> None:
        """Predict it over `elapsed_s` by F P F^T; F is the derivative of the later states by the present ones.

        F takes the heading to be constant: `jacobian` is of the state before.
        """
        speed_left, heading_left = math.exp(-elapsed_s / model.tau_v_s), math.exp(-elapsed_s / model.tau_psi_s)
        speed_s, heading_s = model.tau_v_s * (1.0 - speed_left), model.tau_psi_s * (1.0 - heading_left)
        north_v, north_psi = jacobian.north_by_speed * speed_s, jacobian.north_by_heading * heading_s
        east_v, east_psi = jacobian.east_by_speed * speed_s, jacobian.east_by_heading * heading_s
        speed, heading = self.speed, self.heading
        north = plus(plus(plus(self.north, north_v, speed), north_psi, heading), elapsed_s, self.wind_north)
        east = plus(plus(plus(self.east, east_v, speed), east_psi, heading), elapsed_s, self.wind_east)
        by_speed, by_heading = (north_v, east_v, speed_left), (north_psi, east_psi, heading_left)
        self.north = _predicted(north, by_speed, by_heading, elapsed_s)
        self.east = _predicted(east, by_speed, by_heading, elapsed_s)
        self.speed = _predicted(plus(speed, speed_left - 1.0, speed), by_speed, by_heading, elapsed_s)
        self.heading = _predicted(plus(heading, heading_left - 1.0, heading), by_speed, by_heading, elapsed_s)
        self.wind_north = _predicted(self.wind_north, by_speed, by_heading, elapsed_s)
        self.wind_east = _predicted(self.wind_east, by_speed, by_heading, elapsed_s)

    def grow(self, variances: Level, share: float) -> None:
        """Add `share` times `variances`."""
        a, b, c, d, e, f = variances
        self.north = plus(self.north, share, (a, 0.0, 0.0, 0.0, 0.0, 0.0))
        self.east = plus(self.east, share, (0.0, b, 0.0, 0.0, 0.0, 0.0))
        self.speed = plus(self.speed, share, (0.0, 0.0, c, 0.0, 0.0, 0.0))
        self.heading = plus(self.heading, share, (0.0, 0.0, 0.0, d, 0.0, 0.0))
        self.wind_north = plus(self.wind_north, share, (0.0, 0.0, 0.0, 0.0, e, 0.0))
        self.wind_east = plus(self.wind_east, share, (0.0, 0.0, 0.0, 0.0, 0.0, f))

    def gust(self, variance: float, elapsed_s: float) -> None:
        """Add a step of the wind, of `variance` north and east, at an unknown time in the last `elapsed_s`."""
        position, both = variance * elapsed_s**2 / 3, variance * elapsed_s / 2
        self.north = plus(self.north, 1.0, (position, 0.0, 0.0, 0.0, both, 0.0))
        self.east = plus(self.east, 1.0, (0.0, position, 0.0, 0.0, 0.0, both))
        self.wind_north = plus(self.wind_north, 1.0, (both, 0.0, 0.0, 0.0, variance, 0.0))
        self.wind_east = plus(self.wind_east, 1.0, (0.0, both, 0.0, 0.0, 0.0, variance))

    def of_north_mps(self, jacobian: VelocityJacobian) -> Level:
        """Return the covariances of the states with the velocity over ground to the north."""
        return plus(plus(self.wind_north, jacobian.north_by_speed, self.speed), jacobian.north_by_heading, self.heading)

    def of_east_mps(self, jacobian: VelocityJacobian) -> Level:
        """Return the covariances of the states with the velocity over ground to the east."""
        return plus(plus(self.wind_east, jacobian.east_by_speed, self.speed), jacobian.east_by_heading, self.heading)

    def update(self, seen: Level, spread: float, off: float) -> Level:
        """Update the covariance by a scalar measurement, and return the correction of the states.

        `seen`: the measurement's covariances with the states; `spread`: variance of its innovation, `off`.
        """
        a, b, c, d, e, f = seen
        self.north = plus(self.north, -a / spread, seen)
        self.east = plus(self.east, -b / spread, seen)
        self.speed = plus(self.speed, -c / spread, seen)
        self.heading = plus(self.heading, -d / spread, seen)
        self.wind_north = plus(self.wind_north, -e / spread, seen)
        self.wind_east = plus(self.wind_east, -f / spread, seen)
        share = off / spread
        return a * share, b * share, c * share, d * share, e * share, f * share


class VelocityJacobian:
    """The derivatives of the velocity over ground, north and east, by airspeed and heading, at a state."""

    def __init__(self) -> None:
        """Start without a state."""
        self.north_by_speed = self.north_by_heading = self.east_by_speed = self.east_by_heading = 0.0

    def linearise(self, state: FlightState) -> None:
        """Take the derivatives at another state."""
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        self.north_by_speed, self.north_by_heading = cos, -state.airspeed_mps * sin
        self.east_by_speed, self.east_by_heading = sin, state.airspeed_mps * cos

    def north_mps(self, states: Level) -> float:
        """Return the change of the velocity over ground to the north for a change of the states.

        Applied to the states' covariances with that velocity, it gives the velocity's variance.
        """
        return self.north_by_speed * states[SPEED] + self.north_by_heading * states[HEADING] + states[WIND_NORTH]

    def east_mps(self, states: Level) -> float:
        """Return the change of the velocity over ground to the east, or its variance, as `north_mps` does."""
        return self.east_by_speed * states[SPEED] + self.east_by_heading * states[HEADING] + states[WIND_EAST]


class HeightCovariance:
    """Covariance of height and climb, m and m/s."""

    def __init__(self, height: float, climb: float) -> None:
        """Begin with two variances and no correlation."""
        self.height = height
        self.cross: float = 0.0
        self.climb = climb

    def predict(self, elapsed_s: float, model: AutopilotModel) -> None:
        """Predict it over `elapsed_s` through the height's two poles, which may be equal."""
        slow_s, fast_s = max(model.tau_ha_s, model.tau_hb_s), min(model.tau_ha_s, model.tau_hb_s)
        slow, fast = math.exp(-elapsed_s / slow_s), math.exp(-elapsed_s / fast_s)
        climb_s = of_climb(elapsed_s, slow_s, fast_s, slow, fast)
        a, b, c, d = slow + climb_s / slow_s, climb_s, -climb_s / (slow_s * fast_s), fast - climb_s / slow_s
        height, cross, climb = self.height, self.cross, self.climb
        self.height = a * a * height + 2.0 * a * b * cross + b * b * climb
        self.cross = a * c * height + (a * d + b * c) * cross + b * d * climb
        self.climb = c * c * height + 2.0 * c * d * cross + d * d * climb


def innovation(sample: Values, state: FlightState, jacobian: VelocityJacobian) -> Values:
    """Return a sample minus the one expected from a vehicle in `state`; `jacobian` is of that state."""
    a, b, c, d, e, f, g, h = sample
    return (
        a - state.north_m,
        b - state.east_m,
        c - state.height_m,
        d - (jacobian.east_by_heading + state.wind_north_mps),  # V cos(psi) is the derivative of V sin(psi) by psi
        e - (state.wind_east_mps - jacobian.north_by_heading),
        f - state.climb_mps,
        g - state.airspeed_mps,
        wrap(h - state.heading_rad),
    )


def minus(values: Values, others: Values) -> Values:
    """Return the differences of two samples' values."""
    a, b, c, d, e, f, g, h = values
    s, t, u, v, w, x, y, z = others
    return a - s, b - t, c - u, d - v, e - w, f - x, g - y, h - z


def innovation_variances(
    level: LevelCovariance, height: HeightCovariance, jacobian: VelocityJacobian, noise: Values
) -> Values:
    """Return the variances of a sample's innovations: the state's contribution plus the values' own `noise`."""
    return (
        level.north[NORTH] + noise[0],
        level.east[EAST] + noise[1],
        height.height + noise[2],
        jacobian.north_mps(level.of_north_mps(jacobian)) + noise[3],
        jacobian.east_mps(level.of_east_mps(jacobian)) + noise[4],
        height.climb + noise[5],
        level.speed[SPEED] + noise[6],
        level.heading[HEADING] + noise[7],
    )


def correct_level(covariance: LevelCovariance, jacobian: VelocityJacobian, off: Values, noise: Values) -> Level:
    """Return the correction of the states by a sample's values, and update the covariance.

    `off` and `noise` are the innovations and noise variances of all eight values.
    """
    seen = covariance.north
    found = covariance.update(seen, seen[NORTH] + noise[0], off[0])
    seen = covariance.east
    found = plus(found, 1.0, covariance.update(seen, seen[EAST] + noise[1], off[1] - found[EAST]))
    seen = covariance.of_north_mps(jacobian)
    left = off[3] - jacobian.north_mps(found)
    found = plus(found, 1.0, covariance.update(seen, jacobian.north_mps(seen) + noise[3], left))
    seen = covariance.of_east_mps(jacobian)
    left = off[4] - jacobian.east_mps(found)
    found = plus(found, 1.0, covariance.update(seen, jacobian.east_mps(seen) + noise[4], left))
    seen = covariance.speed
    found = plus(found, 1.0, covariance.update(seen, seen[SPEED] + noise[6], off[6] - found[SPEED]))
    seen = covariance.heading
    return plus(found, 1.0, covariance.update(seen, seen[HEADING] + noise[7], off[7] - found[HEADING]))


def correct_height(covariance: HeightCovariance, off: Values, noise: Values) -> tuple[float, float]:
    """Return the corrections of height and climb likewise."""
    height, cross, climb = covariance.height, covariance.cross, covariance.climb
    by_height = height + noise[2]
    first, second = height / by_height, cross / by_height
    height_m, climb_mps = first * off[2], second * off[2]
    climb -= second * cross
    cross -= first * cross
    height -= first * height
    by_climb = climb + noise[5]
    left, first, second = off[5] - climb_mps, cross / by_climb, climb / by_climb
    covariance.height = height - first * cross
    covariance.cross = cross - first * climb
    covariance.climb = climb - second * climb
    return height_m + first * left, climb_mps + second * left


def plus(row: Level, share: float, other: Level) -> Level:
    """Return `row + share * other`."""
    a, b, c, d, e, f = row
    u, v, w, x, y, z = other
    return a + share * u, b + share * v, c + share * w, d + share * x, e + share * y, f + share * z


def _predicted(
    row: Level, by_speed: tuple[float, float, float], by_heading: tuple[float, float, float], elapsed_s: float
) -> Level:
    """Return a row of P F^T from that of P: its covariances with the states `elapsed_s` later.

    Args:
        row: covariances with the states now.
        by_speed: derivatives of north, east and airspeed by the airspeed.
        by_heading: those of north, east and heading by the heading.
        elapsed_s: the time.
    """
    north, east, speed, heading, wind_north, wind_east = row
    north += by_speed[0] * speed + by_heading[0] * heading + elapsed_s * wind_north
    east += by_speed[1] * speed + by_heading[1] * heading + elapsed_s * wind_east
    return north, east, by_speed[2] * speed, by_heading[2] * heading, wind_north, wind_east
