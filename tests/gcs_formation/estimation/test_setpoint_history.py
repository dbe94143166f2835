"""Which setpoint acts when, for how long it is remembered, and how a vehicle answers several."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from gcs_formation.estimation.setpoint_history import SentSetpoints, SetpointHistory

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 99.0, 99.0, 99.0)
"""Its rates aren't limited."""
MS = 1_000_000
LEFT = {each: math.exp(-0.2 / tau_s) for each, tau_s in (("speed", 4.0), ("heading", 1.5))}
"""What the lags leave of a step after 0.2 s."""


def flying(north_m: float = 0.0) -> FlightState:
    return FlightState(north_m, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)


def sent(*setpoints: tuple[int, Vector3], rate_hz: float = 10.0) -> SetpointHistory:
    """Return a history with setpoints for one vehicle, each with the time at which it acts, ms."""
    history = SetpointHistory(rate_hz)
    for acts_ms, setpoint in setpoints:
        history.begin_tick(vec[i64]([acts_ms * MS]))
        history.record([setpoint])
    return history


def numbered(acts_ms: list[int], rate_hz: float) -> SetpointHistory:
    """Return a history in which a setpoint's values tell its number."""
    each = ((acts, (float(number), 0.001 * number, 2.0 * number)) for number, acts in enumerate(acts_ms))
    return sent(*each, rate_hz=rate_hz)


@given(st.lists(st.integers(1, 300), min_size=1, max_size=45), st.integers(-200, 9000), st.integers(0, 400))
@settings(max_examples=30)
def test_the_newest_setpoint_that_acts_is_commanded_or_the_oldest_kept(
    after_ms: list[int], instant_ms: int, behind_ms: int
) -> None:
    """Of 16 that are kept, at any time; later ones are found from one that acts already."""
    acts_ms = np.cumsum(after_ms).tolist()
    history = numbered(acts_ms, 16.0 / 6.0)
    kept = range(max(0, len(acts_ms) - 16), len(acts_ms))

    def number(at_ms: int) -> float:
        return max((each for each in kept if acts_ms[each] <= at_ms), default=kept[0])

    if len(acts_ms) >= 16 or instant_ms >= acts_ms[0]:
        expected = number(instant_ms)
        assert history.commanded(instant_ms * MS, 0) == (expected, 0.001 * expected, 2.0 * expected)
        one = history.of(0)
        found = one.later(one.acting((instant_ms - behind_ms) * MS), instant_ms * MS)
        if len(acts_ms) >= 16 or instant_ms - behind_ms >= acts_ms[0]:
            assert one.at(found)[0] == expected
    else:
        assert math.isnan(history.commanded(instant_ms * MS, 0)[0])


@pytest.mark.parametrize(("rate_hz", "ticks"), [(10.0, 60), (50.0, 300), (2.0, 12), (1.0, 8), (0.2, 8)])
def test_six_seconds_are_kept_and_at_least_eight_ticks(rate_hz: float, ticks: int) -> None:
    assert SetpointHistory(rate_hz).length == ticks


def test_a_tick_commands_straight_flight_until_its_setpoint_is_recorded() -> None:
    history = SetpointHistory(10.0)
    assert history.empty
    history.begin_tick(vec[i64]([0, 0]))
    assert not history.empty
    for vehicle in (0, 1):
        np.testing.assert_equal(history.commanded(1, vehicle), (math.nan,) * 3)
    history.record([(22.0, 0.1, 100.0), (24.0, 0.2, 101.0)])
    assert [history.commanded(1, vehicle) for vehicle in (0, 1)] == [(22.0, 0.1, 100.0), (24.0, 0.2, 101.0)]


@given(
    st.lists(st.tuples(st.integers(1, 150), st.floats(16.0, 28.0), st.floats(-0.5, 0.5)), min_size=2, max_size=8),
    st.integers(1, 500),
)
@settings(max_examples=30)
def test_a_mean_is_weighted_by_how_long_each_acts(pieces: list[tuple[int, float, float]], over_ms: int) -> None:
    """From when the first one acts; headings around south, where they jump by a whole turn."""
    acts_ms = np.cumsum([after_ms for after_ms, _, _ in pieces]).tolist()
    speeds = [speed_mps for _, speed_mps, _ in pieces]
    headings = [math.pi + off_rad for _, _, off_rad in pieces]
    wrapped = [math.remainder(heading_rad, math.tau) for heading_rad in headings]
    each = zip(acts_ms, zip(speeds, wrapped, (10.0 * speed for speed in speeds), strict=True), strict=True)
    since_ms, until_ms = acts_ms[0], acts_ms[0] + over_ms
    ends_ms = [min(end_ms, until_ms) for end_ms in (*acts_ms[1:], until_ms)]
    lasts = [max(0, end_ms - begin_ms) / over_ms for begin_ms, end_ms in zip(acts_ms, ends_ms, strict=True)]
    one = sent(*each).of(0)
    speed_mps, heading_rad, height_m = one.mean(one.acting(since_ms * MS), since_ms * MS, until_ms * MS)
    assert speed_mps == pytest.approx(np.dot(lasts, speeds))
    assert height_m == pytest.approx(10.0 * np.dot(lasts, speeds))
    assert math.remainder(heading_rad - np.dot(lasts, headings), math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_setpoint_that_overtakes_the_one_before_takes_its_place() -> None:
    """The second acts at 0.3 s, the third at 0.2 s already: from 0.1 s the first acts for 0.2 s, then the third."""
    history = sent((0, (20.0, 0.0, 100.0)), (300, (99.0, 2.0, 999.0)), (200, (24.0, 0.0, 100.0)))
    assert history.commanded(250 * MS, 0)[0] == 24.0
    one = history.of(0)
    assert one.mean(one.acting(100 * MS), 100 * MS, 500 * MS)[0] == pytest.approx((20.0 + 24.0) / 2.0)
    state = flying()
    history.carry(state, 100 * MS, 500 * MS, 0, MODEL)
    first_mps = 20.0 + 2.0 * math.exp(-0.2 / 4.0)
    assert state.airspeed_mps == pytest.approx(24.0 - (24.0 - first_mps) * LEFT["speed"])


@pytest.mark.parametrize(("commanded_mps", "reached_mps"), [(99.0, 28.0), (28.0, 28.0), (16.0, 16.0), (0.0, 16.0)])
def test_airspeeds_are_answered_within_the_vehicle_s_limits(commanded_mps: float, reached_mps: float) -> None:
    history = sent((0, (commanded_mps, 0.0, 100.0)))
    for predict in (history.carry, history.respond):
        state = flying()
        predict(state, 0, 200 * MS, 0, MODEL)
        assert state.airspeed_mps == pytest.approx(reached_mps + (22.0 - reached_mps) * LEFT["speed"])


def test_a_coarse_response_answers_the_means_of_equal_steps_of_at_most_280_ms() -> None:
    """600 ms are three steps: the means of speed are 24, 25 and 27 m/s, those of the heading a tenth of 2, 3, 5 rad."""
    history = sent(
        *((9000 + 100 * tick, (24.0 + rise, 0.2 + 0.1 * rise, 100.0)) for tick, rise in enumerate((0, 0, 0, 2, 3, 3)))
    )
    state, speed_mps, heading_rad = flying(7.0), 22.0, 0.0
    history.respond(state, 9000 * MS, 9600 * MS, 0, MODEL)
    for rise in (0.0, 1.0, 3.0):
        speed_mps = 24.0 + rise - (24.0 + rise - speed_mps) * LEFT["speed"]
        heading_rad = 0.2 + 0.1 * rise - (0.2 + 0.1 * rise - heading_rad) * LEFT["heading"]
    assert state.airspeed_mps == pytest.approx(speed_mps)
    assert state.heading_rad == pytest.approx(heading_rad)
    assert (state.north_m, state.east_m) == (7.0, 0.0)


@pytest.mark.parametrize(("over_ms", "steps"), [(278, 1), (280, 2), (282, 2)])
def test_a_step_becomes_two_at_280_ms(over_ms: int, steps: int) -> None:
    """The setpoint changes from 22 to 26 m/s in the middle: one step answers 24 m/s, two answer 22, then 26."""
    history = sent((9000, (22.0, 0.0, 100.0)), (9000 + over_ms // 2, (26.0, 0.0, 100.0)))
    state = flying()
    history.respond(state, 9000 * MS, (9000 + over_ms) * MS, 0, MODEL)
    once_mps = 24.0 - 2.0 * math.exp(-0.001 * over_ms / 4.0)
    twice_mps = 26.0 - 4.0 * math.exp(-0.0005 * over_ms / 4.0)
    assert state.airspeed_mps == pytest.approx(once_mps if steps == 1 else twice_mps, abs=1e-9)


def test_a_setpoint_that_is_not_known_yet_changes_nothing_before_it_acts() -> None:
    """Until the instant at which it does, the one before is answered."""
    history, state = sent((0, (26.0, 0.3, 100.0))), flying()
    history.begin_tick(vec[i64]([200 * MS]))
    history.respond(state, 0, 200 * MS, 0, MODEL)
    assert state.airspeed_mps == pytest.approx(26.0 - 4.0 * LEFT["speed"])
    assert state.heading_rad == pytest.approx(0.3 - 0.3 * LEFT["heading"])


def test_a_multirotor_answers_by_its_velocity_over_ground() -> None:
    """Commanded 6 m/s to the east, half of the difference from 6 m/s to the north is left after 2.8 s of 4 s."""
    model = AutopilotModel(4.0, 1.5, 1.0, 3.0, 0.0, 12.0, 99.0, 99.0, 99.0)
    history, state = sent((0, (6.0, math.pi / 2, 100.0))), FlightState(7.0, 8.0, 100.0, 0.0, 4.0, 0.0, 2.0, 0.0)
    history.respond(state, 0, round(4.0 * math.log(2.0) * NANOSECONDS), 0, model)
    assert (state.airspeed_mps, state.heading_rad) == pytest.approx((3.0 * math.sqrt(2.0), math.pi / 4))
    assert (state.north_m, state.east_m, state.wind_north_mps, state.wind_east_mps) == (7.0, 8.0, 0.0, 0.0)


def test_before_anything_is_sent_nothing_is_predicted_and_each_vehicle_has_its_own() -> None:
    history, state = SetpointHistory(10.0), flying()
    history.carry(state, 0, NANOSECONDS, 0, MODEL)
    history.respond(state, 0, NANOSECONDS, 0, MODEL)
    assert state.values() == flying().values()
    history.begin_tick(vec[i64]([0, 100 * MS]))
    history.record([(20.0, 0.0, 100.0), (26.0, 0.0, 100.0)])
    for vehicle, (speed_mps, acts_s) in enumerate(((20.0, 0.0), (26.0, 0.1))):
        state = flying()
        history.carry(state, 0, NANOSECONDS, vehicle, MODEL)
        assert state.airspeed_mps == pytest.approx(speed_mps + (22.0 - speed_mps) * math.exp((acts_s - 1.0) / 4.0))


def test_a_prediction_over_no_time_changes_nothing() -> None:
    """Also where the stamp went back."""
    history = sent((0, (26.0, 1.0, 120.0)), (100, (16.0, -1.0, 80.0)))
    for until in (150 * MS, 50 * MS):
        state = flying()
        history.carry(state, 150 * MS, until, 0, MODEL)
        assert state.values() == flying().values()


def test_the_oldest_setpoints_are_the_first_to_be_forgotten() -> None:
    one = SentSetpoints(8)
    for number in range(50):
        one.begin_tick(10 * number)
        one.record((float(number), 0.0, 0.0))
        assert one.at(one.acting(10 * number))[0] == one.at(one.later(one.first, 10 * number))[0] == number
        if number >= 8:
            assert [one.at(index)[0] for index in range(one.first, one.end)] == list(range(number - 7, number + 1))
