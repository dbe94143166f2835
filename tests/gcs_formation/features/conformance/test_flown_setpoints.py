"""Each rule by which changes are compared with those flown: limits from both sides, and closed forms."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, after
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.features.conformance import flown_setpoints as rules
from gcs_formation.features.conformance.flown_setpoints import AIRSPEED, FlownSetpoints, NonConformance

START = Instant(0)
JUDGED = (True, True, True)
change = st.floats(-20.0, 20.0)


def flier(*, hovers: bool = False, sigma: tuple[float, float, float] = (0.0, 0.0, 0.0), prompt: float = 1.0) -> Any:
    """Return one of 16 to 28 m/s, or a multirotor, which climbs by 3 m/s and reaches heights within 1 s and 3 s."""
    model = AutopilotModel(4.0, 1.5, 1.0, 3.0, 0.0 if hovers else 16.0, 28.0, 1.5, 0.25, 3.0)
    vehicle: Any = SimpleNamespace(
        index=0, setpoint_channels=(), receives=True, autopilot=SimpleNamespace(hovers=False)
    )
    return FlownSetpoints(vehicle, model, sigma, prompt)


def state(airspeed_mps: float = 22.0, heading_rad: float = 0.0, height_m: float = 100.0) -> FlightState:
    return FlightState(0.0, 0.0, height_m, 0.0, airspeed_mps, heading_rad, 0.0, 0.0)


@given(change, change, st.floats(-30.0, 30.0), st.floats(16.0, 30.0))
@settings(max_examples=30)
def test_airspeed_traded_for_height_explains_up_to_g_h_by_v(
    expected: float, flown: float, above_m: float, mps: float
) -> None:
    """m v dv = -m g dh. What is explained lies between the change flown and that without the trade."""
    result = rules._by_energy(expected, flown, above_m, mps)
    traded = flown + 9.80665 * above_m / mps
    low, high = min(flown, traded), max(flown, traded)
    assert result == pytest.approx(sorted((low, expected, high))[1])
    assert rules._by_energy(-expected, -flown, -above_m, mps) == pytest.approx(-result)


@pytest.mark.parametrize(
    ("expected", "flown", "continued", "result"),
    [
        (2.0, 0.5, -1.0, 1.5),
        (-2.0, -0.5, 1.0, -1.5),
        (2.0, 0.5, 1.0, 0.5),
        (2.0, -2.5, -1.0, -2.5),
        (2.0, -1.5, -1.0, -0.5),
        (2.0, 2.0, -1.0, 2.0),
        (0.0, 0.0, -1.0, 0.0),
        (2.0, 0.5, 0.0, 0.5),
    ],
)
def test_motion_that_was_under_way_is_taken_off_if_it_was_opposite(
    expected: float, flown: float, continued: float, result: float
) -> None:
    """Not of one that has flown as large a change, in either direction."""
    assert rules._less_if_opposite(expected, flown, continued) == result


@given(st.floats(-3.1, 3.1), st.floats(-6.0, 6.0), st.floats(-3.1, 3.1))
@settings(max_examples=30)
def test_a_turn_flown_is_that_turn_of_all_full_turns_more_which_is_nearest_to_the_expected(
    heading_rad: float, turn_rad: float, off_rad: float
) -> None:
    """Headings repeat after a full turn, and windows may see more than half of one."""
    end = state(25.0, heading_rad + turn_rad, 110.0)
    seen = state(23.0, math.remainder(heading_rad + turn_rad + off_rad, math.tau), 104.0)
    expected, flown = rules._changes(state(22.0, heading_rad, 100.0), end, seen, hovers=False)
    assert expected == pytest.approx((3.0, turn_rad, 10.0))
    assert flown == pytest.approx((1.0, turn_rad + off_rad, 4.0))


def test_a_multirotors_change_is_that_of_its_velocity_and_what_is_flown_its_part_along_it() -> None:
    """From 3 m/s north and 1 m/s of wind to 4 m/s east: (-4, 4) m/s; of (-1, 1) m/s flown a quarter, sqrt(2) m/s."""
    before = FlightState(0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 1.0, 0.0)
    end = FlightState(0.0, 0.0, 0.0, 0.0, 4.0, math.pi / 2.0, 0.0, 0.0)
    seen = FlightState(0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 1.0)
    (wanted, _, _), (flown, _, _) = rules._changes(before, end, seen, hovers=True)
    assert (wanted, flown) == pytest.approx((4.0 * math.sqrt(2.0), math.sqrt(2.0)))
    across = FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.0, 2.0)
    assert rules._change_of_velocity(before, end, across)[1] == pytest.approx(0.0)
    assert rules._change_of_velocity(before, before, seen) == (1e-9, 0.0)


@pytest.mark.parametrize(("first_s", "second_s"), [(1.0, 3.0), (0.5, 2.0), (0.3, 0.9)])
def test_air_that_rises_displaces_by_the_time_constants_less_what_the_window_leaves(
    first_s: float, second_s: float
) -> None:
    """Two lags in series from -(a + b) at 1 m/s: b² e^(-t / b) and a² e^(-t / a), by their difference over b - a."""
    model = AutopilotModel(4.0, 1.5, first_s, second_s, 16.0, 28.0, 1.5, 0.25, 99.0)
    left_m = second_s**2 * math.exp(-3.2 / second_s) - first_s**2 * math.exp(-3.2 / first_s)
    assert rules._carried_m(model) == pytest.approx(first_s + second_s - left_m / (second_s - first_s), rel=1e-3)


def test_the_smallest_judged_changes_grow_by_four_sigmas_and_with_a_slow_integrator() -> None:
    assert flier().min_change == [1.0, 0.04, 1.5]
    assert flier(sigma=(0.5, 0.01, 1.0), prompt=0.5).min_change == pytest.approx([6.0, 0.08, 5.5])
    assert flier().reach_m == 12.0


def test_the_worst_channel_has_the_most_misses_in_a_row_and_two_are_a_doubt() -> None:
    """Of as many the first."""
    for bad in itertools.product(range(4), repeat=3):
        judged = flier()
        judged.bad = list(bad)
        assert judged.worst == bad.index(max(bad))
        assert judged.doubted == (max(bad) >= 2)
        judged.broken = True
        assert judged.doubted


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("expected", "flown", "by_air", "misses"),
    [
        (1.0, 0.24, 0.0, True),
        (1.0, 0.26, 0.0, False),
        (0.99, 0.0, 0.0, False),
        (4.0, 0.9, 3.0, True),
        (4.0, 0.9, 3.2, False),
        (4.0, -2.0, 5.9, True),
        (4.0, 9.0, 0.0, False),
    ],
)
def test_a_channel_misses_that_lacks_more_than_three_quarters_and_more_than_the_air_explains(
    sign: float, expected: float, flown: float, by_air: float, misses: bool
) -> None:
    judged = flier()
    for count in (1, 2):
        kept = judged._keeps_up(AIRSPEED, sign * expected, sign * flown, by_air, judged=True)
        assert (kept, judged.bad[AIRSPEED]) == (not misses, count if misses else 0)
    assert judged._keeps_up(AIRSPEED, sign * expected, sign * flown, by_air, judged=False)
    assert judged.bad == [0, 0, 0]


@pytest.mark.parametrize(("channel", "expected"), [(0, (2.0, 0.0, 0.0)), (1, (0.0, 0.5, 0.0)), (2, (0.0, 0.0, 6.0))])
def test_four_misses_in_a_row_are_said_once_and_eight_checks_without_mend(
    channel: int, expected: tuple[float, float, float]
) -> None:
    judged = flier()
    found = [judged._judge(expected, (0.0, 0.0, 0.0), 22.0, JUDGED) for _ in range(8)]
    assert found == [None] * 3 + [channel] + [None] * 4
    assert (judged.broken, judged.missed, judged.doubted) == (True, channel, True)
    judged._judge((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 22.0, JUDGED)
    assert judged.good == 1
    others = tuple(each != channel for each in range(3))
    judged._judge((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 22.0, others)
    assert judged.good == 0, "the channel that was missed must be judged"
    for number in range(1, 9):
        assert judged.broken
        judged._judge((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 22.0, JUDGED)
        assert judged.good == number
    assert not judged.broken


def test_an_error_of_height_adds_a_150th_to_the_variance_of_the_air() -> None:
    """0.4 s of 60 s. Air at 4 sqrt(v) explains what it carries in the window; at least 1.5 m/s do."""
    judged = flier()
    judged._judge((0.0, 0.0, 3.0 * judged.carried_m), (0.0, 0.0, 0.0), 22.0, JUDGED)
    assert judged.air_variance == pytest.approx(9.0 / 150.0)
    judged._judge((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 22.0, (True, True, False))
    assert judged.air_variance == pytest.approx(9.0 / 150.0)
    for variance, share, missed in ((0.0, 1.45, 0), (0.0, 1.6, 1), (1.0, 3.95, 0), (1.0, 4.2, 1)):
        judged = flier()
        judged.air_variance = variance
        judged._judge((0.0, 0.0, share * judged.carried_m), (0.0, 0.0, 0.0), 22.0, JUDGED)
        assert judged.bad == [0, 0, missed]


def test_a_gust_from_the_side_explains_a_turn_that_lacks_its_share_of_the_airspeed() -> None:
    """4 sqrt(0.25) = 2 m/s at 20 m/s: 0.1 rad."""
    for turn_rad, missed in ((0.099, 0), (0.101, 1)):
        judged = flier()
        judged.air_variance = 0.25
        judged._judge((0.0, turn_rad, 0.0), (0.0, 0.0, 0.0), 20.0, (True, True, False))
        assert judged.bad == [0, missed, 0]


@pytest.mark.parametrize(("hovers", "misses"), [(False, 0), (True, 1)])
def test_only_an_aircraft_may_have_its_speed_in_its_height(hovers: bool, misses: int) -> None:
    """5 m too high at 22 m/s are 2.2 m/s; 0.5 m at the slowest speed, 16 m/s, 0.3 m/s, whatever is reported."""
    judged = flier(hovers=hovers)
    judged._judge((2.0, 0.0, 0.0), (0.0, 0.0, 5.0), 22.0, JUDGED)
    assert judged.bad[AIRSPEED] == misses
    slow = flier()
    slow._judge((2.0, 0.0, 0.0), (0.0, 0.0, 0.5), 5.0, JUDGED)
    assert slow.bad[AIRSPEED] == 1


@pytest.mark.parametrize(
    ("above_m", "lost_m", "sinks"), [(6.125, 15.25, True), (6.125, 15.0, False), (5.875, 20.0, False)]
)
def test_one_that_is_to_climb_sinks_when_it_has_lost_15_m(above_m: float, lost_m: float, sinks: bool) -> None:
    """A setpoint above it by half of its reach, 12 m, is a command to climb."""
    judged = flier()
    for number, height_m in enumerate((99.0, 100.0, 100.0 - lost_m / 2.0, 100.0 - lost_m)):
        seen = state(height_m=height_m)
        judged._remember(number * 10**9, seen)
        found = judged._sunk(number * 10**9, seen, height_m + above_m)
    assert judged.sinks == sinks
    assert found == (NonConformance("height", 0.0, -lost_m, 2.0) if sinks else None)
    risen = state(height_m=judged.past[0].height_m + 1.6)
    assert judged._sunk(5 * 10**9, risen, 200.0) is None
    assert not judged.sinks


def test_air_that_sinks_explains_a_loss_of_height() -> None:
    """4 sqrt(4) = 8 m/s, times what air carries in the window, 2.5 m: 19.8 m."""
    for lost_m, sinks in ((19.0, False), (20.5, True)):
        judged = flier()
        judged.air_variance = 4.0
        for number, height_m in enumerate((100.0, 100.0 - lost_m)):
            judged._remember(number, state(height_m=height_m))
            judged._sunk(number, state(height_m=height_m), 200.0)
        assert judged.sinks == sinks


@pytest.mark.parametrize(("above_m", "risen_m", "stuck"), [(10.9, 2.3, True), (10.7, 2.3, False), (10.9, 2.5, False)])
def test_one_that_is_to_climb_at_its_limit_and_hardly_does_for_twenty_checks_is_stuck(
    above_m: float, risen_m: float, stuck: bool
) -> None:
    """0.9 of its reach, 12 m; a quarter of 3 m/s in 3.2 s is 2.4 m."""
    judged = flier()
    judged.good = 5
    found = [judged._stuck(above_m, risen_m) for _ in range(20)]
    assert found[:19] == [None] * 19
    assert found[19] == (NonConformance("height", 3.0 * 3.2, risen_m) if stuck else None)
    assert judged.good == (0 if stuck else 5)
    assert judged._stuck(math.nan, risen_m) is None
    assert judged.stuck == 0


@pytest.mark.parametrize(("commanded_s", "settled"), [(4.19, False), (4.2, True)])
@pytest.mark.parametrize("known", list(itertools.product((True, False), repeat=3)))
def test_each_channel_is_judged_once_it_has_been_acknowledged_for_the_window_and_a_second(
    commanded_s: float, settled: bool, known: tuple[bool, bool, bool]
) -> None:
    judged, now = flier(), after(START, 10.0)
    asked = list[Any]()
    judged.vehicle.setpoint_channels = [
        SimpleNamespace(known_since=lambda *given, each=each: asked.append(given) or each) for each in known
    ]
    judged.since = after(now, -commanded_s)
    assert judged._settled(now) == (known if settled else (False, False, False))
    assert set(asked) == ({(after(now, -4.2), now)} if settled else set())


@pytest.mark.parametrize("receives", [True, False])
@pytest.mark.parametrize("hovers", [True, False])
def test_without_acknowledgements_one_is_judged_that_receives_and_a_multirotors_course_never(
    receives: bool, hovers: bool
) -> None:
    judged = flier()
    judged.vehicle.receives, judged.vehicle.autopilot.hovers = receives, hovers
    assert judged._settled(START) == (False, False, False)
    judged.since = after(START, -9.0)
    assert judged._settled(START) == (receives, receives and not hovers, receives)


def test_a_window_has_eight_states() -> None:
    judged = flier()
    for number in range(12):
        judged._remember(number, state(float(number)))
    assert judged.stamps == list(range(4, 12))
    assert [each.airspeed_mps for each in judged.past] == list(range(4, 12))


def test_a_turn_under_way_against_the_command_is_continued_for_a_second_and_a_half() -> None:
    """0.4 s apart, at 0.1 rad/s and -0.5 m/s²: 0.15 rad and 0.75 m/s are taken off; stamps nearer count as 0.4 s."""
    for apart_ns in (400_000_000, 1):
        judged = flier()
        judged._remember(0, state(22.0, 0.0))
        judged._remember(apart_ns, state(21.8, 0.04))
        assert judged._less_initial_motion((1.5, -0.5, 0.0), (-0.3, 0.1, 2.0)) == pytest.approx((0.45, -0.05, 2.0))
    slower = flier()
    slower._remember(0, state(22.0))
    slower._remember(800_000_000, state(21.8))
    assert slower._less_initial_motion((1.5, 0.0, 0.0), (0.0, 0.0, 0.0))[0] == pytest.approx(0.375)
