"""What vehicles are predicted to do that were last heard at different times, by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i64

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.estimation.projection import MeasuredStates, Pairing, Prediction
from gcs_formation.estimation.setpoint_history import SetpointHistory

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
MS = 1_000_000
SPEED_MPS = 20.0


def measured(
    states: list[FlightState], stamps_ms: list[int], acts_ms: int, active: list[bool] | None = None
) -> MeasuredStates:
    stamps, acts = vec[i64]([MS * each for each in stamps_ms]), vec[i64]([MS * acts_ms] * len(states))
    return MeasuredStates(states, stamps, active or [True] * len(states), acts)


def commanded(count: int = 2, rate_hz: float = 10.0, telemetry_hz: float = 10.0) -> Prediction:
    """Return one for vehicles that are commanded to fly north at 20 m/s."""
    history = SetpointHistory(rate_hz)
    history.begin_tick(vec[i64]([-(10**12)] * count))
    history.record([(SPEED_MPS, 0.0, 100.0)] * count)
    return Prediction(history, [MODEL] * count, telemetry_hz)


def north(north_m: float, wind: tuple[float, float] = (0.0, 0.0), east_m: float = 0.0) -> FlightState:
    return FlightState(north_m, east_m, 100.0, 0.0, SPEED_MPS, 0.0, *wind)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.integers(0, 400))
@settings(max_examples=10)
def test_a_wind_that_changes_evenly_has_carried_who_is_not_heard_like_who_is(
    north_mps2: float, east_mps2: float, ahead_ms: int
) -> None:
    """At 2 s the second was last heard at 0.8 s; two periods are usual, so it met what the first met since 1 s.

    With a wind of a t: 0.8 a for 1.2 s, and (t - 1) a more from 1 s on, which carries it by 0.5 a. After 2 s it has
    the wind 1.8 a.
    """
    one = commanded()
    for now_ms in range(0, 2100, 100):
        seen_s, stamps_ms = [0.001 * now_ms, min(0.001 * now_ms, 0.8)], [now_ms, min(now_ms, 800)]
        states = [
            north(SPEED_MPS * at_s + north_mps2 * at_s**2 / 2, (north_mps2 * at_s, east_mps2 * at_s)) for at_s in seen_s
        ]
        for state, at_s in zip(states, seen_s, strict=True):
            state.east_m = east_mps2 * at_s**2 / 2
        one.predict(measured(states, stamps_ms, now_ms + ahead_ms))
    carried_s2, later_s = 0.8**2 / 2 + 0.8 * 1.2 + 0.5, 0.001 * ahead_ms
    found = one.of(1, 0)
    assert found.north_m == pytest.approx(SPEED_MPS * (2.0 + later_s) + north_mps2 * (carried_s2 + 1.8 * later_s))
    assert found.east_m == pytest.approx(east_mps2 * (carried_s2 + 1.8 * later_s))
    assert (found.wind_north_mps, found.wind_east_mps) == pytest.approx((1.8 * north_mps2, 1.8 * east_mps2))
    own = one.of(1, 1)
    assert own.north_m == pytest.approx(SPEED_MPS * (2.0 + later_s) + north_mps2 * (0.32 + 0.8 * (1.2 + later_s)))
    assert own.wind_north_mps == pytest.approx(0.8 * north_mps2)
    assert one.instant(0) == one.instant(1) == (2000 + ahead_ms) * MS


@pytest.mark.parametrize(("telemetry_hz", "wind_mps"), [(10.0, 3.0), (5.0, 1.0), (4.0, 0.0), (20.0, 4.0)])
def test_two_telemetry_periods_between_two_vehicles_samples_are_usual(telemetry_hz: float, wind_mps: float) -> None:
    """The wind grows by 1 m/s each tick of 100 ms. At 0.5 s the second was last heard at 0 s: it met the rest."""
    one = commanded(telemetry_hz=telemetry_hz)
    for tick in range(6):
        one.predict(measured([north(0.0, (float(tick), 0.0)), north(0.0)], [100 * tick, 0], 500))
    assert one.of(1, 0).wind_north_mps == wind_mps


def numbered(
    one: Prediction, stamps_ms: list[tuple[int, int]], acts_ms: int, active: list[bool] | None = None
) -> Prediction:
    """Take ticks at which the second vehicle is 1000 m further east each time, whatever its stamp."""
    for tick, both_ms in enumerate(stamps_ms):
        states = [north(0.0), north(0.0, east_m=1000.0 * tick)]
        one.predict(measured(states, list(both_ms), acts_ms, active))
    return one


@pytest.mark.parametrize(
    ("first_ms", "tick"),
    [(300, 3), (340, 3), (360, 4), (200, 2), (-500, 0), (700, 5), (350, 4)],
)
def test_a_vehicle_is_taken_when_the_other_was_last_heard_or_at_the_nearest_sample(first_ms: int, tick: int) -> None:
    """Of two that are as near, the newer; both ways, and from there straight on at 20 m/s."""
    one = numbered(commanded(), [(first_ms, 100 * each) for each in range(6)], 800)
    found = one.of(1, 0)
    assert found.east_m == 1000.0 * tick
    assert found.north_m == pytest.approx(SPEED_MPS * (0.8 - 0.1 * tick))
    assert one.of(1, 1).east_m == 5000.0
    assert one.of(1, 1).north_m == pytest.approx(SPEED_MPS * 0.3)


def test_a_sample_that_is_repeated_does_not_hide_the_ones_before() -> None:
    """Of the repeated ones the newest is taken: it has been filtered last."""
    ticks = [(100, each) for each in (0, 100, 200, 200, 200)]
    assert numbered(commanded(), ticks, 800).of(1, 0).east_m == 1000.0
    ticks = [(200, each) for each in (0, 100, 200, 200, 200)]
    assert numbered(commanded(), ticks, 800).of(1, 0).east_m == 4000.0


def test_samples_are_kept_as_long_as_setpoints() -> None:
    """Eight ticks at 1 Hz: of 20 the oldest is the thirteenth."""
    one = numbered(commanded(rate_hz=1.0), [(0, 1000 * each) for each in range(20)], 19_000)
    assert one.of(1, 0).east_m == 12_000.0


@pytest.mark.parametrize(
    ("active", "old_ms", "flies"), [(True, 2500, True), (False, 2500, False), (False, 2001, False), (False, 2000, True)]
)
def test_who_is_not_commanded_stays_where_it_was_lost_after_two_seconds(active: bool, old_ms: int, flies: bool) -> None:
    one = commanded()
    one.predict(measured([north(0.0), north(7.0)], [5000, 5000 - old_ms], 5000, [True, active]))
    assert one.of(1, 1).north_m == pytest.approx(7.0 + (0.001 * old_ms * SPEED_MPS if flies else 0.0))


def test_setpoints_in_flight_are_answered_from_the_stamp_on() -> None:
    """27 m/s act at 0.1 s; model (7) leaves 7 e^(-0.4 / 4) m/s of the difference at 0.5 s."""
    history = SetpointHistory(10.0)
    for acts_ms, speed_mps in ((-1000, SPEED_MPS), (100, 27.0)):
        history.begin_tick(vec[i64]([acts_ms * MS]))
        history.record([(speed_mps, 0.0, 100.0)])
    one = Prediction(history, [AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 9.0, 9.0, 9.0)], 10.0)
    state = north(0.0)
    one.predict(measured([state], [0], 500))
    assert one.of(0, 0).airspeed_mps == pytest.approx(27.0 - 7.0 * math.exp(-0.1))
    assert one.of(0, 0).north_m == pytest.approx(27.0 * 0.4 + 2.0 - 7.0 * 4.0 * (1.0 - math.exp(-0.1)), abs=1e-6)
    assert state.values() == north(0.0).values()


def paired(rate_hz: float, behind_ms: int, ticks: int = 100) -> tuple[FlightState, int]:
    """Return the first vehicle's state of two, and its stamp, when the second is heard so much later."""
    pairing, found = Pairing(rate_hz), None
    for tick in range(ticks):
        now_ms = round(1000 * tick / rate_hz)
        states = [north(SPEED_MPS * 0.001 * now_ms), north(0.0)]
        found = pairing.align(measured(states, [now_ms, now_ms - behind_ms], now_ms))
    assert found is not None
    assert found.instant(0) == found.instant(1)
    return found.states[0], found.instant(0)


@pytest.mark.parametrize(
    ("rate_hz", "behind_ms", "found_ms"),
    [(10.0, 50, 50), (10.0, 5850, 5850), (10.0, 5900, 5900), (10.0, 7000, 5900), (1.0, 6500, 6500), (1.0, 9000, 7000)],
)
def test_pairs_are_found_in_the_last_six_seconds_or_eight_ticks(rate_hz: float, behind_ms: int, found_ms: int) -> None:
    """Beyond, it is the oldest sample."""
    state, _ = paired(rate_hz, behind_ms)
    assert state.north_m == pytest.approx(SPEED_MPS * (99.0 / rate_hz - 0.001 * found_ms))


def test_a_pair_is_between_the_two_samples_next_to_its_stamp() -> None:
    """Speeding up, at 0.25 s: halfway from that of 0.2 s to that of 0.3 s, not from older ones. Across south too."""
    pairing, found = Pairing(10.0), None
    for tick, heading_rad in enumerate((0.5, 2.0, 3.1, 0.2 - math.pi)):
        states = [FlightState(float(tick**2), 0.0, 100.0, 0.0, 20.0, heading_rad, 0.0, 0.0), north(0.0)]
        found = pairing.align(measured(states, [100 * tick, 250 if tick == 3 else 100 * tick], 300))
    assert found is not None
    assert found.of(0, 1).north_m == pytest.approx((4.0 + 9.0) / 2.0)
    middle_rad = (3.1 + 0.2 + math.pi) / 2.0
    assert math.remainder(found.of(0, 1).heading_rad - middle_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_of_two_samples_with_one_stamp_the_newer_is_paired() -> None:
    """It was filtered last, like a repeated message."""
    pairing = Pairing(10.0)
    pairing.align(measured([north(1.0), north(0.0)], [100, 100], 100))
    assert pairing.align(measured([north(2.0), north(0.0)], [100, 100], 200)).of(0, 1).north_m == 2.0
