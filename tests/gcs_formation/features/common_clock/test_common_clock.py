"""One clock by UTC (`telemetry.clock: gnss`) in whole flights: asymmetric links, and UTC that is wrong."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant, after
from airlink.messages.system import Timesync
from gcs_formation.features.common_clock.agreed_utc import CommonClock, UtcBounds, agreed_s
from gcs_formation.link.round_trips import RoundTrips
from gcs_formation.testing.flight_plan import Formation, Plan
from gcs_formation.vehicle.member import Member
from tests.flights.in_memory import World
from tests.flights.other_station import interval, tell

Split = tuple[float, float]
GNSS = {"clock": "gnss"}
EQUAL, SLOW_UP, SLOW_DOWN = (240.0, 240.0), (400.0, 80.0), (80.0, 400.0)
TOLERANCE_M = 0.03


def link(vehicle: int, split: Split, at_s: float = 0.0) -> dict[str, Any]:
    """Return links with delays up and down, ms, for one vehicle."""
    up_ms, down_ms = split
    return {"at_s": at_s, "vehicles": [vehicle], "uplink": {"delay_ms": up_ms}, "downlink": {"delay_ms": down_ms}}


def keys(duration_s: float, *changes: dict[str, Any], **third: Any) -> dict[str, Any]:
    """Return a leader, followers left and right of it, and a path with bends; their clocks drift apart by 80 ppm."""
    bends = [[700 * leg, 150 if leg % 2 else -150, 200] for leg in range(1, int(22 * duration_s / 700) + 3)]
    return {
        "duration_s": duration_s,
        "vehicles": [
            {"id": 1, "role": "leader"},
            {"id": 2, "clock": {"drift_ppm": 40}},
            {"id": 3, "clock": {"drift_ppm": -40} | third},
        ],
        "start": {"in_air": True, "run_in_s": 20},
        "finish": {"loiter_s": 0},
        "formation": {"shape": "line", "spacing_m": 30},
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 200], *bends]},
        "telemetry": GNSS,
        "links": {"changes": list(changes)},
    }


@pytest.fixture
def plan(tmp_path) -> Formation:
    return Formation((), tmp_path)


def rms_m(flown: Any, vehicle: int, axis: str, from_s: float = 0.0) -> float:
    series = flown.series(vehicle)
    error_m = series[f"error_{axis}_m"][series["mission_time_s"] >= from_s]
    return float(np.sqrt(np.nanmean(error_m**2)))


def measured_ms(flown: Any, vehicle: int) -> tuple[float, float]:
    return flown.link(vehicle)["measured_up_ms"], flown.link(vehicle)["measured_down_ms"]


def close(split: Split) -> tuple[Any, Any]:
    """Return approximate delays up and down of a split, within max(5 ms, 3 %)."""
    up_ms, down_ms = (pytest.approx(way_ms, abs=5.0, rel=0.03) for way_ms in split)
    return up_ms, down_ms


def fly(plan: Formation, *given: Any, **third: Any) -> Any:
    flight: Plan = plan(keys(*given, **third))
    return flight.fly()


@pytest.mark.slow
def test_unequally_split_links_cost_no_more_than_equal_ones(plan):
    """By round trips alone, errors would be 3.5 m along the path."""
    equal = fly(plan, 100.0, link(2, EQUAL), link(3, EQUAL))
    split = fly(plan, 100.0, link(2, SLOW_UP), link(3, SLOW_DOWN))
    for vehicle, options in ((2, SLOW_UP), (3, SLOW_DOWN)):
        for axis in "xy":
            min_m = rms_m(equal, vehicle, axis)
            assert rms_m(split, vehicle, axis) <= max(1.2 * min_m, min_m + TOLERANCE_M), (vehicle, axis)
        assert measured_ms(split, vehicle) == close(options)


@pytest.mark.parametrize(
    ("known", "options"),
    [({}, close(SLOW_UP)), pytest.param({"station_utc": False}, (None, None), marks=pytest.mark.slow)],
)
def test_links_that_are_all_split_alike_are_known_where_the_stations_clock_keeps_utc(plan, known, options):
    """The emulated vehicles' clock does; by the vehicles' UTC alone the result would be 240 ms up and 240 ms down."""
    flight: Plan = plan(keys(5.0, *(link(each, SLOW_UP) for each in (1, 2, 3))) | {"telemetry": GNSS | known})
    flown = flight.fly()
    assert [measured_ms(flown, each) for each in (2, 3)] == [options, options]


@pytest.mark.slow
def test_a_split_that_changes_in_flight_is_followed_within_20_s(plan):
    flown = fly(plan, 70.0, link(2, EQUAL), link(3, EQUAL), link(2, SLOW_UP, 40.0))
    series = flown.series(2)
    (before,), (later,) = (np.nonzero(series["mission_time_s"] >= at_s) for at_s in (39.0, 60.0))
    up_s, down_s = series["up_s"], series["down_s"]
    assert (up_s[before[0]] * 1e3, down_s[before[0]] * 1e3) == close(EQUAL)
    assert up_s[later[0]] == pytest.approx(0.4, abs=0.012)
    assert down_s[later[0]] == pytest.approx(0.08, abs=0.012)
    flown.stays_within(0.5, followers=[2, 3], from_s=60.0)


@pytest.mark.slow
@pytest.mark.parametrize("third", [{"utc": False}, {"utc_error_s": 1.0}, {"utc_error_s": 18.0}])
def test_utc_that_is_absent_or_impossible_is_refused_and_its_vehicle_flies_by_round_trips(plan, third):
    """18 s are leap seconds that a receiver doesn't know yet. The vehicle alone then has an error of 3.5 m."""
    flown = fly(plan, 40.0, link(2, SLOW_UP), link(3, SLOW_DOWN), **third)
    assert measured_ms(flown, 2) == close(SLOW_UP)
    assert measured_ms(flown, 3) == (None, None)
    assert rms_m(flown, 2, "x") < TOLERANCE_M
    assert rms_m(flown, 3, "x") == pytest.approx(3.5, abs=0.15)


def test_a_fast_clock_that_has_been_up_for_hours_is_mapped_by_round_trips_and_said_so_once():
    """By UTC, after 18 h at a drift known to 1 ppm or worse, its vehicle was metres off its slot for two minutes."""
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2, "clock": {"offset_s": 65_000, "drift_ppm": 100}}]
    start = {"in_air": True, "run_in_s": 15}
    world = World(duration_s=20, vehicles=vehicles, telemetry=GNSS, start=start, links={"default": {"delay_ms": 200}})
    world.run()
    (said,) = [event.text for event in world.recorder.events if event.kind == "clock" and str(event.vehicle) == "2"]
    assert said.startswith("UTC isn't used: its clock's drift isn't known well enough")
    assert world.worst_m() < 0.15


def test_utc_that_was_given_up_is_not_taken_up_again_at_once():
    """Its bounds vary by a few ms about the limit: UTC in use is allowed more, and after rejection it waits."""
    trips = RoundTrips(0.0, by_utc=True)
    vehicle = SimpleNamespace(identity=2, round_trips=trips, member=Member.FLYING, clock=trips.clock)
    said = list[str]()
    cycle = SimpleNamespace(each=[vehicle], utc_at_0_s=1.6e9, log_event=lambda *event: said.append(event[2]))
    common = CommonClock(cast(Any, cycle))
    for tick in range(400):
        sent = after(Instant(0), tick / 4)
        trips.request(sent)
        trips.measure(Timesync(sent, sent), sent)
        off_s = 0.03 if 100 <= tick < 102 else 0.004 + 0.004 * (tick < 200 and tick % 2)  # the limit is 5 ms, then 10
        cast(Any, trips.gnss).utc(1.6e9 + tick / 4 + off_s, tick / 4, armed=False)
        cycle.now = sent
        common.run(cast(Any, cycle))
        assert trips.stamps.by_utc == (8 <= tick < 100 or tick >= 239), tick
    assert [text[:9] for text in said] == ["its stamp", "UTC isn't", "its stamp"]


def jump(world: World, number: int, seconds: float) -> None:
    """Let a vehicle's UTC jump, but not its time since boot: ArduPilot doesn't do this in flight, others may."""
    world.vehicle(number).clock._ahead_ns += round(seconds * NANOSECONDS)


def setpoint_steps(world: World, column: int, from_s: float, to_s: float) -> list[float]:
    """Return the largest steps from tick to tick of its airspeed (m/s), heading (rad) and height (m) setpoints."""
    commands = [tick.setpoints[column] for tick in world.recorder.ticks if from_s <= tick.mission_time_s <= to_s]
    steps = np.diff(np.array(commands), axis=0)
    steps[:, 1] = np.remainder(steps[:, 1] + np.pi, 2 * np.pi) - np.pi
    return np.abs(steps).max(axis=0).tolist()


def through_bends() -> World:
    """Return a flight at 15 s, whose setpoints follow the bends of its path."""
    world = World(**keys(30.0, link(2, SLOW_UP), link(3, SLOW_DOWN)))
    world.fly_to(15.0)
    return world


@pytest.fixture(scope="module")
def calm() -> list[float]:
    """Return the largest steps of setpoints from 15 s on, where no UTC jumps."""
    world = through_bends()
    world.run()
    return setpoint_steps(world, 2, 15.0, 25.0)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [-0.5, 0.1, 18.0])
def test_utc_that_jumps_in_flight_is_reported_and_moves_no_setpoint(seconds, calm):
    world = through_bends()
    jump(world, 3, seconds)
    world.run()
    (said,) = [text for text in world.words("clock") if "jumped" in text]
    assert float(said.split("jumped by ")[1].split(" s")[0]) == pytest.approx(seconds, abs=0.002)
    jumped = setpoint_steps(world, 2, 15.0, 25.0)
    assert all(after <= 1.1 * before + 1e-3 for before, after in zip(calm, jumped, strict=True)), (calm, jumped)
    assert world.worst_m(15.0, 25.0) < 0.1


@pytest.mark.slow
def test_utc_that_is_switched_off_in_flight_is_asked_for_again():
    """With one message a second it is missed after 16 s; until then the known UTC continues on the vehicle's clock."""
    world = World(duration_s=24, telemetry=GNSS)
    world.fly_to(5.0)
    utc = m.MAVLINK_MSG_ID_SYSTEM_TIME
    tell(world, 2, [interval(2, utc, -1.0)])
    world.fly_to(6.0)
    assert world.vehicle(2).streams.interval_us(utc) == -1
    world.run()
    assert world.words("streams")[0].startswith("sends SYSTEM_TIME less than half as often as asked for")
    assert world.vehicle(2).streams.interval_us(utc) == 1_000_000
    assert world.worst_m() < 0.1


def test_the_offset_that_most_bounds_allow_is_agreed_on_and_kept():
    slow, even, wrong = UtcBounds(10.16, 0.24), UtcBounds(10.0, 0.1), UtcBounds(11.0, 0.24)
    assert agreed_s([slow, even, even]) == pytest.approx(10.0)
    assert agreed_s([slow, even, wrong]) == pytest.approx(10.08)
    assert not wrong.allows(agreed_s([slow, even, wrong]))
    assert agreed_s([even, wrong]) != agreed_s([even, wrong])  # NaN: undecidable
    assert agreed_s([slow, even, even], 10.05) == 10.05
    assert agreed_s([slow, slow, even], 9.0) == pytest.approx(10.1)


def test_what_is_agreed_on_is_within_the_bounds_of_all_that_agree():
    """Their median isn't: by the third, it is 10.04 or more, or 9.96 or less."""
    assert agreed_s([UtcBounds(10.0, 0.05), UtcBounds(10.02, 0.05), UtcBounds(10.1, 0.06)]) == pytest.approx(10.04)
    assert agreed_s([UtcBounds(10.0, 0.05), UtcBounds(9.98, 0.05), UtcBounds(9.9, 0.06)]) == pytest.approx(9.96)
