"""The extended Kalman filter of a vehicle's state through model (7).

Height and climb are a filter of their own: nothing of them is in the motion over ground, nor the other way round. A
sample's values have independent noise, so they are taken one after another, which is the same as all at once. What
carries a vehicle up besides its own climb is found from how the filter corrects its climb.

Source: Gelb, "Applied Optimal Estimation" (1974), chapter 6.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import AutopilotModel, FlightState, squared, wrap
from flight_model.decay import of_climb
from gcs_formation.estimation.noise_and_plausibility import Values

Level = tuple[float, float, float, float, float, float]
"""Of north, east, airspeed, heading, and the wind north and east. Compiled, it is six numbers side by side."""
NORTH: Final = 0
EAST: Final = 1
SPEED: Final = 2
HEADING: Final = 3
WIND_NORTH: Final = 4
WIND_EAST: Final = 5
UPDRAUGHT_GAIN: Final = 2.0
"""How many metres a height setpoint answers each metre of height, in a fast swing, that the model doesn't explain.

Real autopilots follow fast setpoints farther than (7) says: a PX4 whose lags add up to 8 s kept swinging by 1 m at 8.
"""
UPDRAUGHT_SIGMAS: Final = 2.0
"""Standard deviations of a sample's climb below which it may be noise."""
SWAY_MEMORY_S: Final = 60.0
"""For how long it is remembered how far a vehicle was moved; turbulence lasts for minutes, a gust for seconds."""


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

    def carry(self, along: VelocityJacobian, elapsed_s: float, model: AutopilotModel) -> None:
        """Carry it on by the derivative F of the states after `elapsed_s` by the states before: F P F^T.

        The heading is taken to be constant for that: `along` is of the state before.
        """
        speed_left, heading_left = math.exp(-elapsed_s / model.tau_v_s), math.exp(-elapsed_s / model.tau_psi_s)
        speed_s, heading_s = model.tau_v_s * (1.0 - speed_left), model.tau_psi_s * (1.0 - heading_left)
        north_v, north_psi = along.north_by_speed * speed_s, along.north_by_heading * heading_s
        east_v, east_psi = along.east_by_speed * speed_s, along.east_by_heading * heading_s
        speed, heading = self.speed, self.heading
        north = plus(plus(plus(self.north, north_v, speed), north_psi, heading), elapsed_s, self.wind_north)
        east = plus(plus(plus(self.east, east_v, speed), east_psi, heading), elapsed_s, self.wind_east)
        by_speed, by_heading = (north_v, east_v, speed_left), (north_psi, east_psi, heading_left)
        self.north = _across(north, by_speed, by_heading, elapsed_s)
        self.east = _across(east, by_speed, by_heading, elapsed_s)
        self.speed = _across(plus(speed, speed_left - 1.0, speed), by_speed, by_heading, elapsed_s)
        self.heading = _across(plus(heading, heading_left - 1.0, heading), by_speed, by_heading, elapsed_s)
        self.wind_north = _across(self.wind_north, by_speed, by_heading, elapsed_s)
        self.wind_east = _across(self.wind_east, by_speed, by_heading, elapsed_s)

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
        """Add a change of the wind, of `variance` north and east, that came at any time of the last `elapsed_s`."""
        place, both = variance * elapsed_s**2 / 3, variance * elapsed_s / 2
        self.north = plus(self.north, 1.0, (place, 0.0, 0.0, 0.0, both, 0.0))
        self.east = plus(self.east, 1.0, (0.0, place, 0.0, 0.0, 0.0, both))
        self.wind_north = plus(self.wind_north, 1.0, (both, 0.0, 0.0, 0.0, variance, 0.0))
        self.wind_east = plus(self.wind_east, 1.0, (0.0, both, 0.0, 0.0, 0.0, variance))

    def of_north_mps(self, along: VelocityJacobian) -> Level:
        """Return the covariances of the states with the velocity over ground to the north."""
        return plus(plus(self.wind_north, along.north_by_speed, self.speed), along.north_by_heading, self.heading)

    def of_east_mps(self, along: VelocityJacobian) -> Level:
        """Return the covariances of the states with the velocity over ground to the east."""
        return plus(plus(self.wind_east, along.east_by_speed, self.speed), along.east_by_heading, self.heading)

    def update(self, seen: Level, spread: float, off: float) -> Level:
        """Return the correction of the states by a scalar measurement of innovation `off`, and update the covariance.

        `seen`: its covariances with the states; `spread`: the variance of its innovation.
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
        """Return by how much the velocity over ground to the north changes with a change of the states.

        Of the states' covariances with that velocity, it makes the velocity's variance.
        """
        return self.north_by_speed * states[SPEED] + self.north_by_heading * states[HEADING] + states[WIND_NORTH]

    def east_mps(self, states: Level) -> float:
        """Return by how much the velocity over ground to the east changes, or its variance, as `north_mps` does."""
        return self.east_by_speed * states[SPEED] + self.east_by_heading * states[HEADING] + states[WIND_EAST]


class HeightCovariance:
    """Covariance of height and climb, m and m/s."""

    def __init__(self, height: float, climb: float) -> None:
        """Begin with two variances and no correlation."""
        self.height = height
        self.cross: float = 0.0
        self.climb = climb

    def carry(self, elapsed_s: float, model: AutopilotModel) -> None:
        """Carry it on by `elapsed_s` through the height's two poles; their difference 0 makes them a double pole."""
        slow_s, fast_s = max(model.tau_ha_s, model.tau_hb_s), min(model.tau_ha_s, model.tau_hb_s)
        slow, fast = math.exp(-elapsed_s / slow_s), math.exp(-elapsed_s / fast_s)
        climb_s = of_climb(elapsed_s, slow_s, fast_s, slow, fast)
        a, b, c, d = slow + climb_s / slow_s, climb_s, -climb_s / (slow_s * fast_s), fast - climb_s / slow_s
        height, cross, climb = self.height, self.cross, self.climb
        self.height = a * a * height + 2.0 * a * b * cross + b * b * climb
        self.cross = a * c * height + (a * d + b * c) * cross + b * d * climb
        self.climb = c * c * height + 2.0 * c * d * cross + d * d * climb


class Updraught:
    """What carries one vehicle up, from how it climbs against model (7)."""

    def __init__(self, *, followed: bool) -> None:
        """Start in still air. `followed`: whether states have it."""
        self._followed = followed
        self._felt_mps = 0.0
        """As samples show it; of a state it is as far as that is followed."""
        self._known_s = 0.0
        self.sway_m2 = 0.0
        """Mean square of how far it moves a vehicle that is told a height."""

    def forget(self) -> None:
        """Begin anew with a vehicle's state; the air is as rough as it was."""
        self._felt_mps = 0.0

    def feel(
        self, state: FlightState, climbs_mps: float, variance: float, elapsed_s: float, model: AutopilotModel
    ) -> None:
        """Take what a sample says; the updraught that the sample's `state` has follows.

        Its own climb follows its setpoints by (7): what it climbs faster than that, it keeps as long as the air carries
        it, and a difference that doesn't last ends by both lags. It counts as far as it stands out from noise.

        Args:
            state: by model and sample; its updraught is changed.
            climbs_mps: by how much it climbs faster than the model has it in its updraught.
            variance: of the telemetry's climb, (m/s)².
            elapsed_s: since the sample before.
            model: the vehicle's.
        """
        lags_s = model.tau_ha_s + model.tau_hb_s
        left = math.exp(-(1.0 / model.tau_ha_s + 1.0 / model.tau_hb_s) * elapsed_s)
        self._felt_mps += climbs_mps + (1.0 - left) * (state.updraught_mps - self._felt_mps)
        noise = squared(UPDRAUGHT_SIGMAS) * variance
        certain_mps = max(1.0 - noise / max(squared(self._felt_mps), noise), 0.0) * self._felt_mps
        self._known_s = min(self._known_s + elapsed_s, SWAY_MEMORY_S)
        if self._known_s > 0.0:
            self.sway_m2 += elapsed_s / self._known_s * (squared(lags_s * certain_mps) - self.sway_m2)
        if self._followed:
            share = 1.0 - math.exp(-UPDRAUGHT_GAIN * elapsed_s / lags_s)
            state.updraught_mps += share * (certain_mps - state.updraught_mps)


def innovation(sample: Values, state: FlightState, along: VelocityJacobian) -> Values:
    """Return a sample minus the one that a vehicle in `state` would give; `along` is of that state."""
    a, b, c, d, e, f, g, h = sample
    return (
        a - state.north_m,
        b - state.east_m,
        c - state.height_m,
        d - (along.east_by_heading + state.wind_north_mps),  # as V cos(psi) is its derivative east, by the heading
        e - (state.wind_east_mps - along.north_by_heading),
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
    level: LevelCovariance, height: HeightCovariance, along: VelocityJacobian, noise: Values
) -> Values:
    """Return the variances of a sample's innovations: what comes from the state's, and its values' own `noise`."""
    return (
        level.north[NORTH] + noise[0],
        level.east[EAST] + noise[1],
        height.height + noise[2],
        along.north_mps(level.of_north_mps(along)) + noise[3],
        along.east_mps(level.of_east_mps(along)) + noise[4],
        height.climb + noise[5],
        level.speed[SPEED] + noise[6],
        level.heading[HEADING] + noise[7],
    )


def correct_level(covariance: LevelCovariance, along: VelocityJacobian, off: Values, noise: Values) -> Level:
    """Return by how much a sample's values correct the states, and take what they tell from the covariance.

    `off` and `noise` are the innovations and variances of all eight values.
    """
    seen = covariance.north
    found = covariance.update(seen, seen[NORTH] + noise[0], off[0])
    seen = covariance.east
    found = plus(found, 1.0, covariance.update(seen, seen[EAST] + noise[1], off[1] - found[EAST]))
    seen = covariance.of_north_mps(along)
    left = off[3] - along.north_mps(found)
    found = plus(found, 1.0, covariance.update(seen, along.north_mps(seen) + noise[3], left))
    seen = covariance.of_east_mps(along)
    left = off[4] - along.east_mps(found)
    found = plus(found, 1.0, covariance.update(seen, along.east_mps(seen) + noise[4], left))
    seen = covariance.speed
    found = plus(found, 1.0, covariance.update(seen, seen[SPEED] + noise[6], off[6] - found[SPEED]))
    seen = covariance.heading
    return plus(found, 1.0, covariance.update(seen, seen[HEADING] + noise[7], off[7] - found[HEADING]))


def correct_height(covariance: HeightCovariance, off: Values, noise: Values) -> tuple[float, float]:
    """Return by how much height and climb are corrected likewise."""
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
    """Return a row plus a share of another."""
    a, b, c, d, e, f = row
    u, v, w, x, y, z = other
    return a + share * u, b + share * v, c + share * w, d + share * x, e + share * y, f + share * z


def _across(
    row: Level, by_speed: tuple[float, float, float], by_heading: tuple[float, float, float], elapsed_s: float
) -> Level:
    """Return a row's covariances with the states `elapsed_s` later: P F^T of a row of P.

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
