"""Acknowledged commands against observed motion; vehicles are mere telemetry here."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.command import CommandAck, CommandInt
from airlink.messages.system import Heartbeat
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.conformance.flown_setpoints import CHECK_S, CHECKS_BROKEN, LEVELS_OUT_S, SETTLED_S
from gcs_formation.features.conformance.monitor import ConformanceMonitor
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.command_delivery import SILENT_S
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.vehicle_state import UNANSWERED_S
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog

START, NUMBERS = Instant(0), (1, 2, 3)
ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
Acknowledges = Callable[[float], bool]
REPORTED_S = (math.ceil(SETTLED_S / CHECK_S) + CHECKS_BROKEN - 1) * CHECK_S
"""When a vehicle is reported that never did as it was commanded, from the first setpoint on."""


class Ground:
    """A leader and two followers that fly in the formation."""

    def __init__(self) -> None:
        self.vehicles = {VehicleId(1, number): vehicle(number) for number in NUMBERS}
        self.logged, self.airspeed_mps = EventLog(), 22.0
        controller: Any = SimpleNamespace(history=SetpointHistory(10.0), estimator=SimpleNamespace())
        self.controller = controller
        self.monitor = ConformanceMonitor(load_scenario(scenario()), controller, self.vehicles, self.logged)

    def second(self) -> Vehicle:
        return self.vehicles[VehicleId(1, 2)]

    def fly(
        self,
        seconds: float,
        acknowledges: Acknowledges = lambda _: True,
        commanded: Acknowledges = lambda _: True,
        airspeed_mps: Callable[[float], float] = lambda _: 22.0,
        height_m: Callable[[float], float] = lambda _: 100.0,
        commanded_rad: Callable[[float], float] = lambda _: 0.0,
        heading_rad: Callable[[float], float] = lambda _: 0.0,
        *,
        commanded_m: Callable[[float], float] = lambda _: 100.0,
        commanded_mps: Callable[[float], float] = lambda _: 27.0,
        climb_mps: Callable[[float], float] = lambda _: 0.0,
        wind_east_mps: float = 0.0,
    ) -> list[float]:
        """Command the second vehicle 27 m/s from the start, heading and height; return when it is reported."""
        for tenth in range(round(10 * seconds)):
            now, at_s = after(START, 0.1 * tenth), 0.1 * tenth
            speeds_mps = (22.0, commanded_mps(at_s) if commanded(at_s) else 22.0, 22.0)
            self.controller.history.begin_tick(vec[i64]([now] * 3))
            heights_m = 100.0, commanded_m(at_s), 100.0
            commands = zip(speeds_mps, heights_m, strict=True)
            self.controller.history.record([(each_mps, commanded_rad(at_s), each_m) for each_mps, each_m in commands])
            for each in self.vehicles.values():
                for channel in each.setpoint_channels:
                    channel.sent(CommandInt(1, 1, 0, 0), now, 0.0)
                    if acknowledges(at_s) or each is not self.second():
                        channel.acknowledged(now)
            flown = [FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0) for _ in NUMBERS]
            motion = height_m(at_s), climb_mps(at_s), airspeed_mps(at_s), heading_rad(at_s)
            flown[1] = FlightState(0.0, 0.0, *motion, 0.0, wind_east_mps)
            self.controller.estimator.filters = [SimpleNamespace(state=each, stamp=now) for each in flown]
            tick: Any = SimpleNamespace(active=[True, commanded(at_s), True])
            self.monitor.judge_motion(tick, now)
        return [each.at_s for each in self.logged if each.kind == "disobeys" and each.vehicle == 2]


def vehicle(number: int) -> Vehicle:
    made = Vehicle(VehicleId(1, number), number - 1, ArduPlane(number, ORIGIN, 0.25), Connection(0), 10.0)
    made.member, made.round_trips._answered = Member.FLYING, START
    return made


def test_one_that_is_commanded_another_airspeed_and_keeps_its_own_is_reported_once_with_both() -> None:
    ground = Ground()
    (reported_s,) = ground.fly(20.0)
    assert reported_s == pytest.approx(REPORTED_S)
    (said,) = ground.logged.of("disobeys")
    assert said.startswith("acknowledges setpoints and doesn't follow them: airspeed changed by 0.0 m/s in 3.2 s, ")
    assert said.endswith(" m/s expected")
    details = ground.logged[0].details
    assert (details["order"], details["channel"], details["flown"]) == ("setpoints", "airspeed", 0.0)
    assert details["expected"] > 1.0


@pytest.mark.parametrize("turn_rad", [0.3, -0.3])
def test_one_that_is_commanded_a_small_turn_and_flies_on_is_reported(turn_rad: float) -> None:
    ground = Ground()
    reported = ground.fly(20.0, commanded_rad=lambda _: turn_rad, commanded_mps=lambda _: 22.0)
    assert reported == [pytest.approx(REPORTED_S)]
    assert ground.logged[0].details["channel"] == "heading"


def test_one_that_is_commanded_to_climb_at_its_speed_and_stays_is_reported() -> None:
    ground = Ground()
    reported = ground.fly(20.0, commanded_m=lambda _: 180.0, commanded_mps=lambda _: 22.0)
    assert reported == [pytest.approx(REPORTED_S)]
    assert ground.logged[0].details["channel"] == "height"


def test_one_that_slows_down_as_it_is_commanded_obeys_although_it_rises() -> None:
    """In rising air, 2 m/s: the height that it gains is energy that it needn't have for its speed."""
    ground = Ground()
    ground.fly(
        7.0,
        airspeed_mps=lambda at_s: 17.0 + 5.0 * math.exp(-at_s / 4.0),
        height_m=lambda at_s: 100.0 + 2.0 * at_s,
        commanded_mps=lambda _: 17.0,
    )
    assert ground.logged == []


@pytest.mark.parametrize(("climb_mps", "judged_s"), [(0.5, SETTLED_S), (3.0, LEVELS_OUT_S), (-3.0, LEVELS_OUT_S)])
def test_one_that_climbs_or_sinks_when_it_is_taken_over_has_half_a_minute_to_level_out(
    climb_mps: float, judged_s: float
) -> None:
    """It trades height for speed meanwhile, and its throttle lags."""
    (reported_s,) = Ground().fly(40.0, climb_mps=lambda at_s: climb_mps if at_s < 5.0 else 0.0)
    assert judged_s <= reported_s < judged_s + 2.0


def test_one_that_obeys_is_not_reported_and_one_that_does_so_again_is_said_to() -> None:
    assert Ground().fly(20.0, airspeed_mps=lambda at_s: 27.0 - 5.0 * math.exp(-at_s / 4.0)) == []
    ground = Ground()
    ground.fly(40.0, airspeed_mps=lambda at_s: 22.0 if at_s < 10.0 else 27.0 - 5.0 * math.exp(-(at_s - 10.0) / 4.0))
    assert ground.logged.of("obeys", 2) == ["follows its setpoints again"]


def test_a_command_that_is_refused_and_commanded_again_is_reported_once_and_when_it_is_accepted() -> None:
    ground = Ground()
    vehicle = ground.second()
    vehicle.commands.send((vehicle.autopilot.set_mode(m.PLANE_MODE_LOITER),), START, insist=True)
    for tenth in range(130):
        now = after(START, 0.1 * tenth)
        if vehicle.commands.due(now) is not None:
            result = m.MAV_RESULT_DENIED if tenth < 100 else m.MAV_RESULT_ACCEPTED
            vehicle.commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, result), now)
        ground.monitor.judge_refusals(now)
    words = "mode LOITER (DO_SET_MODE: DENIED)"
    assert ground.logged.of("disobeys", 2) == [f"refuses {words}, and is commanded again"]
    assert ground.logged.of("obeys", 2) == [f"no longer refuses {words}"]


def test_a_refused_command_that_another_replaced_is_not_said_to_be_obeyed() -> None:
    ground = Ground()
    vehicle = ground.second()
    vehicle.commands.send((vehicle.autopilot.set_mode(m.PLANE_MODE_LOITER),), START, insist=True)
    vehicle.commands.due(START)
    vehicle.commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_DENIED), START)
    ground.monitor.judge_refusals(after(START, 2.0))
    vehicle.commands.send((), after(START, 3.0))
    ground.monitor.judge_refusals(after(START, 3.0))
    assert len(ground.logged.of("disobeys", 2)) == 1
    assert ground.logged.of("obeys", 2) == []


@pytest.mark.parametrize(("climb_mps", "said"), [(0.8, []), (-0.8, ["airspeed"]), (0.0, ["airspeed"])])
def test_one_whose_height_has_the_energy_that_its_speed_lacks_obeys(climb_mps: float, said: list[str]) -> None:
    """At 22 m/s an unrequested climb of 0.8 m/s takes 1.1 m/s of airspeed in 3.2 s; a descent is no excuse."""
    ground = Ground()
    ground.fly(7.0, height_m=lambda at_s: 100.0 + climb_mps * at_s)
    assert [each.details["channel"] for each in ground.logged if each.kind == "disobeys"] == said


@pytest.mark.parametrize(("sinks_mps", "at_most_s"), [(2.0, 12.0), (3.0, 9.0), (8.0, 5.0)])
def test_one_that_sinks_though_it_is_commanded_to_climb_is_reported_though_its_setpoint_sinks_with_it(
    sinks_mps: float, at_most_s: float
) -> None:
    """From 10 s to 30 s; setpoints stay within 12 m of it, which is the climb possible within its lags."""
    ground, sunk = Ground(), Ground()

    def height_m(at_s: float) -> float:
        return 300.0 - sinks_mps * min(max(0.0, at_s - 10.0), 20.0) + 3.0 * max(0.0, at_s - 30.0)

    def commanded_m(at_s: float) -> float:
        return min(300.0, height_m(at_s) + 12.0)

    (reported_s,) = ground.fly(50.0, height_m=height_m, commanded_m=commanded_m, commanded_mps=lambda _: 22.0)
    assert 10.0 < reported_s <= 10.0 + at_most_s
    assert [each.details["channel"] for each in ground.logged if each.kind == "disobeys"] == ["height"]
    (over_s,) = [each.at_s for each in ground.logged if each.kind == "obeys"]
    assert 30.0 < over_s < 38.0
    sunk.fly(30.0, height_m=height_m, commanded_m=commanded_m, commanded_mps=lambda _: 22.0)
    assert (sunk.monitor.sinking, ground.monitor.sinking) == ({VehicleId(1, 2)}, set())


HURRIED = (
    # airspeed and its setpoint, m/s; height and its setpoint, m
    *([(18.3, 18.5, 99.2, 100.4)] * 10),
    *((18.3, 22.9, 99.3, 100.4), (20.0, 23.6, 99.6, 99.7), (20.9, 23.9, 101.6, 94.4), (20.7, 24.2, 102.0, 93.0)),
    *((21.1, 24.6, 100.1, 95.4), (21.9, 24.6, 98.1, 99.3), (23.0, 25.2, 97.6, 100.2), (23.6, 24.8, 97.9, 100.5)),
    *((22.5, 24.5, 97.9, 102.6), (22.7, 24.6, 95.5, 104.4), (23.7, 24.0, 95.0, 104.6), (23.7, 23.5, 95.5, 105.1)),
    *((23.9, 22.8, 96.2, 105.8), (24.0, 22.2, 97.4, 107.0), (23.8, 21.7, 99.1, 108.7), (23.8, 21.3, 101.3, 105.7)),
)
"""An ArduPlane (SITL) that is commanded to catch up while it gathers, every 0.8 s."""


@pytest.mark.parametrize(("trades", "said"), [(True, []), (False, ["height"])])
def test_an_aircraft_that_trades_height_for_the_airspeed_that_it_is_commanded_obeys(
    trades: bool, said: list[str]
) -> None:
    """As it flew. A vehicle without a change of airspeed setpoint has no reason to."""
    at_s, ground = 0.8 * np.arange(len(HURRIED)), Ground()
    flown_mps, commanded_mps, flown_m, commanded_m = (
        partial(np.interp, xp=at_s, fp=each) for each in np.array(HURRIED).T
    )
    commanded_mps = commanded_mps if trades else flown_mps
    ground.fly(at_s[-1], airspeed_mps=flown_mps, height_m=flown_m, commanded_m=commanded_m, commanded_mps=commanded_mps)
    assert [each.details["channel"] for each in ground.logged if each.kind == "disobeys"] == said


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("hovers", [False, True])
def test_the_height_of_an_aircraft_is_judged_once_its_airspeed_has_been_right_for_8_s(
    sign: float, hovers: bool
) -> None:
    """Commanded 3 m/s more and a climb, or 3 m/s less and a descent, it keeps its height. A multirotor may not."""
    ground = Ground()
    if hovers:
        for flier in ground.monitor._fliers:
            flier.model.speed_min_mps = 0.0
    (reported_s, *_) = ground.fly(
        30.0,
        airspeed_mps=lambda at_s: 22.0 + sign * 3.0 * (1.0 - math.exp(-at_s / 4.0)),
        commanded_mps=lambda _: 22.0 + sign * 3.0,
        commanded_m=lambda at_s: 100.0 + sign * 3.0 * at_s,
    )
    assert 5.0 < reported_s < 7.0 if hovers else 10.0 < reported_s < 12.0


@pytest.mark.parametrize("above_m", [-12.0, 0.0, 5.0])
def test_one_that_is_not_commanded_to_climb_may_sink(above_m: float) -> None:
    """A descent at 2 m/s; if it were commanded 5 m higher, it would be reported."""
    ground, sunk = Ground(), set[VehicleId]()
    for seconds in (10.0, 20.0, 30.0):
        ground.fly(
            seconds,
            height_m=lambda at_s: 300.0 - 2.0 * at_s,
            commanded_m=lambda at_s: 300.0 - 2.0 * at_s + above_m,
            commanded_mps=lambda _: 22.0,
        )
        sunk |= ground.monitor.sinking
    assert not sunk


@pytest.mark.parametrize("radps", [0.1, -0.1, 0.4])
def test_one_that_turns_through_south_as_it_is_commanded_obeys(radps: float) -> None:
    """Headings wrap at half a turn; the setpoint leads a ramp by what a time constant of 1 s lags."""

    def turned(at_s: float, ahead_s: float) -> float:
        return math.remainder(math.pi + radps * (at_s + ahead_s - 10.0), math.tau)

    def flown(heading_rad: Callable[[float], float]) -> list[float]:
        return Ground().fly(
            20.0,
            airspeed_mps=lambda at_s: 27.0 - 5.0 * math.exp(-at_s / 3.0),
            commanded_rad=lambda at_s: turned(at_s, 1.0),
            heading_rad=heading_rad,
        )

    assert not flown(lambda at_s: turned(at_s, 0.0))
    assert flown(lambda _: 3.0)


@pytest.mark.parametrize(
    "acknowledges",
    [lambda at_s: False, lambda at_s: at_s % 3.0 < 2.0, lambda at_s: at_s < 4.0],
    ids=["never", "with gaps of a second", "not any more"],
)
def test_setpoints_that_are_not_acknowledged_all_the_time_are_no_disobedience(
    acknowledges: Acknowledges,
) -> None:
    assert Ground().fly(20.0, acknowledges) == []


@pytest.mark.parametrize("obeys", [True, False])
def test_one_that_flies_the_course_it_is_commanded_with_less_airspeed_crabs_more_and_obeys(*, obeys: bool) -> None:
    """Commanded 14 m/s and courses that swing by 9 degrees, in 4 m/s from the west; it flies them with 10 m/s."""
    ground, wind_mps, commanded_mps, flown_mps = Ground(), 4.0, 14.0, 10.0
    pilot: Any = ground.second().autopilot
    pilot.flies_courses, ground.monitor.saturated[1] = True, True

    def crabbing(course_rad: float, airspeed_mps: float) -> float:
        return course_rad - math.asin(wind_mps / airspeed_mps * math.cos(course_rad))

    def course(at_s: float) -> float:
        return 0.15 * math.sin(0.2 * at_s) if obeys else 0.0

    def moves(at_s: float) -> float:
        heading_rad = crabbing(course(at_s), flown_mps)
        north_mps = flown_mps * math.cos(heading_rad)
        motion = SimpleNamespace(north_mps=north_mps, east_mps=flown_mps * math.sin(heading_rad) + wind_mps)
        ground.second().telemetry.motion = motion  # type: ignore[assignment]
        return heading_rad

    ground.fly(
        60.0,
        airspeed_mps=lambda _: flown_mps,
        commanded_mps=lambda _: commanded_mps,
        commanded_rad=lambda at_s: crabbing(0.15 * math.sin(0.2 * (at_s + 1.0)), commanded_mps),
        heading_rad=moves,
        wind_east_mps=wind_mps,
    )
    said = [each.details["channel"] for each in ground.logged if each.kind == "disobeys" and each.vehicle == 2]
    assert ("heading" in said) == (not obeys)


def test_time_in_which_it_was_not_commanded_does_not_count() -> None:
    assert Ground().fly(20.0, commanded=lambda at_s: at_s % 4.0 < 3.9) == []


def test_one_that_is_heard_and_answers_nothing_is_reported_once_and_again_when_it_answers() -> None:
    ground, silent_s = Ground(), UNANSWERED_S + 0.1
    follower = ground.second()

    def judge(at_s: float) -> list[str]:
        follower.connection.record_frame(after(START, at_s), heartbeat=True)
        ground.monitor.judge_answers(after(START, at_s))
        return ground.logged.of("uplink", 2)

    assert judge(UNANSWERED_S - 0.1) == []
    assert judge(silent_s) == judge(silent_s + 1.0) == ["is heard and answers nothing: it may not receive us"]
    follower.round_trips._answered = after(START, silent_s + 1.0)
    assert judge(silent_s + 1.0)[1:] == judge(silent_s + 1.2)[1:] == ["answers again"]


@pytest.mark.parametrize(("answers_from_s", "said_s"), [(0.0, SILENT_S), (8.0, 8.0 + SILENT_S)])
def test_one_that_answers_and_acknowledges_no_setpoint_for_five_seconds_is_reported(
    answers_from_s: float, said_s: float
) -> None:
    """From when it answers again: before, it may not have received any."""
    ground = Ground()
    tick: Any = SimpleNamespace(active=[True] * 3)
    second = ground.second()
    ground.monitor._next_check = after(START, 1e6)
    for tenth in range(200):
        now, at_s = after(START, 0.1 * tenth), 0.1 * tenth
        second.connection.record_frame(now, heartbeat=True)
        if at_s >= answers_from_s:
            second.round_trips.record_answer(now)
        second.setpoint_channels[0].sent(CommandInt(1, 1, 0, 0), now, 0.0)
        ground.monitor.judge_motion(tick, now)
        ground.monitor.judge_answers(now)
        ground.monitor.judge_silence(now)
    (found,) = [each for each in ground.logged if each.text.startswith("answers, and doesn't acknowledge")]
    assert found.at_s == pytest.approx(said_s, abs=0.25)
    second.setpoint_channels[0].acknowledged(after(START, 20.0))
    ground.monitor.judge_silence(after(START, 20.0))
    assert ground.logged.of("uplink", 2)[-1] == "GUIDED_CHANGE_SPEED is acknowledged again"


def test_one_that_is_silent_altogether_or_not_in_the_formation_is_not_said_to_answer_nothing() -> None:
    ground = Ground()
    ground.monitor.judge_answers(after(START, 10.0))
    ground.second().member = Member.PARTED
    ground.second().connection.record_frame(after(START, 10.0), heartbeat=True)
    ground.monitor.judge_answers(after(START, 10.0))
    assert ground.logged == []


def test_an_order_that_is_acknowledged_and_not_obeyed_is_reported_with_the_mode_and_so_is_its_end() -> None:
    ground = Ground()
    follower, plane = ground.second(), ground.second().autopilot

    def beat(mode: int, at_s: float) -> None:
        armed, flies = m.MAV_MODE_FLAG_SAFETY_ARMED, m.MAV_STATE_ACTIVE
        follower.telemetry.store(Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, armed, mode, flies))
        ground.monitor.judge_commands(after(START, at_s))

    beat(m.PLANE_MODE_GUIDED, 0.0)
    effect = plane.effect(plane.set_mode(m.PLANE_MODE_LOITER))
    assert effect is not None
    follower.effects.acknowledged(effect, follower.telemetry, START)
    beat(m.PLANE_MODE_GUIDED, 1.0)
    assert ground.logged == []
    for at_s in (2.0, 3.0, 4.0):
        beat(m.PLANE_MODE_GUIDED, at_s)
    assert ground.logged.of("disobeys", 2) == ["acknowledged mode LOITER 2.0 s ago, and is still in GUIDED"]
    beat(m.PLANE_MODE_LOITER, 5.0)
    assert ground.logged.of("obeys", 2) == ["mode LOITER is over"]
    assert len(ground.logged) == 2


@pytest.mark.parametrize(("heartbeats", "accepted_s", "said"), [(2, None, True), (1, None, False), (2, 0.6, False)])
def test_setpoints_are_refused_when_none_is_accepted_for_a_second_and_two_heartbeats(
    heartbeats: int, accepted_s: float | None, said: bool
) -> None:
    ground = Ground()
    follower, channel = ground.second(), ground.second().setpoint_channels[0]
    for tenth in range(14):
        now = after(START, 0.1 * tenth)
        if accepted_s is not None and tenth == round(10 * accepted_s):
            channel.acknowledged(now)
        channel.refused(m.MAV_RESULT_DENIED, follower.telemetry.heartbeats, now)
        if tenth in range(3, 3 + heartbeats):
            follower.telemetry.heartbeats += 1
        ground.monitor.judge_refusals(now)
    assert ground.logged.of("disobeys", 2) == ["refuses its setpoints: GUIDED_CHANGE_SPEED: DENIED"] * said
    channel.invalidate()
    ground.monitor.judge_refusals(after(START, 2.0))
    assert ground.logged.of("obeys", 2) == [], "none was accepted: the run is at its end, or the vehicle was left"
    channel.acknowledged(after(START, 2.1))
    ground.monitor.judge_refusals(after(START, 2.1))
    assert ground.logged.of("obeys", 2) == ["GUIDED_CHANGE_SPEED is no longer refused"] * said


def test_each_of_several_that_refuse_is_reported_and_only_they() -> None:
    ground = Ground()
    first, second, third = ground.vehicles.values()
    for tenth in range(30):
        now = after(START, 0.1 * tenth)
        for refuses, from_s in ((first, 0.0), (second, 0.5)):
            if now >= after(START, from_s):
                refuses.setpoint_channels[0].refused(m.MAV_RESULT_DENIED, refuses.telemetry.heartbeats, now)
            refuses.telemetry.heartbeats += tenth % 10 == 0
        ground.monitor.judge_refusals(now)
    assert [event.vehicle for event in ground.logged] == [1, 2]
    second.setpoint_channels[0].acknowledged(after(START, 3.0))
    third.setpoint_channels[0].acknowledged(after(START, 3.0))
    ground.monitor.judge_refusals(after(START, 3.0))
    assert [event.vehicle for event in ground.logged if event.kind == "obeys"] == [2]


@pytest.mark.parametrize("trouble", ["refuses", "doesn't acknowledge", "doesn't follow", "none"])
def test_one_that_refuses_or_does_not_acknowledge_or_follow_is_doubted_and_no_other_is(trouble: str) -> None:
    """Others keep clear of it as of one that may fly straight on: each reason is enough."""
    ground = Ground()
    channel, telemetry = ground.second().setpoint_channels[0], ground.second().telemetry
    ground.fly(
        SETTLED_S + 3.0,
        acknowledges=lambda at_s: trouble != "doesn't acknowledge" or at_s < 1.0,
        airspeed_mps=lambda at_s: 22.0 if trouble == "doesn't follow" else 27.0 - 5.0 * math.exp(-at_s / 4.0),
    )
    end_s = SETTLED_S + 3.0
    if trouble == "refuses":
        for tenth in range(20):
            channel.refused(m.MAV_RESULT_DENIED, telemetry.heartbeats, after(START, end_s + 0.1 * tenth))
            telemetry.heartbeats += tenth % 10 == 0
        ground.monitor.judge_refusals(after(START, end_s + 2.0))
    ground.monitor.judge_silence(after(START, end_s))
    tick: Any = SimpleNamespace(active=[True] * 3)
    ground.monitor.judge_motion(tick, after(START, end_s + 2.0))
    assert ground.monitor.doubted == [False, trouble != "none", False]
