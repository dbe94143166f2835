"""One vehicle's filter: what it starts with, how it takes winds and gusts, and when it begins again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.estimation.estimator import StateEstimator
from gcs_formation.estimation.kalman import LevelCovariance
from gcs_formation.estimation.noise_and_plausibility import Quantities, Values, VehicleNoise
from gcs_formation.estimation.sample import Sample
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.estimation.vehicle_filter import VehicleFilter, min_mps

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
HOVERS = AutopilotModel(4.0, 1.5, 1.0, 3.0, 0.0, 12.0, 1.5, 0.25, 3.0)
NOISE: Quantities = (0.3, 0.4, 0.1, 0.2, 0.5, 0.01)
"""Of positions, heights, velocities, climbs, airspeeds and headings."""
FINE: Quantities = (0.003, 0.001, 0.003, 0.003, 0.001, 0.0001)
MS = 1_000_000

headings = st.floats(-math.pi, math.pi)
winds = st.floats(-12.0, 12.0)


def a_filter(wind_radps: float = 2.0, noise: Quantities = NOISE, telemetry_hz: float = 10.0) -> VehicleFilter:
    return VehicleFilter(VehicleNoise(noise, noise), wind_radps, telemetry_hz, updraughts=True)


def flying(speed_mps: float = 20.0, heading_rad: float = 0.5, climb_mps: float = 0.0) -> FlightState:
    return FlightState(7.0, -8.0, 100.0, climb_mps, speed_mps, heading_rad, 3.0, -2.0)


def seen(state: FlightState, *off: float) -> Values:
    """Return the exact sample of a state, plus errors of its first values."""
    north_mps, east_mps = state.ground_mps()
    exact = state.north_m, state.east_m, state.height_m, north_mps, east_mps, state.climb_mps
    whole = np.array((*exact, state.airspeed_mps, state.heading_rad))
    whole[: len(off)] += off
    a, b, c, d, e, f, g, h = whole.tolist()
    return a, b, c, d, e, f, g, h


def begun(one: VehicleFilter, state: FlightState) -> VehicleFilter:
    one.initialise(seen(state), 0)
    return one


def state_of(one: VehicleFilter) -> FlightState:
    assert one.state is not None
    return one.state


def correct(one: VehicleFilter, values: Values, predicted: FlightState, *, elapsed_ms: int = 100) -> FlightState:
    """Correct a prediction that nothing commanded, and return the state."""
    one.correct(values, one.stamp + elapsed_ms * MS, predicted.copy(), MODEL, commanded=True)
    return state_of(one)


@given(winds, winds, st.floats(5.0, 40.0), headings)
@settings(max_examples=20)
def test_a_filter_starts_with_the_wind_triangle_of_its_first_sample(
    north_mps: float, east_mps: float, speed_mps: float, heading_rad: float
) -> None:
    """In all quadrants; each variance is the noise, the wind's that of velocity, airspeed and heading together."""
    state = FlightState(1.0, 2.0, 3.0, 0.5, speed_mps, heading_rad, north_mps, east_mps)
    one = begun(a_filter(), state)
    assert state_of(one).values() == pytest.approx(state.values())
    wind = 0.1**2 + 0.5**2 + (0.01 * speed_mps) ** 2
    level, expected = one.level, LevelCovariance((0.09, 0.09, 0.25, 1e-4, wind, wind))
    for name in ("north", "east", "speed", "heading", "wind_north", "wind_east"):
        assert getattr(level, name) == pytest.approx(getattr(expected, name))
    assert (one.height.height, one.height.cross, one.height.climb) == pytest.approx((0.16, 0.0, 0.04))
    assert one.wind_variance == pytest.approx(wind)


def test_where_no_wind_is_estimated_there_is_none() -> None:
    one = begun(a_filter(0.0), flying())
    assert (state_of(one).wind_north_mps, state_of(one).wind_east_mps, one.wind_variance) == (0.0, 0.0, 0.0)


def test_the_course_is_known_by_heading_and_by_the_wind_across_at_the_airspeed() -> None:
    """0.03 rad of heading and 0.8 m/s at 20 m/s, so 0.04 rad, are 0.05 rad: 3, 4 and 5. Nothing is known at first."""
    one = a_filter()
    assert one.course_sigma_rad == 0.0
    one.place(flying(20.0), 0)
    one.level = LevelCovariance((0.0, 0.0, 0.0, 0.03**2, 0.5, 2.0 * 0.8**2 - 0.5))
    assert one.wind_variance == pytest.approx(0.8**2)
    assert one.course_sigma_rad == pytest.approx(0.05)
    one.place(flying(0.2), 0)
    assert one.course_sigma_rad == pytest.approx(math.hypot(0.03, 0.8)), "as at 1 m/s"


@given(winds, winds, headings, st.floats(0.7, 1.4), st.floats(0.7, 1.4))
@settings(max_examples=20)
def test_another_airspeed_ratio_changes_airspeed_and_wind_and_not_the_velocity_over_ground(
    north_mps: float, east_mps: float, heading_rad: float, ratio: float, later: float
) -> None:
    """One after another too; also before there is a state."""
    one = a_filter()
    one.use_airspeed_ratio(ratio)
    one.place(FlightState(1.0, 2.0, 100.0, 0.0, 20.0 * ratio, heading_rad, north_mps, east_mps), 5)
    before = state_of(one)
    one.use_airspeed_ratio(later)
    after = state_of(one)
    assert after.airspeed_mps == pytest.approx(20.0 * later)
    assert after.ground_mps() == pytest.approx(before.ground_mps())
    assert (one.stamp, after.heading_rad, after.north_m, after.east_m) == (5, heading_rad, 1.0, 2.0)
    assert one._jacobian.east_by_heading == pytest.approx(after.airspeed_mps * math.cos(heading_rad))
    one.use_airspeed_ratio(later)
    assert one.state is after


@pytest.mark.parametrize(
    ("climb_mps", "commanded", "follows"),
    [
        (3.2, True, True),
        (-3.2, True, True),
        (1.1 * 3.0, True, False),
        (3.4, True, False),
        (-3.4, True, False),
        (0.0, False, False),
    ],
)
def test_who_climbs_a_tenth_faster_than_its_limit_does_not_follow_setpoints_yet(
    climb_mps: float, commanded: bool, follows: bool
) -> None:
    """Then climb, airspeed and heading walk by 1 m/s, 1 m/s and 0.3 rad per √s instead of 0.05, 0.05 and 0.003."""
    one, state = begun(a_filter(noise=(1e3, 1e3, 1e3, 1e3, 1e3, 0.49)), flying(climb_mps=climb_mps)), flying()
    still = LevelCovariance((0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    one.level, one.height.height, one.height.climb = still, 0.0, 0.0
    one.correct(seen(state), 100 * MS, state.copy(), MODEL, commanded=commanded)
    climb, speed, heading = (0.05, 0.05, 0.003) if follows else (1.0, 1.0, 0.3)
    assert one.height.climb == pytest.approx(0.1 * climb**2, rel=1e-3)
    assert one.level.speed[2] == pytest.approx(0.1 * speed**2, rel=1e-3)
    assert one.level.heading[3] == pytest.approx(0.1 * heading**2, rel=5e-2)


@pytest.mark.parametrize(
    ("wind_radps", "telemetry_hz", "walk_mps", "walk_m"),
    [(0.1, 25.0, 0.1 * 0.5 / 5.0, 0.0), (2.0, 25.0, 0.02, 0.0), (0.1, 4.0, 0.02, 0.0), (0.0, 25.0, 0.0, 0.1)],
)
def test_the_wind_walks_as_its_bandwidth_wants_and_positions_where_there_is_none(
    wind_radps: float, telemetry_hz: float, walk_mps: float, walk_m: float
) -> None:
    """Velocity and airspeed have 0.3 and 0.4 m/s of noise, 0.5 together; at most 0.02 m/s per √s."""
    one = begun(a_filter(wind_radps, (1e3, 1e3, 0.3, 1e3, 0.4, 0.49), telemetry_hz), flying())
    one.level = LevelCovariance((0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    correct(one, seen(flying()), flying(), elapsed_ms=10)
    assert one.wind_variance == pytest.approx(0.01 * walk_mps**2, rel=1e-3)
    assert (one.level.north[0], one.level.east[1]) == pytest.approx((0.01 * walk_m**2,) * 2, rel=1e-3, abs=1e-8)


STEADY_MPS = (1.5, -2.5)


def blown(one: VehicleFilter, *gusts_mps: tuple[float, float]) -> FlightState:
    """Fly at 20 m/s, heading north, in a steady wind, then in these gusts besides, one a sample."""
    place, calm = np.zeros(2), FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, *STEADY_MPS)
    one.initialise(seen(calm), 0)
    for gust in ((0.0, 0.0),) * 20 + gusts_mps:
        wind_north_mps, wind_east_mps = STEADY_MPS[0] + gust[0], STEADY_MPS[1] + gust[1]
        place += 0.1 * np.array((20.0 + wind_north_mps, wind_east_mps))
        north_m, east_m = place.tolist()
        truth = FlightState(north_m, east_m, 100.0, 0.0, 20.0, 0.0, wind_north_mps, wind_east_mps)
        predicted = state_of(one).copy()
        predicted.north_m += 0.1 * predicted.ground_mps()[0]
        predicted.east_m += 0.1 * predicted.ground_mps()[1]
        correct(one, seen(truth), predicted)
    return state_of(one)


def wind_of(state: FlightState) -> tuple[float, float]:
    return state.wind_north_mps, state.wind_east_mps


def gust_of(state: FlightState) -> tuple[float, float]:
    return state.wind_north_mps - STEADY_MPS[0], state.wind_east_mps - STEADY_MPS[1]


@pytest.mark.parametrize("gust_mps", [(0.5, 0.0), (0.0, -0.5), (2.9, -2.9), (-4.1, 0.0), (0.0, 4.1)])
def test_a_gust_is_accepted_at_once_up_to_3_mps_in_each_component_on_average(gust_mps: tuple[float, float]) -> None:
    assert gust_of(blown(a_filter(noise=FINE), gust_mps)) == pytest.approx(gust_mps, abs=0.06)


@pytest.mark.parametrize("gust_mps", [(3.1, -3.1), (-4.4, 0.0), (0.0, 4.4), (9.0, 9.0)])
def test_a_larger_one_is_accepted_from_the_second_sample_that_shows_it(gust_mps: tuple[float, float]) -> None:
    """One sample alone is an outlier, and so are two with a calm one between them."""
    for alone in ((gust_mps,), (gust_mps, (0.0, 0.0), gust_mps)):
        assert np.hypot(*gust_of(blown(a_filter(noise=FINE), *alone))) < 0.7 * np.hypot(*gust_mps)
    assert gust_of(blown(a_filter(noise=FINE), gust_mps, gust_mps)) == pytest.approx(gust_mps, abs=0.06)


@pytest.mark.parametrize(("wind_radps", "accepted"), [(1.0, True), (0.99, False)])
def test_where_the_wind_is_estimated_slowly_there_are_no_gusts(wind_radps: float, accepted: bool) -> None:
    north_mps, _ = gust_of(blown(a_filter(wind_radps, FINE), (2.0, 0.0)))
    assert (north_mps == pytest.approx(2.0, abs=0.06)) == accepted
    assert (north_mps < 1.8) != accepted


def test_a_gust_of_3_mps_in_each_component_is_too_large_for_a_single_sample() -> None:
    """The limit itself: a mean square of 9 (m/s)²."""
    one, calm = a_filter(noise=FINE), FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, 0.0, 0.0)
    one.initialise(seen(calm), 0)
    after = correct(one, seen(FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, 3.0, 3.0)), calm)
    assert max(np.abs(wind_of(after))) < 2.0


@pytest.mark.parametrize(("gust_mps", "accepted"), [(1.45, False), (1.5, True)])
def test_what_four_standard_deviations_explain_is_not_a_gust(gust_mps: float, accepted: bool) -> None:
    """Noise of 0.2 m/s of velocity and of airspeed, and 0.004 rad at 20 m/s; 0.05 (m/s)² of the wind: 0.37 m/s."""
    one = a_filter(noise=(0.003, 0.001, 0.2, 0.2, 0.2, 0.004))
    grown, add = list[float](), LevelCovariance.gust

    class Noted(LevelCovariance):
        def gust(self, variance: float, elapsed_s: float) -> None:
            grown.append(variance)
            add(self, variance, elapsed_s)

    calm = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, 0.0, 0.0)
    one.initialise(seen(calm), 0)
    one.level = Noted((1e-6, 1e-6, 0.04, 1.6e-5, 0.05, 0.05))
    correct(one, seen(FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, gust_mps, gust_mps)), calm)
    assert grown == (pytest.approx([gust_mps**2]) if accepted else [])


@pytest.mark.parametrize(("row", "again"), [(4, False), (5, True)])
def test_the_fifth_implausible_sample_in_a_row_is_where_it_begins_again(row: int, again: bool) -> None:
    """With the sample's position and noise; the wind and its variances are kept, here a larger one to the east."""
    one, calm = begun(a_filter(0.1), flying()), flying()
    for _ in range(10):
        correct(one, seen(calm), calm)
    wind_mps, values = wind_of(state_of(one)), seen(calm)
    for number in range(row):
        one.level.grow((0.0, 0.0, 0.0, 0.0, 0.0, 0.1), 1.0)
        values = seen(calm, 500.0 + 99.0 * number, -500.0)
        correct(one, values, calm)
    assert (state_of(one).north_m == values[0]) == again
    assert (state_of(one).east_m == values[1]) == again
    assert (one.level.north == (one.noise.values[0], 0.0, 0.0, 0.0, 0.0, 0.0)) == again
    assert (one._residual == (0.0,) * 8) == again
    assert wind_of(state_of(one)) == pytest.approx(wind_mps, abs=1e-2)
    assert 2.0 * one.level.wind_north[4] < one.level.wind_east[5] < 0.1, "not those of one sample"


def test_implausible_samples_are_counted_from_a_plausible_one_or_from_where_it_began_again() -> None:
    one, calm, followed = begun(a_filter(0.1), flying()), flying(), list[bool]()
    for off_m in (0.0, *[2000.0] * 4, 0.0, *[2000.0] * 10):
        followed.append(correct(one, seen(calm, off_m), calm).north_m == calm.north_m + 2000.0)
    assert [number for number, each in enumerate(followed) if each] == [10, 15]


def test_what_the_model_does_not_explain_is_the_innovation_less_the_residual_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the correction by a sample leaves of its errors is known at the next one."""
    found: list[Values] = []
    monkeypatch.setattr(VehicleNoise, "adapt", lambda _noise, increments, _own: found.append(increments))
    one, calm, off = begun(a_filter(), flying()), flying(), (0.2, -0.1, 0.3, 0.05, -0.05, 0.1, 0.2, 0.004)
    correct(one, seen(calm, *off), calm)
    assert found[0] == pytest.approx(off)
    left = np.array(seen(calm, *off)) - seen(state_of(one))
    correct(one, seen(calm, *off), calm)
    assert found[1] == pytest.approx((np.array(off) - left).tolist())
    assert one.stamp == 200 * MS


def test_a_state_that_is_set_before_any_sample_is_taken_as_exact() -> None:
    """Then a sample that is off tells of noise alone, and moves the state by no more than the model's own walk."""
    one, zero = a_filter(), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    one.place(flying(), 0)
    level, height = one.level, one.height
    assert [level.north, level.east, level.speed, level.heading, level.wind_north, level.wind_east] == [zero] * 6
    assert (height.height, height.cross, height.climb, one.course_sigma_rad) == (0.0, 0.0, 0.0, 0.0)
    assert (one._residual, one._implausible) == ((0.0,) * 8, 0)
    after = correct(one, seen(flying(), 0.3, -0.3, 0.3, 0.1, 0.1, 0.1, 0.3, 0.01), flying())
    assert after.values() == pytest.approx(flying().values(), abs=0.01)


def test_a_sample_to_begin_from_is_where_positions_and_updraughts_are_counted_from() -> None:
    """Its position is no drift, and what rose before it is forgotten."""
    one, calm = a_filter(noise=FINE), flying()
    one.updraught.update(flying(), 5.0, 1e-6, 0.1, MODEL)
    begun(one, calm)
    predicted = flying()
    predicted.north_m += 0.1 * calm.ground_mps()[0]
    predicted.east_m += 0.1 * calm.ground_mps()[1]
    after = correct(one, seen(predicted), predicted)
    assert after.updraught_mps == 0.0
    assert after.values() == pytest.approx(predicted.values())
    assert one.drift._square == pytest.approx(0.0, abs=1e-12)


def test_a_climb_that_samples_add_is_an_updraught() -> None:
    """The part of a correction that is beyond noise, of which a share of 1 - e^-0.05 is followed after 0.1 s."""
    one, calm = begun(a_filter(noise=FINE), flying()), flying()
    rising = flying(climb_mps=0.5)
    after = correct(one, seen(rising), calm)
    assert 0.4 < after.climb_mps < 0.5
    assert after.updraught_mps == pytest.approx((1.0 - math.exp(-0.05)) * after.climb_mps, rel=0.01)


def test_airspeeds_are_at_least_1_mps_unless_a_vehicle_may_drift_backwards() -> None:
    assert (min_mps(MODEL), min_mps(HOVERS)) == (1.0, -12.0)
    one, slow = begun(a_filter(), flying(1.2)), flying(1.2)
    values = seen(flying(0.0))
    for _ in range(30):
        correct(one, values, slow)
        slow = state_of(one)
    assert slow.airspeed_mps == 1.0


def an_estimator(*, sent: bool = True, count: int = 1) -> StateEstimator:
    history = SetpointHistory(10.0)
    if sent:
        history.begin_tick(vec[i64]([-(10**12)] * count))
        history.record([(20.0, 0.5, 100.0)] * count)
    return StateEstimator([VehicleNoise(NOISE, NOISE) for _ in range(count)], history, 10.0, 0.1)


def take(one: StateEstimator, at_ms: int, state: FlightState, off_m: float = 0.0, ratio: float = 1.0) -> FlightState:
    """Take a sample of the first vehicle, and return its state."""
    sample = Sample(Instant(at_ms * MS), *seen(state, off_m), airspeed_ratio=ratio)
    others = len(one.filters) - 1
    one.update_states([sample, *[None] * others], [MODEL] * (1 + others), [True] * (1 + others))
    return state_of(one.filters[0])


@pytest.mark.parametrize(("sent", "later_ms", "starts"), [(True, 5000, False), (True, 5001, True), (False, 100, True)])
def test_a_state_older_than_five_seconds_begins_again_as_does_one_without_setpoints(
    sent: bool, later_ms: int, starts: bool
) -> None:
    one = an_estimator(sent=sent)
    take(one, 0, flying())
    after = take(one, later_ms, flying(), 1000.0)
    assert (after.north_m == flying().north_m + 1000.0) == starts


def test_a_stamp_that_goes_back_a_little_does_not_take_the_state_back() -> None:
    one = an_estimator()
    take(one, 1000, flying())
    take(one, 900, flying())
    assert one.filters[0].stamp == 1000 * MS
    assert one.age_s(0, Instant(3500 * MS)) == 2.5
    take(one, 1100, flying())
    assert one.filters[0].stamp == 1100 * MS


def test_a_vehicle_that_was_not_heard_has_no_age_and_its_state_is_left() -> None:
    one = an_estimator(count=2)
    assert math.isnan(one.age_s(0, Instant(0)))
    take(one, 0, flying())
    assert one.filters[1].state is None
    one.observe_wind(0.7)
    assert [each.wind_radps for each in one.filters] == [0.7, 0.7]


def test_the_sway_is_that_of_the_vehicle_with_the_largest() -> None:
    one = an_estimator(count=3)
    for each, sway_m2 in zip(one.filters, (0.25, 9.0, 4.0), strict=True):
        each.updraught.sway_m2 = sway_m2
    assert one.sway_m == 3.0


def test_a_vehicle_that_restarted_is_unknown_with_the_noise_declared_and_without_drift() -> None:
    one = an_estimator()
    own = one.filters[0]
    for number in range(50):
        take(one, 100 * number, flying(), 0.01 * number**2)
    assert own.noise.samples > 0.0
    assert own.drift.variance > 0.0
    one.restart_filter(0)
    assert own.state is None
    assert (own.noise.sigma(), own.noise.samples, own.drift.variance) == (pytest.approx(NOISE), 0.0, 0.0)
    assert take(one, 9000, flying(), 77.0).north_m == flying().north_m + 77.0


def test_samples_tell_by_which_ratio_their_airspeed_was_computed() -> None:
    """At a ratio of 1.1 the airspeed known so far is a tenth larger, and the wind by as much less: nothing is off."""
    one, before, after = an_estimator(), flying(), flying(22.0)
    after.wind_north_mps -= 2.0 * math.cos(0.5)
    after.wind_east_mps -= 2.0 * math.sin(0.5)
    take(one, 0, before)
    assert take(one, 0, after, ratio=1.1).values() == pytest.approx(after.values())


def test_a_sample_s_airspeed_is_at_least_what_the_vehicle_flies() -> None:
    sample = Sample(Instant(5), 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.8)
    assert sample.values(1.0) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.8)
    assert sample.values(7.5) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 0.8)
    assert (sample.stamp, sample.by_course, sample.airspeed_ratio) == (5, False, 1.0)
