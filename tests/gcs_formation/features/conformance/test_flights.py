"""Vehicles that acknowledge but don't obey are reported within 5 s; those that obey never are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.engine import Datagram
from airlink.messages.command import CommandInt, ParamSet
from airlink.messages.system import Heartbeat
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.conformance.monitor import ConformanceMonitor
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.command_delivery import EffectWatch
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.flights.in_memory import Between, World
from tests.gcs_formation.event_log import EventLog

CHANGE = {"shape": "arrow", "spacing_m": 30, "changes": [{"at_s": 5, "shape": "line"}]}
WEAVING = [[0, 0, 100], [700, 0, 100], [1400, 200, 115], [2100, 100, 100], [2800, 300, 110]]
HEADING = m.MAV_CMD_GUIDED_CHANGE_HEADING.to_bytes(2, "little")
START, GUIDED, LOITER, RTL = Instant(0), m.PLANE_MODE_GUIDED, m.PLANE_MODE_LOITER, m.PLANE_MODE_RTL


@pytest.mark.slow
@pytest.mark.parametrize(
    "keys",
    [
        {"start": {"in_air": True, "run_in_s": 12, "offset_m": [8, 6, 4]}},
        {
            "start": {"in_air": True, "run_in_s": 30},
            "links": {"default": {"delay_ms": 300, "loss": 0.2, "mean_burst": 5}},
        },
        {"wind": {"velocity_mps": [3, -4, 0]}},
        {"vehicles": {"count": 3, "navigation": {"source": "noisy"}}},
        {"disturbances": [{"at_s": 5, "velocity_mps": [1.0, 1.0, 1.0]}]},
    ],
)
def test_vehicles_that_obey_are_never_reported(keys: dict[str, Any]) -> None:
    keys = {"start": {"in_air": True, "run_in_s": 12}} | keys
    world = World(duration_s=40, path={"speed_mps": 22, "waypoints_m": WEAVING}, **keys)
    world.run()
    assert world.words("disobeys") == world.words("streams") == []
    assert not [text for text in world.words("uplink") if "acknowledge" in text]
    assert world.station.phase_machine.failure is None


class HeadingsLost(Between):
    """Loses every heading command, and nothing else."""

    def take(self, datagram: Datagram, now: Instant) -> None:
        if HEADING not in datagram.data:
            super().take(datagram, now)


def test_setpoints_of_one_kind_that_never_come_are_a_link_that_fails_and_no_disobedience() -> None:
    """Everything else is answered. The others keep clear of a vehicle that may not hear, as of one that refuses."""
    world = World(HeadingsLost, duration_s=12, path={"speed_mps": 22, "waypoints_m": WEAVING})
    world.run()
    assert world.words("disobeys") == []
    found = world.words("uplink")
    begun, ended = found[: len(world.station.vehicles)], found[len(world.station.vehicles) :]
    assert all(text.endswith("it may not receive GUIDED_CHANGE_HEADING") for text in begun)
    assert ended == ["GUIDED_CHANGE_HEADING is no longer sent"] * len(begun)
    assert all(world.station.cycle.findings.doubted)


@pytest.mark.slow
def test_turbulence_and_noise_are_not_disobedience() -> None:
    noisy = {"count": 3, "navigation": {"source": "noisy"}}
    world = World(duration_s=60, vehicles=noisy, disturbances=[{"at_s": 0, "kind": "dryden", "wind_6m_mps": 7}])
    world.run()
    assert world.words("disobeys") == []


@pytest.mark.slow
def test_a_follower_that_does_not_climb_with_the_path_is_reported() -> None:
    climb = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [300, 0, 100], [700, 0, 130], [1100, 0, 160]]}
    world = World(duration_s=40, path=climb)
    world.fly_to(6.0)
    world.inject(2, "ignore")
    began_m = world.fleet.bodies[1].state.height_m
    world.network.run(lambda: world.recorder.ticks[-1].setpoints[1][2] - began_m > 5.0)
    commanded_s = world.now_s
    world.run(10.0)
    (reported_s,) = world.times_s("disobeys", 2)
    assert reported_s - commanded_s < 5.0
    assert world.times_s("disobeys") == [reported_s]


@pytest.mark.slow
@pytest.mark.parametrize("climb_mps", [1.2, 2.0])
def test_a_leader_that_does_not_climb_is_reported_though_sinking_air_would_explain_it(climb_mps: float) -> None:
    """Its guidance asks for more as it falls behind, up to its climb limit, and is judged 8 s later."""
    ends_m = 100 + 800 * climb_mps / 22
    path = {
        "speed_mps": 22,
        "waypoints_m": [[0, 0, 100], [400, 0, 100], [1200, 0, ends_m], [2400, 0, 2 * ends_m - 100]],
    }
    world = World(duration_s=50, path=path)
    world.fly_to(10.0)
    world.inject(1, "ignore")
    ignores_s = world.now_s
    world.run()
    (reported_s,) = world.times_s("disobeys", 1)
    assert reported_s - ignores_s < 32.0


@pytest.mark.slow
def test_a_follower_that_ignores_a_change_of_formation_is_reported_and_so_is_its_end() -> None:
    world = World(duration_s=25, formation=CHANGE)
    world.fly_to(4.0)
    world.inject(2, "ignore")
    world.fly_to(5.0)
    changed_s = world.now_s
    world.fly_to(13.0)
    world.inject(2, "ignore", ends=True)
    world.run()
    (reported_s,) = world.times_s("disobeys", 2)
    assert reported_s - changed_s < 5.0
    assert world.times_s("disobeys") == [reported_s]
    (over_s,) = world.times_s("obeys", 2)
    assert changed_s + 8.0 < over_s < changed_s + 18.0


@pytest.mark.parametrize("number", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_a_vehicle_that_flies_straight_on_where_the_path_bends_is_reported(number: int) -> None:
    bend = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [300, 0, 100], [700, 100, 100], [1000, 400, 100]]}
    world = World(duration_s=40, path=bend)
    world.fly_to(6.0)
    world.inject(number, "ignore")
    began = world.fleet.bodies[number - 1].state.heading_rad
    world.network.run(lambda: abs(heading_setpoint(world, number) - began) > 0.05)
    bent_s = world.now_s
    world.run(5.0)
    (reported_s,) = world.times_s("disobeys", number)
    assert reported_s - bent_s < 5.0
    details = next(event.details for event in world.recorder.events if event.kind == "disobeys")
    assert details["order"] == "setpoints"
    assert abs(float(details["flown"] or 0.0)) < 0.2 * abs(float(details["expected"] or 0.0))


@pytest.mark.slow
def test_a_leader_that_sinks_whatever_it_is_commanded_is_reported_and_another_leads() -> None:
    """Air that sinks at 6 m/s carries it down at 3 m/s from 100 m on; the others return to the path's height."""
    world = World(duration_s=60, disturbances=[{"at_s": 3, "vehicles": [1], "velocity_mps": [0, 0, 6]}])
    world.fly_to(3.0)
    sank_s = world.now_s
    world.run(12.0)
    (reported_s,) = world.times_s("disobeys")
    (leads_s,) = world.times_s("leader", 2)
    assert reported_s - sank_s < 9.0
    assert leads_s - reported_s < 0.2
    min_m, bodies = 100.0, world.fleet.bodies[1:]
    for _ in range(30):
        world.run(1.0)
        min_m = min(min_m, *(body.state.height_m for body in bodies))
    assert world.fleet.bodies[0].state.height_m == 0.0
    assert min_m > 65.0
    assert [body.state.height_m for body in bodies] == pytest.approx([100.0, 100.0], abs=0.5)
    assert len(world.times_s("leader")) == len(world.times_s("disobeys")) == 1


def test_one_that_refuses_the_speeds_it_is_commanded_is_reported_and_kept_clear_of_until_it_accepts_them() -> None:
    """As an ArduPlane does whose AIRSPEED_MAX is below the commanded speed."""
    world = World(duration_s=60)

    def allow(max_mps: float) -> float:
        asked = ParamSet(2, m.MAV_COMP_ID_AUTOPILOT1, "AIRSPEED_MAX", max_mps, m.MAV_PARAM_TYPE_REAL32)
        assert world.vehicle(2).parameters.set(asked)
        return world.now_s

    world.fly_to(3.0)
    began_s = allow(20.0)
    world.run(5.0)
    assert world.words("disobeys") == ["refuses its setpoints: GUIDED_CHANGE_SPEED: FAILED"]
    (reported_s,) = world.times_s("disobeys", 2)
    assert 1.0 <= reported_s - began_s < 3.0
    assert [link.disobeying for link in world.recorder.ticks[-1].links] == [False, True, False]
    mended_s = allow(28.0)
    world.run(5.0)
    (over_s,) = world.times_s("obeys", 2, "GUIDED_CHANGE_SPEED is no longer refused")
    assert over_s - mended_s < 1.2
    assert not any(link.disobeying for link in world.recorder.ticks[-1].links)


def test_a_vehicle_whose_pilot_takes_it_is_not_said_to_refuse_what_was_on_its_way() -> None:
    """With a round trip of 600 ms, setpoints are refused for that long before its heartbeat says why."""
    links = {"default": {"delay_ms": 300, "loss": 0.2}}
    world = World(duration_s=60, links=links, start={"in_air": True, "run_in_s": 16})
    world.fly_to(3.0)
    world.inject(2, "pilot")
    world.run(5.0)
    assert world.times_s("member", 2, "parted")
    assert world.words("disobeys") == []


def heading_setpoint(world: World, number: int) -> float:
    return world.recorder.ticks[-1].setpoints[number - 1][1]


def test_an_order_to_loiter_that_is_acknowledged_and_not_obeyed_is_reported() -> None:
    world = World(duration_s=60, formation={"shape": "arrow", "succession": "none"})
    world.fly_to(3.0)
    world.inject(3, "ignore")
    world.inject(1, "freeze")
    world.run(15.0)
    (commanded_s,) = world.times_s("member", 3, "told to loiter")
    (reported_s,) = world.times_s("disobeys", 3)
    assert 2.0 <= reported_s - commanded_s < 5.0
    assert world.words("disobeys")[0].startswith("acknowledged mode LOITER")
    assert world.times_s("disobeys", 2) == []


@pytest.mark.parametrize(("share", "reported"), [(0.0, True), (1.0, False), (2.0, False)])
def test_falling_short_of_a_change_is_disobedience_and_overshooting_is_not(share: float, *, reported: bool) -> None:
    """From 4 s on 27 m/s are commanded instead of 22; airspeed lags by 4 s, as in equation (7)."""
    found = judged(lambda at_s: 22.0 + share * 5.0 * (1 - np.exp(-max(0.0, at_s - 4.0) / 4.0)), lambda _: 0.0)
    assert any(at_s < 10.0 for _, at_s in found) is reported


@pytest.mark.parametrize(
    ("climb_mps", "commanded_from_s", "at_least_s", "at_most_s"),
    [(0.0, 0.1, 4.2, 6.0), (0.0, 4.0, 4.0, 9.0), (3.0, 0.1, 30.0, 32.0)],
)
def test_airspeed_is_judged_at_once_but_not_while_an_aircraft_levels_out_of_its_climb(
    climb_mps: float, commanded_from_s: float, at_least_s: float, at_most_s: float
) -> None:
    """It climbs for 2 s after it is taken over, or doesn't, and ignores a command of 27 m/s."""
    ((channel, at_s),) = judged(lambda _: 22.0, lambda at_s: climb_mps if at_s < 2.0 else 0.0, commanded_from_s)
    assert channel == "airspeed"
    assert at_least_s <= at_s <= at_most_s


def test_headings_are_judged_all_the_time() -> None:
    ((channel, at_s),) = judged(lambda _: 27.0, lambda _: 3.0, heading_rad=0.5)
    assert channel == "heading"
    assert at_s < 4.0 + 5.0


AIRCRAFT = ("vehicles.model=arduplane",)
QUICK = ("vehicles.model={tau_v_s: 1.0}",)


@pytest.mark.parametrize(
    ("airspeed_mps", "height_m", "channels"), [(24.0, 110.0, ["height"]), (27.0, 110.0, []), (27.0, 90.0, ["height"])]
)
def test_climbs_are_not_judged_near_the_highest_airspeed_where_no_power_is_left_for_them(
    airspeed_mps: float, height_m: float, channels: list[str]
) -> None:
    """It flies level at the commanded airspeed, of 28 m/s at most, and ignores the height."""
    found = judged(lambda _: airspeed_mps, lambda _: 0.0, 0.1, commanded_mps=airspeed_mps, commanded_m=height_m)
    assert [channel for channel, _ in found] == channels


@pytest.mark.parametrize(("overrides", "channels"), [(QUICK, ["airspeed"]), (AIRCRAFT, [])])
def test_a_small_step_of_airspeed_that_energy_control_answers_late_is_no_disobedience(
    overrides: Sequence[str], channels: list[str]
) -> None:
    """A real ArduPlane had done 0.1 m/s of a step of 1.5 m/s after 3.2 s; by equation (7) with 1 s it is complete."""
    found = judged(lambda _: 22.1, lambda _: 0.0, 6.0, commanded_mps=23.5, overrides=overrides)
    assert [channel for channel, _ in found] == channels


@pytest.mark.parametrize(("rate_rps", "channels"), [(0.05, []), (0.0, ["heading"])])
def test_who_still_turned_the_other_way_has_the_time_to_come_back(rate_rps: float, channels: list[str]) -> None:
    """Commanded 0.13 rad to the left at 20 s, it turns right until it has banked over; one flying straight doesn't."""

    def flown_rad(at_s: float) -> float:
        right_rad = rate_rps * min(max(at_s - 17.0, 0.0), 3.4)
        back = -np.expm1(-max(at_s - 20.4, 0.0) / 2.5) if rate_rps else 0.0
        return float(right_rad - (right_rad + 0.13) * back)

    found = judged(lambda _: 22.0, lambda _: 0.0, 20.0, -0.13, commanded_mps=22.0, flown_rad=flown_rad)
    assert [channel for channel, _ in found] == channels


def judged(
    airspeed_mps: Callable[[float], float],
    climb_mps: Callable[[float], float],
    commanded_from_s: float = 4.0,
    heading_rad: float = 0.0,
    commanded_mps: float = 27.0,
    commanded_m: float = 100.0,
    overrides: Sequence[str] = (),
    flown_rad: Callable[[float], float] = lambda _: 0.0,
) -> list[tuple[str, float]]:
    """Take a vehicle over at 0 s, command speed, heading and height later; return what is found, and when."""
    planned, history, estimator = load_scenario(scenario(), overrides), SetpointHistory(10.0), SimpleNamespace()
    controller: Any = SimpleNamespace(history=history, estimator=estimator)
    origin, logged = planned.origin.geodetic, EventLog()
    plane = Vehicle(VehicleId(1, 2), 1, ArduPlane(2, origin, 0.25), Connection(0), 10.0)
    monitor = ConformanceMonitor(planned, controller, {plane.identity: plane}, logged)
    commanded: Any = SimpleNamespace(active=[False, True, False])
    for tick in range(400):
        now, at_s = after(START, 0.1 * tick), 0.1 * tick
        setpoint = (commanded_mps, heading_rad, commanded_m) if at_s >= commanded_from_s else (22.0, 0.0, 100.0)
        history.begin_tick(vec[i64]([now] * 3))
        history.record([setpoint] * 3)
        for channel in plane.setpoint_channels:
            channel.sent(CommandInt(2, 1, 0, 0), now, 0.0)
            channel.acknowledged(now)
        flown = FlightState(0.0, 0.0, 100.0, climb_mps(at_s), airspeed_mps(at_s), flown_rad(at_s), 0.0, 0.0)
        estimator.filters = [SimpleNamespace(state=flown, stamp=now)] * 3
        monitor.judge_motion(commanded, now)
    return [(each.details["channel"], each.at_s) for each in logged if each.kind == "disobeys"]


@pytest.fixture
def seen() -> Telemetry:
    return Telemetry(World(duration_s=5).fleet.origin)


def beat(seen: Telemetry, mode: int) -> None:
    seen.store(Heartbeat(1, 3, m.MAV_MODE_FLAG_SAFETY_ARMED, mode, m.MAV_STATE_ACTIVE))


def test_a_command_that_shows_is_done_and_a_pilots_later_choice_is_the_pilots(seen: Telemetry) -> None:
    plane, effects = ArduPlane(1, seen.origin, 0.25), EffectWatch()
    beat(seen, GUIDED)
    effect = plane.effect(plane.set_mode(LOITER))
    assert effect is not None
    for following in (LOITER, RTL):
        effects.acknowledged(effect, seen, START)
        for i in range(5):
            beat(seen, GUIDED if i == 0 else following)
            effects.update(seen, after(START, 1.0 * i))
            assert effects.missing is None


def test_an_effect_not_shown_in_two_heartbeats_and_2_s_is_missing_until_it_shows(seen: Telemetry) -> None:
    plane, effects = ArduPlane(1, seen.origin, 0.25), EffectWatch()
    beat(seen, GUIDED)
    effect = plane.effect(plane.set_mode(LOITER))
    assert effect is not None
    effects.acknowledged(effect, seen, START)
    effects.update(seen, after(START, 4.0))
    assert effects.missing is None  # nothing received since
    for _ in range(2):
        beat(seen, GUIDED)
    effects.update(seen, after(START, 4.1))
    assert effects.missing is not None
    beat(seen, LOITER)
    effects.update(seen, after(START, 5.0))
    assert effects.missing is None
