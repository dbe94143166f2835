"""Who is sent home, and from when on: by what is left, the way home and the reserve; vehicles are mere reports here."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from formation_scenario import Scenario, load_scenario
from gcs_formation.features.batteries.before_take_off import findings, planned_s
from gcs_formation.features.batteries.check_warnings import full_batteries
from gcs_formation.features.batteries.endurance import Endurance, planned_full_s
from gcs_formation.features.batteries.keys import Battery
from gcs_formation.features.batteries.stages import BatteryWatch
from gcs_formation.features.batteries.way_home import LANDING_S, way_home_s
from gcs_formation.phases import Phase
from gcs_formation.vehicle.member import Member
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog

AIRSPEED_MPS = 22.0
PLACES = st.floats(-5000.0, 5000.0)
WINDS = st.floats(-12.0, 12.0)
REFERENCE = Path(__file__).parents[4] / "docs" / "scenario.md"
HOVERS = {"count": 3, "model": "arducopter", "autopilot": "arducopter"}


def battery(left: float, lasts_s: float = math.nan) -> Any:
    """Return what a vehicle tells of its battery."""
    return SimpleNamespace(left=left, lasts_s=lasts_s)


@cache
def with_battery(**keys: Any) -> Scenario:
    return load_scenario(scenario(safety={"battery": keys}))


class Watched:
    """A vehicle 880 m south of its home at 22 m/s: without wind, 40 s and a minute to land are its way home."""

    def __init__(self, loaded: Scenario | None = None, **keys: Any) -> None:
        loaded = loaded or with_battery(**{"endurance_s": 1000} | keys)
        self.vehicle: Any = SimpleNamespace(
            identity=VehicleId(1, 2),
            index=1,
            telemetry=SimpleNamespace(battery=battery(1.0), home_m=(880.0, 0.0)),
            autopilot=SimpleNamespace(hovers=False),
            airborne=True,
            member=Member.FLYING,
            sent_home="",
        )
        self.logged, self.wind_north_mps, self.now = EventLog(), 0.0, Instant(0)
        cycle: Any = SimpleNamespace(
            scenario=loaded,
            each=[self.vehicle],
            flight=SimpleNamespace(phase=Phase.FLYING),
            log_event=self.logged,
            last_tick=SimpleNamespace(),
        )
        self.cycle, self.watch = cycle, BatteryWatch(cycle)

    def seconds(self, count: int, left: float) -> str:
        """Let seconds pass with this share left; return why it is sent home."""
        for _ in range(count):
            state = FlightState(0.0, 0.0, 100.0, 0.0, AIRSPEED_MPS, 0.0, self.wind_north_mps, 0.0)
            if self.cycle.last_tick is not None:
                self.cycle.last_tick.state = [None, state]
            self.cycle.now = self.now
            self.vehicle.telemetry.battery = battery(left)
            self.watch.run(self.cycle)
            self.now = after(self.now, 1.0)
        return str(self.vehicle.sent_home)


@pytest.mark.parametrize(("left", "home"), [(0.301, False), (0.299, True)])
def test_it_goes_home_once_the_way_and_the_reserve_need_all_that_is_left(left: float, home: bool) -> None:
    """100 s of 1000 s are 10 %; 20 % are the reserve."""
    watched = Watched()
    said = "30% of its battery is left, of which the way home needs 10%; safety.battery.reserve is 20%"
    assert watched.seconds(10, left) == (said if home else "")
    assert watched.logged.of("battery", 2) == [said] * home


def test_home_is_flown_to_at_the_speed_of_a_slow_path() -> None:
    """3-4-5: 90 m at 1.5 m/s and a minute to land are 120 s of 1000 s; 20 % are the reserve."""
    path = {"speed_mps": 1.5, "waypoints_m": [[0, 0, 30], [90, 0, 30]]}
    loaded = load_scenario(scenario(path=path, vehicles=HOVERS, safety={"battery": {"endurance_s": 1000}}))
    for left, home in ((0.321, False), (0.319, True)):
        watched = Watched(loaded)
        watched.vehicle.autopilot.hovers, watched.vehicle.telemetry.home_m = True, (54.0, -72.0)
        assert bool(watched.seconds(6, left)) is home


def test_four_seconds_of_too_little_count_and_a_single_report_does_not() -> None:
    watched = Watched()
    assert watched.seconds(4, 0.25) == ""
    assert watched.seconds(1, 0.5) == ""
    assert watched.seconds(4, 0.25) == ""
    assert watched.seconds(1, 0.25)
    assert watched.logged[0].details == {"left": 0.25}


def test_four_seconds_count_again_for_one_that_was_sent_home_and_has_restarted_on_the_ground() -> None:
    watched = Watched()
    assert watched.seconds(6, 0.25)
    watched.vehicle.sent_home = ""
    assert not watched.seconds(1, 0.25)
    assert watched.seconds(6, 0.25)


def test_where_it_is_only_said_it_is_said_once() -> None:
    watched = Watched(in_flight="warn")
    assert watched.seconds(20, 0.25) == ""
    assert len(watched.logged) == 1


@pytest.mark.parametrize(("left", "home"), [(0.21, False), (0.2, True), (0.19, True)])
@pytest.mark.parametrize("unknown", ["home", "use"])
def test_of_one_whose_home_or_use_is_unknown_the_reserve_alone_counts(unknown: str, left: float, home: bool) -> None:
    watched = Watched() if unknown == "home" else Watched(endurance_s=None)
    if unknown == "home":
        watched.vehicle.telemetry.home_m = None
    said = f"{left:.0%} of its battery is left; safety.battery.reserve is 20%"
    assert watched.seconds(6, left) == (said if home else "")


def test_a_wind_against_which_home_is_not_reached_sends_it_home_with_any_battery() -> None:
    watched = Watched()
    watched.wind_north_mps = -21.5
    assert watched.seconds(6, 0.9) == "90% of its battery is left, and the wind is too strong for the way home"


@pytest.mark.parametrize(
    "no_order",
    [
        {"airborne": False},
        {"sent_home": "before"},
        {"last_tick": None},
        {"flight": SimpleNamespace(phase=Phase.CONNECTING)},
        {"flight": SimpleNamespace(phase=Phase.DONE)},
    ],
    ids=["on the ground", "sent already", "no tick yet", "connecting", "done"],
)
def test_no_other_is_sent(no_order: dict[str, Any]) -> None:
    watched = Watched()
    for name, value in no_order.items():
        setattr(watched.vehicle if hasattr(watched.vehicle, name) else watched.cycle, name, value)
    watched.seconds(10, 0.1)
    assert watched.logged == []


def test_of_a_battery_that_tells_nothing_nothing_is_said() -> None:
    watched = Watched()
    assert watched.seconds(10, math.nan) == ""


def test_what_is_used_in_flight_is_measured_from_the_end_of_the_climb() -> None:
    """1 % every 2 s is 200 s for all of it: the way home, 100 s, then needs half, and the reserve 20 %."""
    watched = Watched()
    watched.vehicle.member = Member.STARTING
    for percent in range(100, 80, -1):
        assert watched.seconds(1, percent / 100.0) == ""
    watched.vehicle.member = Member.FLYING
    for percent in range(80, 72, -1):
        assert watched.seconds(2, percent / 100.0) == ""
    assert watched.seconds(8, 0.72) == ""
    watched.vehicle.airborne = False
    for percent in range(72, 59, -1):
        watched.seconds(2, percent / 100.0)
    watched.vehicle.airborne = True
    assert watched.seconds(6, 0.6) == "", "measured again: by what is stated 30 % are enough"
    for percent in range(59, 50, -1):
        watched.seconds(2, percent / 100.0)
    assert watched.vehicle.sent_home.endswith("of which the way home needs 50%; safety.battery.reserve is 20%")


@pytest.mark.parametrize(("steps", "known"), [(4, False), (5, True)])
def test_five_steps_of_one_percent_are_a_measurement(steps: int, known: bool) -> None:
    """The first change begins it: a step each 12 s is 1200 s for all of it."""
    endurance = Endurance(None)
    for step in range(steps + 2):
        endurance.observe(battery(0.9 - 0.01 * step), after(Instant(0), 12.0 * step), flies=True)
    assert math.isnan(endurance.measured_s) is not known
    if known:
        assert endurance.measured_s == pytest.approx(1200.0)


def test_an_empty_battery_estimates_nothing() -> None:
    assert math.isnan(planned_full_s(battery(0.0, 300.0), math.nan))
    assert planned_full_s(battery(0.25, 300.0), math.nan) == 1200.0


@settings(deadline=None, max_examples=30, derandomize=True)
@given(north_m=PLACES, east_m=PLACES, home_north_m=PLACES, home_east_m=PLACES, wind_north=WINDS, wind_east=WINDS)
def test_through_the_air_the_way_home_is_flown_at_the_airspeed(
    north_m: float, east_m: float, home_north_m: float, home_east_m: float, wind_north: float, wind_east: float
) -> None:
    """Triangle of velocities: the way over ground less the drift of the air is as long as the airspeed makes it."""
    state = FlightState(north_m, east_m, 100.0, 0.0, 20.0, 0.0, wind_north, wind_east)
    seconds = way_home_s(state, (home_north_m, home_east_m), AIRSPEED_MPS) - LANDING_S
    through_north_m = home_north_m - north_m - wind_north * seconds
    through_east_m = home_east_m - east_m - wind_east * seconds
    assert math.hypot(through_north_m, through_east_m) == pytest.approx(AIRSPEED_MPS * seconds, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("wind_mps", "reached"), [(20.99, True), (21.01, False)])
def test_below_one_metre_a_second_over_ground_home_is_not_reached(wind_mps: float, reached: bool) -> None:
    against = FlightState(1000.0, 0.0, 100.0, 0.0, AIRSPEED_MPS, 0.0, wind_mps, 0.0)
    assert math.isfinite(way_home_s(against, (0.0, 0.0), AIRSPEED_MPS)) is reached
    there = FlightState(0.0, 0.0, 100.0, 0.0, AIRSPEED_MPS, 0.0, wind_mps, 0.0)
    assert way_home_s(there, (0.0, 0.0), AIRSPEED_MPS) == 60.0


def test_half_a_metre_from_home_the_wind_counts_too() -> None:
    """Against 12 m/s 10 m/s are left."""
    near = FlightState(0.5, 0.0, 100.0, 0.0, AIRSPEED_MPS, 0.0, 12.0, 0.0)
    assert way_home_s(near, (0.0, 0.0), AIRSPEED_MPS) == pytest.approx(60.05, abs=1e-6)


@pytest.mark.parametrize(("reserve", "allowed"), [(0.0, True), (0.9, True), (-0.01, False), (0.91, False)])
def test_a_reserve_is_any_share_up_to_nine_tenths(reserve: float, allowed: bool) -> None:
    try:
        assert Battery(reserve=reserve).reserve == reserve
        found = True
    except ValueError:
        found = False
    assert found is allowed


def test_a_fifth_is_the_reserve_by_default_and_the_examples_are_those_of_the_reference() -> None:
    assert Battery().reserve == 0.2
    text = REFERENCE.read_text()
    for name, field in Battery.model_fields.items():
        for example in field.examples or ():
            assert f"`{name}: {example}`" in text
    assert Battery.model_fields["reserve"].examples


def as_found(left: float, *, flies: bool = False, home_m: Any = None, **keys: Any) -> Any:
    """Return a vehicle over the origin: 30 s at 22 m/s lead 660 m away, and 120 + 30 + 30 + 60 s are needed."""
    seen = SimpleNamespace(
        battery=battery(left), motion=SimpleNamespace(north_m=-660.0, east_m=0.0), home_m=home_m or (0.0, 0.0)
    )
    loaded = with_battery(**{"endurance_s": 600} | keys)
    return SimpleNamespace(scenario=loaded, seen=seen, flies=flies)


@pytest.mark.parametrize(("flies", "keys"), [(False, {}), (True, {}), (False, {"before_take_off": "warn"})])
def test_on_the_ground_a_battery_that_does_not_last_refuses_the_take_off(flies: bool, keys: dict[str, Any]) -> None:
    """240 s of 600 s are 40 %, and the reserve 20 %."""
    assert findings(as_found(0.61, flies=flies, **keys)) == []
    (found,) = findings(as_found(0.59, flies=flies, **keys))
    assert found.text.startswith("battery: found 59% left; allowed: 60% or more, for 4 min of flight")
    assert found.refuses is (not flies and not keys)


def test_where_home_is_unknown_it_is_where_the_vehicle_stands() -> None:
    """660 m farther, 30 s more of 600 s: 65 %."""
    found = as_found(0.64)
    found.seen.home_m = None
    assert len(findings(found)) == 1
    found.seen.battery.left = 0.66
    assert findings(found) == []
    found.seen.battery.left = math.nan
    assert findings(found) == []
    found.seen.battery.left, found.seen.motion = 0.1, None
    assert findings(found) == []


def test_the_way_home_is_flown_from_where_the_path_ends_in_time() -> None:
    """3-4-5: from 660 m north to a home 495 m beside it, and 880 m beside the begin."""
    loaded = load_scenario(scenario())
    assert planned_s(loaded, (660.0, 495.0)) == pytest.approx(120.0 + 30.0 + 495.0 / 22.0 + 60.0, abs=0.2)
    assert planned_s(loaded, (0.0, 880.0)) == pytest.approx(120.0 + 30.0 + 1100.0 / 22.0 + 60.0, abs=0.2)


@pytest.mark.parametrize("then", ["loiter", "land"])
@pytest.mark.parametrize(
    ("speed_mps", "more", "each_s"), [(22.0, {}, 260.0), (5.0, {"vehicles": HOVERS}, 105.0)], ids=["wings", "rotors"]
)
def test_of_three_that_land_one_after_another_two_are_waited_for_and_rotors_land_sooner(
    speed_mps: float, more: dict[str, Any], each_s: float, then: str
) -> None:
    """Home is where the path ends in time; a take-off and a landing take three minutes."""
    path = {"speed_mps": speed_mps, "waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]}
    loaded = load_scenario(scenario(path=path, finish={"then": then}, **more))
    waits_s = 2.0 * each_s if then == "land" else 0.0
    assert planned_s(loaded, (30.0 * speed_mps, 0.0)) == pytest.approx(180.0 + 30.0 + waits_s, abs=0.2)


@pytest.mark.parametrize(("speed_mps", "home_s"), [(1.5, 40.0), (0.5, 60.0)])
def test_home_is_flown_to_at_the_speed_of_the_path_but_at_1_mps_at_least(speed_mps: float, home_s: float) -> None:
    """60 m beside the end of the path."""
    path = {"speed_mps": speed_mps, "waypoints_m": [[0, 0, 30], [90, 0, 30]]}
    loaded = load_scenario(scenario(path=path, vehicles=HOVERS))
    assert planned_s(loaded, (30.0 * speed_mps, -60.0)) == pytest.approx(180.0 + 30.0 + home_s, abs=0.2)


@pytest.mark.parametrize(("endurance_s", "lasts"), [(295, False), (305, True)])
def test_check_compares_a_full_battery_with_the_way_back_to_the_path_s_begin(endurance_s: float, lasts: bool) -> None:
    """240 s are 80 % of 300 s."""
    path = {"speed_mps": 22, "waypoints_m": [[900, -700, 100], [2900, -700, 100], [4900, -700, 100]]}
    keys = scenario(path=path, safety={"battery": {"endurance_s": endurance_s}})
    assert (list(full_batteries(load_scenario(keys))) == []) is lasts
    assert list(full_batteries(load_scenario(scenario(path=path)))) == []
