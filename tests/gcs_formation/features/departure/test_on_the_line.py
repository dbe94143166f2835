"""Who stands ahead of whom on a line of take-off, and who flies straight on until the formation is commanded."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from gcs_formation.features.departure.awaiting import AwaitingFormation
from gcs_formation.features.departure.feature import FEATURE
from gcs_formation.features.departure.take_off_order import TakeOffOrder, is_ahead
from gcs_formation.phases import Phase
from gcs_formation.vehicle.member import Member
from tests.gcs_formation.event_log import EventLog
from tests.gcs_formation.features.departure.test_departure import judged, standing

PLACE = st.floats(-2000.0, 2000.0)
LINE_MPS = 22.0


@settings(max_examples=30)
@given(PLACE, PLACE, st.floats(-360.0, 360.0), st.floats(-50.0, 650.0), st.floats(-30.0, 30.0))
def test_a_line_of_take_off_is_600_m_long_and_25_m_wide_to_either_side_wherever_it_leads(
    north_m: float, east_m: float, yaw_deg: float, along_m: float, right_m: float
) -> None:
    """It turns and moves with the one that takes off, and is its own mirror image."""
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    inside_m = min(along_m, 600.0 - along_m, 25.0 - abs(right_m))
    vehicle = standing(1, north_m, east_m, yaw_deg=yaw_deg)
    for lateral_m in (right_m, -right_m):
        place = north_m + along_m * cos - lateral_m * sin, east_m + along_m * sin + lateral_m * cos
        assert abs(inside_m) < 1e-6 or is_ahead(standing(2, *place), vehicle) == (inside_m > 0.0)


@pytest.mark.parametrize(
    ("north_m", "east_m", "ahead"),
    [
        (0.0, 0.0, False),
        (0.1, 0.0, True),
        (599.9, 0.0, True),
        (600.0, 0.0, False),
        (60.0, 24.9, True),
        (60.0, 25.0, False),
        (60.0, -25.0, False),
    ],
)
def test_the_ends_and_sides_of_that_line_are_not_on_it(north_m: float, east_m: float, ahead: bool) -> None:
    assert is_ahead(standing(2, north_m, east_m), standing(1, 0.0, 0.0)) is ahead


@pytest.mark.parametrize("yaw_deg", [60.0, -60.0, 150.0])
@pytest.mark.parametrize(
    ("along_m", "right_m", "ahead"),
    [(590.0, 0.0, True), (610.0, 0.0, False), (-10.0, 0.0, False), (300.0, 24.0, True), (300.0, 26.0, False)],
)
def test_a_line_in_any_direction_ends_there_too(yaw_deg: float, along_m: float, right_m: float, ahead: bool) -> None:
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    for lateral_m in (right_m, -right_m):
        other = standing(2, 40.0 + along_m * cos - lateral_m * sin, -70.0 + along_m * sin + lateral_m * cos)
        assert is_ahead(other, standing(1, 40.0, -70.0, yaw_deg=yaw_deg)) is ahead


@pytest.mark.parametrize("unknown", ["its own place", "the other's place", "its nose", "it is the same"])
def test_where_a_place_or_the_nose_is_not_known_none_is_ahead(unknown: str) -> None:
    one, other = standing(1, 0.0, 0.0), standing(2, 60.0, 0.0)
    assert is_ahead(other, one)
    if unknown == "its own place":
        one.telemetry.motion = None
    elif unknown == "the other's place":
        other.telemetry.motion = None
    elif unknown == "its nose":
        one.telemetry.attitude = None
    else:
        other = one
    assert not is_ahead(other, one)


def test_of_those_in_line_only_the_foremost_on_the_ground_may_be_armed() -> None:
    """One after another, whatever their numbers; who stands beside doesn't wait for them."""
    line = [standing(number, north_m, 0.0) for number, north_m in ((3, 0.0), (1, -60.0), (4, 60.0), (2, 120.0))]
    beside = standing(5, -60.0, 40.0)
    for front in sorted(line, key=lambda each: -each.telemetry.motion.north_m):
        assert judged(*line, beside) == [each is front or each.telemetry.armed for each in line] + [True]
        front.telemetry.armed = True


def test_two_nose_to_nose_do_not_wait_for_each_other_whichever_is_named_first() -> None:
    for first, second in ((1, 2), (2, 1)):
        one, other = standing(first, 0.0, 0.0), standing(second, 100.0, 0.0, yaw_deg=180.0)
        assert judged(one, other) == [first < second, second < first]


def test_multirotors_neither_wait_nor_are_waited_for() -> None:
    copter, plane = standing(1, 60.0, 0.0), standing(2, 0.0, 0.0)
    copter.autopilot.hovers, copter.start_up.ready_to_arm, copter.start_up.may_arm = True, False, None
    assert judged(copter, plane) == [None, True]


def said(*vehicles: Any, seconds: float) -> list[tuple[float, int | None, str]]:
    log = EventLog()
    cycle: Any = SimpleNamespace(each=list(vehicles), flight=SimpleNamespace(phase=Phase.CONNECTING), log_event=log)
    stage = TakeOffOrder(cycle)
    for tenth in range(round(10.0 * seconds)):
        cycle.now = after(Instant(0), 50.0 + 0.1 * tenth)
        stage.run(cycle)
    assert {each.kind for each in log} <= {"take_off_order"}
    return [(each.at_s - 50.0, each.vehicle, each.text) for each in log]


def test_each_that_waits_is_said_to_wait_for_the_first_that_is_not_ready_after_3_s_and_only_once() -> None:
    one, other, third = (standing(number, 0.0, 30.0 * number) for number in (1, 2, 3))
    other.start_up.ready_to_arm = third.start_up.held = False
    assert said(one, other, third, seconds=30.0) == [
        (pytest.approx(3.1), 1, "stays on the ground until vehicle 2 is ready")
    ]


@pytest.mark.parametrize("lacks", ["held", "ready_to_arm"])
def test_nothing_is_said_of_one_that_is_not_held_back_or_could_not_be_armed_anyway(lacks: str) -> None:
    one, other = standing(1, 60.0, 0.0), standing(2, 0.0, 0.0)
    setattr(other.start_up, lacks, False)
    one.start_up.held = False
    assert said(one, other, seconds=10.0) == []


class Waiting:
    """A fixed wing that has climbed out at 80 m, with its nose a little off the course of its take-off."""

    def __init__(self, number: int, *, hovers: bool = False) -> None:
        self.identity, self.member = VehicleId(1, number), Member.FLYING
        self.autopilot = SimpleNamespace(hovers=hovers)
        self.take_off = SimpleNamespace(course_rad=0.5)
        self.sampler = SimpleNamespace(extrapolated=self._extrapolated)
        self.height_m, self.known, self.awaited = 80.0, True, True
        self.asked = list[tuple[float, float, float, float, float, Instant]]()

    def _extrapolated(self, _: Instant) -> tuple[FlightState, float] | None:
        if not self.known:
            return None
        return FlightState(0.0, 0.0, self.height_m, 0.0, 20.0, 0.6, math.nan, math.nan), 0.1

    def new_setpoints(self, setpoint: Any, where: FlightState, at: Instant) -> list[str]:
        wind = where.wind_north_mps, where.wind_east_mps
        self.asked.append((setpoint.speed_mps, setpoint.heading_rad, setpoint.height_m, *wind, at))
        return ["speed", "heading"]


class Connecting:
    """A cycle before the formation is commanded, with what it sends."""

    def __init__(self, *vehicles: Waiting) -> None:
        self.each, self.sent = list(vehicles), list[tuple[Any, str]]()
        self.flight, self.now = SimpleNamespace(phase=Phase.CONNECTING), Instant(0)
        self.findings = SimpleNamespace(waiting=set[VehicleId]())
        self.scenario = SimpleNamespace(path=SimpleNamespace(begin_mps=LINE_MPS))
        self.reconfiguration = SimpleNamespace(leader=None)

    def send(self, messages: list[tuple[Any, str]], now: Instant) -> None:
        assert now == self.now
        self.sent += messages

    def run(self, stage: AwaitingFormation, at_s: float) -> None:
        self.now = after(Instant(0), at_s)
        stage.run(self)  # type: ignore[arg-type]


def made(*vehicles: Waiting) -> tuple[Connecting, AwaitingFormation]:
    cycle = Connecting(*vehicles)
    stub: Any = cycle
    return cycle, AwaitingFormation(stub)


def test_one_that_waits_is_commanded_along_its_take_off_at_the_height_where_that_ended_from_1_s_to_20_s() -> None:
    """At the speed of the path; no wind is known yet. It isn't said again to fly as it has come to fly meanwhile."""
    plane = Waiting(1)
    cycle, stage = made(plane, Waiting(2))
    cycle.each[1].member = Member.STARTING
    begun_s = 5.0
    for waited_s, commanded in ((0.0, 0), (0.9, 0), (1.0, 1), (10.0, 2), (20.0, 3), (20.1, 3), (50.0, 3)):
        cycle.run(stage, begun_s + waited_s)
        plane.height_m += 7.0
        assert len(plane.asked) == commanded
        assert cycle.findings.waiting == ({plane.identity} if waited_s > 20.0 else set())
    times_s = [begun_s + waited_s for waited_s in (1.0, 10.0, 20.0)]
    assert plane.asked == [(LINE_MPS, 0.5, 80.0, 0.0, 0.0, after(Instant(0), at_s)) for at_s in times_s]
    assert cycle.sent == [(plane, "speed"), (plane, "heading")] * 3


def test_when_all_are_there_those_that_circle_fly_straight_on_again() -> None:
    plane, late = Waiting(1), Waiting(2)
    cycle, stage = made(plane, late)
    late.member = Member.STARTING
    for at_s in (0.0, 21.0):
        cycle.run(stage, at_s)
    plane.member = Member.HOLDING
    assert cycle.findings.waiting == {plane.identity}
    cycle.run(stage, 22.0)
    assert cycle.findings.waiting == {plane.identity}, "the other isn't there"
    late.member = Member.FLYING
    cycle.run(stage, 30.0)
    assert cycle.findings.waiting == set()
    plane.member = Member.FLYING
    cycle.run(stage, 31.0)
    for each in (plane, late):
        each.asked.clear()
    cycle.run(stage, 32.0)
    assert [len(each.asked) for each in (plane, late)] == [1, 1]


@pytest.mark.parametrize("leads", [False, True])
def test_one_that_its_pilot_has_is_not_waited_for_unless_it_is_to_lead(*, leads: bool) -> None:
    plane, taken = Waiting(1), Waiting(2)
    cycle, stage = made(plane, taken)
    taken.member, taken.awaited = Member.STARTING, False
    cycle.reconfiguration.leader = taken if leads else None
    for at_s in (0.0, 21.0):
        cycle.run(stage, at_s)
    plane.member = Member.HOLDING
    cycle.run(stage, 22.0)
    assert cycle.findings.waiting == ({plane.identity} if leads else set())


@pytest.mark.parametrize("lacks", ["membership", "a course", "a position", "wings"])
def test_who_does_not_wait_or_is_not_known_well_enough_is_not_commanded(lacks: str) -> None:
    plane = Waiting(1, hovers=lacks == "wings")
    cycle, stage = made(plane)
    if lacks == "membership":
        plane.member = Member.PARTED
    plane.known = lacks != "a position"
    plane.take_off.course_rad = None if lacks == "a course" else 0.5
    for at_s in (0.0, 2.0, 30.0):
        cycle.run(stage, at_s)
    assert (plane.asked, cycle.sent, cycle.findings.waiting) == ([], [], set())


def test_once_the_formation_is_commanded_none_is_reported_to_fly_straight_on() -> None:
    plane = Waiting(1)
    cycle, stage = made(plane)
    cycle.run(stage, 0.0)
    cycle.findings.waiting.add(plane.identity)
    cycle.flight.phase = Phase.ASSEMBLING
    cycle.run(stage, 2.0)
    assert plane.asked == []
    assert cycle.findings.waiting == {plane.identity}


def test_it_is_decided_who_may_be_armed_and_where_those_fly_that_wait() -> None:
    stub: Any = Connecting(Waiting(1))
    assert [type(each) for each in FEATURE.stages(stub)] == [TakeOffOrder, AwaitingFormation]
