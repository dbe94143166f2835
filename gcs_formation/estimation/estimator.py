"""The state of every vehicle at its newest time stamp, on the station's clock: one Kalman filter each.

It always runs: exact telemetry is the case of small noise. It predicts by model (7) through the setpoints that were
sent, weighs a sample by the noise that it has been seen to have, and gives little to a sample that isn't plausible.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink.clock import NANOSECONDS, Instant, seconds_between
from flight_model.autopilot_model import AutopilotModel, FlightState, squared, wrap
from flight_model.gain_design import UNMODELLED, WIND_WALK
from gcs_formation.estimation.kalman import (
    WIND_EAST,
    WIND_NORTH,
    HeightCovariance,
    LevelCovariance,
    Updraught,
    VelocityJacobian,
    correct_height,
    correct_level,
    innovation,
    innovation_variances,
    minus,
)
from gcs_formation.estimation.noise_and_plausibility import (
    IMPLAUSIBLE_SIGMAS,
    STRAYED,
    PlaceStray,
    Values,
    VehicleNoise,
    excesses,
    plausible,
    weighed,
)
from gcs_formation.estimation.setpoint_history import SetpointHistory

LEAST_AIRSPEED_MPS: Final = 1.0
"""What a smaller airspeed is taken as: equations divide by it, and what can't hover has more."""
COMMANDED_WALK: Final[tuple[float, float, float]] = UNMODELLED
UNCOMMANDED_WALK: Final[tuple[float, float, float]] = (1.0, 1.0, 0.3)
"""How far climb, airspeed and heading stray, of a vehicle that is commanded by us and of one that isn't."""
BEYOND_LIMIT: Final = 1.1
"""Climbs a tenth above its limit aren't flown by our setpoints yet: so a take-off ends."""
WITHOUT_WIND: Final = 0.1
"""How far positions stray, m in a square root of a second, where the wind isn't observed."""
GUST_RADPS: Final = 1.0
"""Bandwidth of the wind's observation from which a gust is believed at once: a slower one is asked for where airspeed
lags or is off, and would show gusts that aren't there."""
GUST_SIGMAS: Final = 4.0
"""Standard deviations of the wind that a sample tells beyond which it is a gust: believed, at once."""
FIRST_WIND_RADPS: Final = 0.2
"""Bandwidth from which the wind's observation slows down to a slower one that is asked for: a first sample is off by
its whole noise, which would be flown for as long as the observation is slow."""
IMPLAUSIBLE_SAMPLES: Final = 5
"""So many in a row aren't outliers: somebody else flies the vehicle. Its state begins anew from the newest."""
FORGOTTEN_S: Final = 5.0
"""A state that is so old says nothing about the present one."""


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
        """Take the instant, the place, the velocity over ground, and the motion in the air.

        `by_course`: the vehicle is told courses over ground, and turns against the wind by itself.
        `airspeed_ratio`: the airspeed by what its sensor read.
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

    def values(self, least_mps: float) -> Values:
        """Return what was measured, in the order of the constructor's arguments; the airspeed no less than a limit."""
        return (
            self.north_m,
            self.east_m,
            self.height_m,
            self.north_mps,
            self.east_mps,
            self.climb_mps,
            max(self.airspeed_mps, least_mps),
            self.heading_rad,
        )


def heading_shown(state: FlightState, north_mps: float, east_mps: float) -> float:
    """Return the heading that a velocity over ground shows of a vehicle in the wind that is known of its `state`.

    What is told courses turns against a gust by itself, before the wind's estimate has it.
    """
    known_north_mps, known_east_mps = state.ground_mps()
    crabbed_rad = math.atan2(known_east_mps, known_north_mps) - state.heading_rad
    return wrap(math.atan2(east_mps, north_mps) - crabbed_rad)


class VehicleFilter:
    """The filter of one vehicle."""

    def __init__(self, noise: VehicleNoise, wind_radps: float, telemetry_hz: float, *, updraughts: bool) -> None:
        """Start with nothing known; the arguments are those of `StateEstimator`."""
        self.noise = noise
        self.stray = PlaceStray()
        self.state: FlightState | None = None
        self.stamp = 0
        """Of the state, ns."""
        self.level = LevelCovariance((0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        self.height = HeightCovariance(0.0, 0.0)
        self.updraught = Updraught(followed=updraughts)
        self._along = VelocityJacobian()
        """The Jacobian of the velocity over ground at the present state."""
        self.wind_radps = wind_radps
        """The highest rate, rad/s, at which the wind's estimate follows what isn't a gust."""
        self._airspeed_ratio = 1.0
        self._root_hz = math.sqrt(telemetry_hz)
        self._residual: Values = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._implausible = 0

    def place(self, state: FlightState, stamp: int) -> None:
        """Set the state."""
        self.state, self.stamp = state, stamp
        self._along.linearise(state)

    def read_by(self, ratio: float) -> None:
        """Take airspeeds as `ratio` times the readings from now on: the wind is another, the ground velocity isn't."""
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

    def begin(self, values: Values, stamp: int) -> None:
        """Start from a single sample."""
        wind = self._first_wind_variance(values[6])
        self._begin(values, stamp, self._wind_of(values), (wind, wind))

    def _begin(self, values: Values, stamp: int, winds: tuple[float, float], variances: tuple[float, float]) -> None:
        """Start from a single sample, with a wind north and east of these variances."""
        noise, airspeed_mps, heading_rad = self.noise.values, values[6], values[7]
        wind_north, wind_east = winds
        self.state = FlightState(
            values[0], values[1], values[2], values[5], airspeed_mps, heading_rad, wind_north, wind_east
        )
        self._along.linearise(self.state)
        self.level = LevelCovariance((noise[0], noise[1], noise[6], noise[7], variances[0], variances[1]))
        self.height = HeightCovariance(noise[2], noise[5])
        self.updraught.forget()
        self._residual = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._implausible = 0
        self.stamp = stamp
        self.stray.begin(values)

    def correct(
        self,
        values: Values,
        stamp: int,
        predicted: FlightState,
        model: AutopilotModel,
        *,
        commanded: bool,
    ) -> None:
        """Correct the state `predicted` for the time of a sample by its values; `commanded`: by our setpoints."""
        elapsed_s, along, before = (stamp - self.stamp) / NANOSECONDS, self._along, self.state
        follows = commanded and before is not None and abs(before.climb_mps) < BEYOND_LIMIT * model.climb_max_mps
        walk = COMMANDED_WALK if follows else UNCOMMANDED_WALK
        variances = self.noise.values
        self.stray.learn(values, elapsed_s, variances)
        self._carry(elapsed_s, model, walk)
        along.linearise(predicted)
        difference = innovation(values, predicted, along)
        if self.wind_radps >= GUST_RADPS:
            self._believe_gust(values, predicted, elapsed_s)
        own = innovation_variances(self.level, self.height, along, variances)
        self.noise.learn(minus(difference, self._residual), own)
        excess = excesses(difference, own, elapsed_s)
        climb_mps = predicted.climb_mps
        self._move(predicted, along, difference, weighed(variances, own, excess))
        self.updraught.feel(predicted, predicted.climb_mps - climb_mps, self.noise.values[5], elapsed_s, model)
        predicted.airspeed_mps = max(predicted.airspeed_mps, _least_mps(model))
        self.state, self.stamp = predicted, stamp
        along.linearise(predicted)
        self._residual = innovation(values, predicted, along)
        self._implausible = 0 if plausible(excess) else self._implausible + 1
        if self._implausible >= IMPLAUSIBLE_SAMPLES:
            # Whoever flies the vehicle, the wind is what it was.
            level, winds = self.level, (predicted.wind_north_mps, predicted.wind_east_mps)
            self._begin(values, stamp, winds, (level.wind_north[WIND_NORTH], level.wind_east[WIND_EAST]))

    def _move(self, state: FlightState, along: VelocityJacobian, difference: Values, variances: Values) -> None:
        """Move a predicted state to where a sample's values, of such noise, have it; the covariances shrink."""
        north, east, speed, heading, wind_north, wind_east = correct_level(self.level, along, difference, variances)
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
        """Of each component of the wind, (m/s)²."""
        return (self.level.wind_north[WIND_NORTH] + self.level.wind_east[WIND_EAST]) / 2

    def _carry(self, elapsed_s: float, model: AutopilotModel, walk: tuple[float, float, float]) -> None:
        """Carry the covariances on to the time of a sample."""
        variances = self.noise.values
        climb, speed, heading = walk
        self.level.carry(self._along, elapsed_s, model)
        self.height.carry(elapsed_s, model)
        of_place, wind = squared(WITHOUT_WIND), 0.0
        if self.wind_radps > 0.0:
            of_place, noise_mps = self.stray.variance, math.sqrt(variances[3] + variances[6])
            wind = min(WIND_WALK, self.wind_radps * noise_mps / self._root_hz)
        of_wind = squared(wind)
        self.level.grow((of_place, of_place, squared(speed), squared(heading), of_wind, of_wind), elapsed_s)
        self.height.climb += squared(climb) * elapsed_s

    def _wind_of(self, values: Values) -> tuple[float, float]:
        """Return the wind that a sample tells by itself."""
        if self.wind_radps <= 0.0:
            return 0.0, 0.0
        airspeed_mps, heading_rad = values[6], values[7]
        return values[3] - airspeed_mps * math.cos(heading_rad), values[4] - airspeed_mps * math.sin(heading_rad)

    def _first_wind_variance(self, airspeed_mps: float) -> float:
        """Return the variance of the wind that a first sample tells: its own, or that of an estimate that is slow.

        An estimate that begins with a sample's own follows the next ones at once: for its first seconds it would be as
        fast as those asked not to have that lag.
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

    def _believe_gust(self, values: Values, predicted: FlightState, elapsed_s: float) -> None:
        """Let the wind be uncertain where a sample tells of one that has changed at once."""
        north_mps, east_mps = self._wind_of(values)
        size = (squared(north_mps - predicted.wind_north_mps) + squared(east_mps - predicted.wind_east_mps)) / 2
        known = self._wind_noise(values[6]) + self.level.wind_north[WIND_NORTH]
        if GUST_SIGMAS**2 * known < size < IMPLAUSIBLE_SIGMAS**2 * STRAYED:
            self.level.gust(size, elapsed_s)


class StateEstimator:
    """The filters of C columns, one for each vehicle."""

    def __init__(
        self,
        noise: list[VehicleNoise],
        history: SetpointHistory,
        telemetry_hz: float,
        wind_radps: float,
        *,
        updraughts: bool = True,
    ) -> None:
        """Start with nothing known.

        Args:
            noise: of the columns' telemetry, (C,).
            history: the setpoints that were sent to them.
            telemetry_hz: samples a second.
            wind_radps: the most that the wind's estimate follows anything but gusts; 0: the wind stays 0.
            updraughts: whether what carries them up or down is followed; else it stays 0.
        """
        self.filters = [VehicleFilter(each, wind_radps, telemetry_hz, updraughts=updraughts) for each in noise]
        """Every column's, with its newest state."""
        self._history = history

    def observe_wind(self, wind_radps: float) -> None:
        """Follow the wind at most so fast from now on."""
        for each in self.filters:
            each.wind_radps = wind_radps

    @property
    def sway_m(self) -> float:
        """How far air that rises and sinks moves the one that it moves farthest, a standard deviation."""
        return math.sqrt(max([each.updraught.sway_m2 for each in self.filters]))

    def age_s(self, column: int, now: Instant) -> float:
        """Return how old a column's state is, in s; NaN when it has none."""
        each = self.filters[column]
        return math.nan if each.state is None else seconds_between(Instant(each.stamp), now)

    def forget(self, column: int) -> None:
        """Forget a vehicle that has restarted."""
        self.filters[column].state = None
        self.filters[column].noise.begin()
        self.filters[column].stray = PlaceStray()

    def place(self, column: int, state: FlightState, stamp: Instant) -> None:
        """Set a column's state."""
        self.filters[column].place(state, stamp)

    def take(self, samples: list[Sample | None], models: list[AutopilotModel], commanded: list[bool]) -> None:
        """Take the newest samples of those that have one, all (C,); who is `commanded` follows our setpoints.

        All are predicted, then all are corrected: the code of both wouldn't stay in a processor's first cache.
        """
        predicted = [
            None if sample is None else self._predict(column, sample, models[column])
            for column, sample in enumerate(samples)
        ]
        for column, state in enumerate(predicted):
            sample = samples[column]
            if state is not None and sample is not None:
                each, model = self.filters[column], models[column]
                stamp, values = max(int(sample.stamp), each.stamp), sample.values(_least_mps(model))
                each.correct(values, stamp, state, model, commanded=commanded[column])

    def _predict(self, column: int, sample: Sample, model: AutopilotModel) -> FlightState | None:
        """Return a column's state at its newest sample; None where it begins with that sample."""
        each, stamp = self.filters[column], int(sample.stamp)
        each.read_by(sample.airspeed_ratio)
        state = each.state
        if state is None or self._history.empty or (stamp - each.stamp) / NANOSECONDS > FORGOTTEN_S:
            each.begin(sample.values(_least_mps(model)), stamp)
            return None
        predicted = state.copy()
        self._history.carry(predicted, each.stamp, max(stamp, each.stamp), column, model)
        return predicted


def _least_mps(model: AutopilotModel) -> float:
    """Return what a smaller airspeed is taken as; what can stand may drift backwards."""
    return -model.speed_max_mps if model.may_stand else LEAST_AIRSPEED_MPS
