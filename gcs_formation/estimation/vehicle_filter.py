"""The Kalman filter of one vehicle's state.

It always runs: exact telemetry is the case of small noise. It is predicted by model (7) through the setpoints that were
sent, weights samples by the noise estimated from the telemetry, and gives implausible samples little weight.
"""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS
from flight_model.autopilot_model import AutopilotModel, squared, wrap
from flight_model.flight_state import FlightState
from flight_model.gain_design import UNMODELLED, WIND_WALK
from gcs_formation.estimation.kalman import (
    HEADING,
    WIND_EAST,
    WIND_NORTH,
    HeightCovariance,
    LevelCovariance,
    VelocityJacobian,
    correct_height,
    correct_level,
    innovation,
    innovation_variances,
    minus,
)
from gcs_formation.estimation.large_gust import GUST_SIGMAS, LargeGust, explained
from gcs_formation.estimation.noise_and_plausibility import (
    IMPLAUSIBLE_SIGMAS,
    UNKNOWN_MOTION,
    PositionDrift,
    Values,
    VehicleNoise,
    excesses,
    plausible,
    weighed,
)
from gcs_formation.estimation.updraught import Updraught

MIN_AIRSPEED_MPS: Final = 1.0
"""Lower bound of airspeeds: equations divide by them, and a vehicle that can't hover flies faster."""
COMMANDED_WALK: Final[tuple[float, float, float]] = UNMODELLED
UNCOMMANDED_WALK: Final[tuple[float, float, float]] = (1.0, 1.0, 0.3)
"""Random walk of climb, airspeed and heading, per square root of a second, of a vehicle we command and of others.
Tuned: m/s, m/s, rad, each/√s; 0.5 to 2 times these; shown by `pytest tests/gcs_formation/estimation`."""
BEYOND_LIMIT: Final = 1.1
"""Share of the climb limit above which a climb doesn't follow our setpoints yet: the end of a take-off. Tuned: share;
1.05 to 1.3; shown by `pytest tests/gcs_formation/estimation`."""
WITHOUT_WIND: Final = 0.1
"""Random walk of positions, m per square root of a second, where the wind isn't estimated. Tuned: m/√s; 0.05 to 0.3;
shown by `pytest tests/gcs_formation/estimation`."""
GUST_RADPS: Final = 1.0
"""Least bandwidth of the wind estimate at which gusts are accepted at once. A lower one is set where airspeed lags or
is biased, which would look like gusts. Tuned: rad/s; 0.5 to 2; shown by `python -m benchmarks.gust_grid`."""
FIRST_WIND_RADPS: Final = 0.2
"""Initial bandwidth of the wind estimate where a lower one is set: it takes out the noise of the first sample, which
would otherwise persist as long as the slow estimate does. Tuned: rad/s; 0.1 to 0.5; shown by `pytest
tests/gcs_formation/estimation`."""
IMPLAUSIBLE_SAMPLES: Final = 5
"""This many in a row aren't outliers: somebody else flies the vehicle. The filter restarts from the newest sample.
Tuned: samples; 3 to 10; shown by `pytest tests/gcs_formation/estimation`."""


class VehicleFilter:
    """The filter of one vehicle."""

    def __init__(self, noise: VehicleNoise, wind_radps: float, telemetry_hz: float, *, updraughts: bool) -> None:
        """Start with nothing known; the arguments are those of `StateEstimator`."""
        self.noise = noise
        self.drift = PositionDrift()
        self.state: FlightState | None = None
        self.stamp = 0
        """Time stamp of the state, ns."""
        self.level = LevelCovariance((0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        self.height = HeightCovariance(0.0, 0.0)
        self.updraught = Updraught(followed=updraughts)
        self._jacobian = VelocityJacobian()
        """The Jacobian of the velocity over ground at the present state."""
        self.wind_radps = wind_radps
        """Highest bandwidth of the wind estimate for changes that aren't gusts, rad/s."""
        self._airspeed_ratio = 1.0
        self._root_hz = math.sqrt(telemetry_hz)
        self._residual: Values = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._implausible = 0
        self._large_gust: LargeGust | None = None

    def place(self, state: FlightState, stamp: int) -> None:
        """Set the state."""
        self.state, self.stamp = state, stamp
        self._jacobian.linearise(state)

    def use_airspeed_ratio(self, ratio: float) -> None:
        """Use another airspeed ratio: the state's airspeed and wind change, its velocity over ground doesn't."""
        if ratio == self._airspeed_ratio:
            return
        if self.state is not None:
            state = self.state.copy()
            faster_mps = (ratio / self._airspeed_ratio - 1.0) * state.airspeed_mps
            state.airspeed_mps += faster_mps
            state.wind_north_mps -= faster_mps * math.cos(state.heading_rad)
            state.wind_east_mps -= faster_mps * math.sin(state.heading_rad)
            self.place(state, self.stamp)
        self._airspeed_ratio = ratio

    def initialise(self, values: Values, stamp: int) -> None:
        """Start from a single sample."""
        wind = self._first_wind_variance(values[6])
        self._begin(values, stamp, self._wind_of(values), (wind, wind))

    def _begin(self, values: Values, stamp: int, winds: tuple[float, float], variances: tuple[float, float]) -> None:
        """Start from a single sample, with a wind north and east and its variances."""
        noise, airspeed_mps, heading_rad = self.noise.values, values[6], values[7]
        wind_north, wind_east = winds
        self.state = FlightState(
            values[0], values[1], values[2], values[5], airspeed_mps, heading_rad, wind_north, wind_east
        )
        self._jacobian.linearise(self.state)
        self.level = LevelCovariance((noise[0], noise[1], noise[6], noise[7], variances[0], variances[1]))
        self.height = HeightCovariance(noise[2], noise[5])
        self.updraught.clear()
        self._residual = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._implausible = 0
        self.stamp = stamp
        self.drift.initialise(values)

    def correct(
        self,
        values: Values,
        stamp: int,
        predicted: FlightState,
        model: AutopilotModel,
        *,
        commanded: bool,
    ) -> None:
        """Correct the state `predicted` for the time of a sample by the sample's values.

        `commanded`: the vehicle follows our setpoints.
        """
        elapsed_s, jacobian, before = (stamp - self.stamp) / NANOSECONDS, self._jacobian, self.state
        follows = commanded and before is not None and abs(before.climb_mps) < BEYOND_LIMIT * model.climb_max_mps
        walk = COMMANDED_WALK if follows else UNCOMMANDED_WALK
        variances = self.noise.values
        self.drift.adapt(values, elapsed_s, variances)
        self._predict_covariances(elapsed_s, model, walk)
        jacobian.linearise(predicted)
        difference = innovation(values, predicted, jacobian)
        if self.wind_radps >= GUST_RADPS:
            self._accept_gust(values, predicted, difference, elapsed_s)
        own = innovation_variances(self.level, self.height, jacobian, variances)
        self.noise.adapt(minus(difference, self._residual), own)
        excess = excesses(difference, own, elapsed_s)
        climb_mps = predicted.climb_mps
        self._move(predicted, jacobian, difference, weighed(variances, own, excess))
        self.updraught.update(predicted, predicted.climb_mps - climb_mps, self.noise.values[5], elapsed_s, model)
        predicted.airspeed_mps = max(predicted.airspeed_mps, min_mps(model))
        self.state, self.stamp = predicted, stamp
        jacobian.linearise(predicted)
        self._residual = innovation(values, predicted, jacobian)
        self._implausible = 0 if plausible(excess) else self._implausible + 1
        if self._implausible >= IMPLAUSIBLE_SAMPLES:
            # The wind estimate is kept: it doesn't depend on who flies the vehicle.
            level, winds = self.level, (predicted.wind_north_mps, predicted.wind_east_mps)
            self._begin(values, stamp, winds, (level.wind_north[WIND_NORTH], level.wind_east[WIND_EAST]))

    def _move(self, state: FlightState, jacobian: VelocityJacobian, difference: Values, variances: Values) -> None:
        """Correct a predicted state, and the covariances, by a sample's innovations and their noise variances."""
        north, east, speed, heading, wind_north, wind_east = correct_level(self.level, jacobian, difference, variances)
        up, climb = correct_height(self.height, difference, variances)
        state.north_m += north
        state.east_m += east
        state.height_m += up
        state.climb_mps += climb
        state.airspeed_mps += speed
        state.heading_rad = wrap(state.heading_rad + heading)
        state.wind_north_mps += wind_north
        state.wind_east_mps += wind_east

    @property
    def wind_variance(self) -> float:
        """Variance of each component of the wind, (m/s)²."""
        return (self.level.wind_north[WIND_NORTH] + self.level.wind_east[WIND_EAST]) / 2

    @property
    def course_sigma_rad(self) -> float:
        """Standard deviation of the course over ground, less the part by airspeed; 0 where no filter runs, rad."""
        if self.state is None:
            return 0.0
        across = self.wind_variance / squared(max(self.state.airspeed_mps, MIN_AIRSPEED_MPS))
        return math.sqrt(self.level.heading[HEADING] + across)

    def _predict_covariances(self, elapsed_s: float, model: AutopilotModel, walk: tuple[float, float, float]) -> None:
        """Predict the covariances for the time of a sample."""
        variances = self.noise.values
        climb, speed, heading = walk
        self.level.predict(self._jacobian, elapsed_s, model)
        self.height.predict(elapsed_s, model)
        of_position, wind = squared(WITHOUT_WIND), 0.0
        if self.wind_radps > 0.0:
            of_position, noise_mps = self.drift.variance, math.sqrt(variances[3] + variances[6])
            wind = min(WIND_WALK, self.wind_radps * noise_mps / self._root_hz)
        of_wind = squared(wind)
        self.level.grow((of_position, of_position, squared(speed), squared(heading), of_wind, of_wind), elapsed_s)
        self.height.climb += squared(climb) * elapsed_s

    def _wind_of(self, values: Values) -> tuple[float, float]:
        """Return the wind that a single sample shows."""
        if self.wind_radps <= 0.0:
            return 0.0, 0.0
        airspeed_mps, heading_rad = values[6], values[7]
        return values[3] - airspeed_mps * math.cos(heading_rad), values[4] - airspeed_mps * math.sin(heading_rad)

    def _first_wind_variance(self, airspeed_mps: float) -> float:
        """Return the initial variance of the wind: that of the first sample's wind, or less for a slow estimate.

        Starting with the sample's own variance, a slow estimate would follow the next samples as fast as a fast one for
        its first seconds.
        """
        if self.wind_radps <= 0.0:
            return 0.0
        sample = self._wind_noise(airspeed_mps)
        if self.wind_radps >= GUST_RADPS:
            return sample
        variances = self.noise.values
        return min(sample, max(FIRST_WIND_RADPS, self.wind_radps) * (variances[3] + variances[6]) / self._root_hz**2)

    def _wind_noise(self, airspeed_mps: float) -> float:
        """Return the variance of a component of the wind that one sample shows, (m/s)²."""
        variances = self.noise.values
        return variances[3] + variances[6] + squared(airspeed_mps) * variances[7]

    def _accept_gust(self, values: Values, predicted: FlightState, difference: Values, elapsed_s: float) -> None:
        """Raise the wind's variance where a sample shows a gust.

        One that is too large to be plausible is accepted once the next sample shows it too, has moved with it, and has
        neither airspeed nor heading that would explain it: then it isn't an outlier.
        """
        north_mps, east_mps = self._wind_of(values)
        size = (squared(north_mps - predicted.wind_north_mps) + squared(east_mps - predicted.wind_east_mps)) / 2
        noise = self._wind_noise(values[6])
        known = noise + self.level.wind_north[WIND_NORTH]
        shown, self._large_gust = self._large_gust, None
        if size >= IMPLAUSIBLE_SIGMAS**2 * UNKNOWN_MOTION:
            now = LargeGust(north_mps, east_mps, values[0], values[1])
            if explained(difference) or not (shown is not None and now.repeats(shown, values, noise, elapsed_s)):
                self._large_gust = None if explained(difference) else now
                return
        if size > GUST_SIGMAS**2 * known:
            self.level.gust(size, elapsed_s)


def min_mps(model: AutopilotModel) -> float:
    """Return the lower bound of a vehicle's airspeeds; one that can hover may drift backwards."""
    return -model.speed_max_mps if model.may_hover else MIN_AIRSPEED_MPS
