"""Start-ups that don't complete: what happens to the vehicle, to the others and to the run, and when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from typing import Any

import numpy as np
import pytest

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.engine import Datagram
from airlink.frame import HEADER_V2
from flight_model.arrays import wrap
from gcs_formation.app.progress import Progress
from gcs_formation.guidance.leader_guidance import SETTLE_S
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.mission.phase_machine import GETS_ON_S
from gcs_formation.phases import Phase
from gcs_formation.station import Station
from sim_vehicles.autopilot.modes_and_failsafe import Condition, Mode
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World

LAG_S = 0.2
"""Two ticks: how much an event may lag behind its cause."""
LAST = 3
SELDOM = {"rate_hz": 5}
ON_THE_GROUND: dict[str, Any] = {"start": {"in_air": False}, "duration_s": 20, "telemetry": SELDOM, "law": SELDOM}
ASSEMBLING: dict[str, Any] = {"start": {"in_air": True, "run_in_s": 6, "timeout_s": 30}, "duration_s": 20}


class Deaf(Between):
    """Nothing reaches the last vehicle."""

    def take(self, datagram: Datagram, now: Instant) -> None:
        if datagram.socket != LAST - 1:
            super().take(datagram, now)


class Unready(Between):
    """The last vehicle never reports that its estimator is ready."""

    def datagrams_to_send(self) -> list[Datagram]:
        report = m.MAVLINK_MSG_ID_EKF_STATUS_REPORT.to_bytes(3, "little")
        sent = super().datagrams_to_send()
        return [each for each in sent if each.socket != LAST - 1 or each.data[HEADER_V2 - 3 : HEADER_V2] != report]


class Mute(Between):
    """Nothing comes from the last vehicle."""

    def datagrams_to_send(self) -> list[Datagram]:
        return [each for each in super().datagrams_to_send() if each.socket != LAST - 1]


def nothing(world: World) -> None:
    """Do nothing: the trouble is between station and vehicles."""


def ignores(world: World) -> None:
    world.inject(LAST, "ignore")


def can_not_arm(world: World) -> None:
    vehicle = world.vehicle(LAST)

    def arm(*, force: bool) -> bool:
        vehicle.say(m.MAV_SEVERITY_CRITICAL, "PreArm: Compass not calibrated")
        return force

    vehicle.arm = arm


def stays_on_the_ground(world: World) -> None:
    world.network.run(lambda: world.vehicle(LAST).pilot.condition is Condition.ARMED)
    world.inject(LAST, "pilot", mode="MANUAL")


def ignores_in_the_air(world: World) -> None:
    world.network.run(lambda: world.vehicle(LAST).pilot.airborne)
    world.inject(LAST, "ignore")


@pytest.mark.parametrize(
    ("between", "trouble", "begins", "limit_s", "words"),
    [
        (Deaf, nothing, ("link", "connected"), 30, "we asked for telemetry"),
        pytest.param(
            Unready,
            nothing,
            ("mode", "MANUAL"),
            92.4,  # 90 s after what it tells last showed progress
            "we waited for it to be ready to arm (no EKF_STATUS_REPORT)",
            marks=pytest.mark.slow,
        ),
        (Between, ignores, ("disobeys", "mode TAKEOFF"), 18, "we set mode TAKEOFF"),
        (
            Between,
            can_not_arm,
            ("mode", "TAKEOFF"),
            30,
            "we armed (COMPONENT_ARM_DISARM: FAILED); it said: 'PreArm: Compass",
        ),
        pytest.param(
            Between,
            stays_on_the_ground,
            ("statustext", "armed"),
            90,
            "we waited for it to climb",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            Between,
            ignores_in_the_air,
            ("disobeys", "mode GUIDED"),
            18,
            "we set mode GUIDED",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_vehicle_that_can_not_be_started_ends_the_run_with_none_left_flying_on(
    between: type[Between], trouble: Callable[[World], None], begins: tuple[str, str], limit_s: float, words: str
) -> None:
    """NonConformance is reported 2 s after the command's acknowledgement, 18 s before the step times out at 20 s."""
    world = World(between, **ON_THE_GROUND)
    trouble(world)
    world.run()
    assert world.station.phase_machine.failure
    assert world.station.phase_machine.failure.startswith(f"vehicle {LAST}: not done within")
    assert words in world.station.phase_machine.failure
    (failed_s,) = world.times_s("failure")
    begun_s = world.times_s(begins[0], LAST, begins[1])[0]
    assert failed_s - begun_s == pytest.approx(limit_s, abs=1.0)
    assert world.station.flight.phase is Phase.FAILED
    others = world.fleet.vehicles[: LAST - 1]
    assert all(
        each.pilot.mode is Mode.LOITER if each.pilot.airborne else not each.pilot.condition.armed for each in others
    )
    assert world.vehicle(LAST).pilot.condition is not Condition.ARMED


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3, 4, 5)), 6])
def test_half_of_all_datagrams_lost_each_way_keep_none_from_starting(seed: int) -> None:
    """Every fourth request is answered, so five take 14 s on average, and often more than 20 s."""
    lossy: dict[str, Any] = {"seed": seed, "vehicles": {"count": 6}, "links": {"default": {"loss": 0.5}}}
    world = World(**ON_THE_GROUND | lossy)
    world.network.run(
        lambda: world.station.flight.ended or all(each.start_up.finished for each in world.station.vehicles.values())
    )
    assert world.station.phase_machine.failure is None


def slow_boot(ready_s: float, **start: Any) -> World:
    """Return vehicles whose estimators take long."""
    world = World(**ON_THE_GROUND | {"start": {"in_air": False} | start, "vehicles": {"count": 2}})
    world.fleet = Fleet(replace(world.config, ready_s=ready_s))
    assert isinstance(world.between, Between)
    world.between.fleet = world.fleet
    return world


def test_a_vehicle_that_takes_long_to_get_ready_is_waited_for_with_a_line_for_each_thing_that_it_lacks() -> None:
    """Its estimator finds something more every 24 s, and is ready later than one without progress is waited for."""
    world = slow_boot(120.0)
    world.network.run(lambda: world.station.flight.ended or world.vehicle(1).pilot.airborne)
    assert world.station.phase_machine.failure is None
    said = [event.text for event in world.recorder.events if event.kind == "waits" and str(event.vehicle) == "1"]
    missing = [text.partition(";")[0].count("EKF_") - 1 for text in said]
    assert missing[:5] == [8, 7, 5, 4, 3]
    assert said[4].startswith("not ready yet (EKF_STATUS_REPORT: no EKF_POS_HORIZ_ABS, EKF_PRED_POS_HORIZ_REL")


def test_positions_near_latitude_and_longitude_0_before_the_first_fix_are_no_motion() -> None:
    """As an ArduPilot tells them that is switched on after the station."""
    world = slow_boot(20.0)
    caution = PreFlightOptions(parameters=True)
    world.station = Station(world.station.scenario, world.recorder, caution=caution)
    world.process.replace(world.station)
    world.network.run(lambda: world.station.flight.ended or world.vehicle(1).pilot.airborne)
    assert world.station.phase_machine.failure is None
    assert world.vehicle(1).pilot.airborne


@pytest.mark.parametrize(
    ("ready_s", "start", "words"),
    [
        (1000.0, {}, "without progress for 90 s"),
        (200.0, {"boot_timeout_s": 100}, "not done within 100 s after we waited for it to be ready to arm"),
    ],
)
def test_one_that_makes_no_progress_or_takes_longer_than_the_scenario_allows_ends_the_run(
    ready_s: float, start: dict[str, Any], words: str
) -> None:
    world = slow_boot(ready_s, **start)
    world.run(700.0)
    assert words in (world.station.phase_machine.failure or "")
    assert "EKF_STATUS_REPORT: no " in (world.station.phase_machine.failure or "")


def test_no_vehicle_takes_off_for_a_formation_of_which_one_never_answers() -> None:
    world = World(Mute, **ON_THE_GROUND)
    world.run()
    assert world.station.phase_machine.failure
    assert world.station.phase_machine.failure == "no vehicle 3 answered at udpin:127.0.0.1:14550 in 30 s"
    assert world.times_s("failure") == [pytest.approx(30.0, abs=LAG_S)]
    assert all(each.pilot.condition is Condition.DISARMED for each in world.fleet.vehicles)


@pytest.mark.slow
def test_after_the_path_has_begun_a_vehicle_that_can_not_be_started_again_is_abandoned_and_the_others_fly_on() -> None:
    world = World(duration_s=32)
    world.fly_to(2.0)
    world.inject(2, "restart")
    world.inject(2, "ignore")
    world.run(28.0)
    (commanded_s,), (abandoned_s,) = world.times_s("disobeys", 2), world.times_s("abandoned", 2)
    assert abandoned_s - commanded_s == pytest.approx(18.0, abs=1.0)
    assert world.words("abandoned") == ["vehicle 2: not done within 20 s after we set mode GUIDED"]
    assert max(np.abs(tick.error_m[2]).max() for tick in world.recorder.ticks if tick.mission_time_s > 2.0) < 0.05
    world.inject(2, "ignore", ends=True)
    world.inject(2, "pilot", ends=True)
    back_s = world.now_s
    world.run()
    (again_s,) = [at_s for at_s in world.times_s("ready", 2) if at_s > back_s]
    assert again_s - back_s < LAG_S
    assert world.station.flight.phase is Phase.DONE


def test_who_is_in_its_slot_when_the_time_for_assembly_is_over_is_not_said_to_be_out_of_it() -> None:
    world = World(start={"in_air": True, "run_in_s": 20, "timeout_s": 8}, duration_s=1)
    world.run()
    assert world.times_s("phase", text="flying")
    assert world.times_s("unassembled") == []


@pytest.mark.slow
def test_who_is_back_in_its_slot_by_the_next_pass_is_not_said_to_be_out_of_it_for_the_turn_before() -> None:
    world = World(start=ASSEMBLING["start"], duration_s=1, law=SELDOM, telemetry=SELDOM)
    world.run(2.0)
    world.inject(2, "pilot")
    world.run(40.0)
    world.inject(2, "pilot", ends=True)
    world.run()
    (assembling_s,), (begun_s,) = world.times_s("phase", text="assembling"), world.times_s("phase", text="flying")
    assert begun_s > assembling_s + ASSEMBLING["start"]["timeout_s"] + 10.0
    assert (world.times_s("unassembled"), world.station.phase_machine.assembled) == ([], True)


def test_a_log_says_what_an_assembly_waits_for_and_for_how_long() -> None:
    world, log = World(**ON_THE_GROUND), StringIO()
    world.run(10.0)
    Progress(log).remind(world.station, world.clock.now())
    assert log.getvalue() == "start +   10.0 s  connecting: vehicle 1, 2, 3: waited for it to climb\n"
    world.network.run(lambda: bool(world.times_s("phase", text="assembling")))
    world.run(5.0)
    log.seek(0)
    log.truncate()
    Progress(log).remind(world.station, world.clock.now())
    words = log.getvalue()
    assert " s  assembling: the leader is at the start of its path in " in words
    left_s = float(words.rpartition(" in ")[2].removesuffix(" s at least\n"))
    said_s = world.now_s
    world.network.run(lambda: bool(world.times_s("phase", text="flying")))
    assert left_s <= world.now_s - said_s + 5.0
    log.seek(0)
    log.truncate()
    Progress(log).remind(world.station, world.clock.now())
    assert not log.getvalue()


def test_a_leader_whose_telemetry_is_too_old_is_said_to_be_missed_for_that() -> None:
    world = World(start={"in_air": True, "run_in_s": 6, "timeout_s": 10}, law={"max_age_s": 0.01})
    world.run(60.0)
    assert world.station.flight.phase is Phase.FAILED
    (said,) = world.words("failure")
    assert said.startswith("the leader was not there to follow within 10 s: its telemetry is 0.")
    assert said.endswith(" s old; law.max_age_s is 0.01")


@pytest.mark.slow
def test_a_leader_that_does_not_get_to_the_start_of_its_path_is_not_waited_for_without_end() -> None:
    """A wind of 25 m/s, unknown to the scenario, blows it back at 3 m/s."""
    start = {"in_air": True, "run_in_s": 6, "timeout_s": 10}
    world = World(vehicles={"count": 2}, start=start, law=SELDOM, telemetry=SELDOM)
    for body in world.fleet.bodies:
        body.air_north_mps = -25.0
    world.run(600.0)
    (assembling_s,), (failed_s,) = world.times_s("phase", text="assembling"), world.times_s("failure")
    assert failed_s - assembling_s == pytest.approx(10.0 + GETS_ON_S, abs=1.0)
    (said,) = world.words("failure")
    why, _, moved = said.partition(": commanded to fly 22 m/s, it is ")
    assert why == "the leader does not get to the start of its path"
    assert moved.endswith(" m farther from it than 120 s ago")
    assert float(moved.split()[0]) == pytest.approx(3.0 * GETS_ON_S, rel=0.02)
    assert world.station.flight.phase is Phase.FAILED


@pytest.mark.slow
def test_when_the_time_for_assembly_is_over_the_path_begins_as_the_leader_comes_by_again() -> None:
    world = World(**ASSEMBLING)
    world.run(1.0)
    world.inject(2, "pilot")
    world.run()
    (assembling_s,) = world.times_s("phase", text="assembling")
    (unassembled_s,), (begun_s,) = world.times_s("unassembled"), world.times_s("phase", text="flying")
    assert unassembled_s == begun_s > assembling_s + 30.0
    guidance = world.station.controller.guidance
    turn_s = 2 * np.pi * guidance.hold_radius_m() / guidance.speed_mps
    assert guidance.rounds == 1
    assert begun_s < assembling_s + 30.0 + turn_s + 2 * SETTLE_S
    assert world.vehicle(2).pilot.mode is Mode.LOITER
    assert (world.station.phase_machine.failure, world.station.phase_machine.assembled) == (None, False)


@pytest.mark.parametrize("taken", [pytest.param((1,), marks=pytest.mark.slow), (1, 2, 3)])
def test_without_any_to_follow_the_run_ends_when_the_time_for_assembly_is_over(taken: tuple[int, ...]) -> None:
    """Pilots have taken the leader only, without succession; or all vehicles, so that none can take over."""
    world = World(**ASSEMBLING, formation={"shape": "arrow", "succession": "none" if taken == (1,) else "nearest"})
    world.run(3.0)
    for number in taken:
        world.inject(number, "pilot")
    world.run()
    assert world.station.phase_machine.failure
    assert world.station.phase_machine.failure == "the leader was not there to follow within 30 s"
    (assembling_s,), (failed_s,) = world.times_s("phase", text="assembling"), world.times_s("failure")
    assert failed_s - assembling_s == pytest.approx(30.0, abs=LAG_S)
    assert all(each.pilot.mode is Mode.LOITER for each in world.fleet.vehicles)
    assert len(world.times_s("postponed")) == len(taken) // 3  # once, though it was tried again for 27 s


@pytest.mark.slow
def test_where_the_leader_turns_off_to_go_round_again_none_is_commanded_to_turn_about() -> None:
    """Where the straight line becomes a circle, the leader's setpoint has a step, and its rate of change a spike."""
    world = World(formation={"shape": "diamond", "spacing_m": 40}, **ASSEMBLING)
    world.run(1.0)
    world.inject(LAST, "pilot")
    world.run(30.0)
    assert world.station.controller.guidance.rounds > 0
    headings = np.array([[heading_rad for _, heading_rad, _ in tick.setpoints] for tick in world.recorder.ticks])
    assert np.nanmax(np.abs(wrap(np.diff(headings, axis=0)))) < 0.5


@pytest.mark.parametrize("leads", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_one_that_is_taken_over_by_its_pilot_as_it_climbs_is_left_to_it_until_it_is_given_back(leads: bool) -> None:
    number = 1 if leads else LAST
    world = World(**ON_THE_GROUND)
    taken = world.vehicle(number)
    world.network.run(lambda: taken.body.state.height_m > 15.0)
    world.inject(number, "pilot", mode="FBWA")
    taken_s = world.now_s
    world.run(30.0)
    assert taken.pilot.mode is Mode.FBWA
    assert world.words("abandoned") == ["taken over in FBWA before it was ready: left to its pilot"]
    assert world.times_s("abandoned", number)[0] - taken_s < 1.0 + LAG_S, "a heartbeat shows it"
    assert world.times_s("ready", number) == []
    assert world.station.phase_machine.failure is None
    assert bool(world.times_s("phase", text="assembling")) is not leads
    taken.enter(Mode.GUIDED)
    world.run(3.0)
    assert world.times_s("member", number, "flying in formation")


def test_under_a_virtual_leader_the_others_go_on_without_one_that_its_pilot_takes_as_it_climbs() -> None:
    world = World(vehicles=[{"id": number, "role": "follower"} for number in (1, 2, LAST)], **ON_THE_GROUND)
    taken = world.vehicle(LAST)
    world.network.run(lambda: taken.body.state.height_m > 15.0)
    world.inject(LAST, "pilot", mode="FBWA")
    world.run(30.0)
    assert world.words("abandoned") == ["taken over in FBWA before it was ready: left to its pilot"]
    assert world.station.flight.phase is Phase.ASSEMBLING
    assert list(world.recorder.ticks[-1].active) == [True, True, True, False]
