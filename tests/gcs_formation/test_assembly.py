"""When the formation counts as assembled, and what is said of a lap that is flown because it isn't."""

from __future__ import annotations

import math

import pytest

from airlink.clock import Instant, after
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation import from_scenario
from gcs_formation.control.law_interface import LawOutput
from gcs_formation.controller.assembly import ASSEMBLED_S, HYSTERESIS, Assembly
from gcs_formation.recorder import Tick, VehicleLink, unknown_state
from tests.flights.conftest import scenario

TOLERANCE_M, RATE_HZ = 1.5, 10.0
ASSEMBLED_TICKS = round(ASSEMBLED_S * RATE_HZ)
LEAVES_M = HYSTERESIS * TOLERANCE_M
STANDS = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, 0.0, 0.0)


class Watched:
    """Vehicles 2 and 3 follow vehicle 1."""

    def __init__(self) -> None:
        planned = load_scenario(scenario(start={"in_air": True, "tolerance_m": TOLERANCE_M}, law={"rate_hz": RATE_HZ}))
        self.guidance, self.assembly = from_scenario.leader_guidance(planned), Assembly(planned)
        self.ticks = 0

    def judge(
        self, *errors_m: float, axis: int = 1, on_run_in: bool = True, slots_rest: bool = True, height_m: float = 100.0
    ) -> Tick:
        """Judge a tick at which the followers are off their slots along one axis, by NaN if they don't follow."""
        now = after(Instant(0), self.ticks / RATE_HZ)
        tick = Tick(now, math.nan, "assembling", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [True] * 3)
        tick.state = [FlightState(0.0, 0.0, height_m, 0.0, 20.0, 0.0, 0.0, 0.0), *tick.state[1:]]
        for column, off_m in enumerate(errors_m, start=1):
            error_m = [0.0 * off_m] * 3
            error_m[axis] = off_m
            vector = (error_m[0], error_m[1], error_m[2])
            tick.decided[column] = LawOutput(column, unknown_state(), vector, vector, vector, (0.0,) * 9)
        self.guidance.route = self.guidance.path if on_run_in else None
        self.assembly.assess(tick, self.guidance, slots_rest=slots_rest)
        self.ticks += 1
        return tick

    def judged(self, ticks: int, *errors_m: float, slots_rest: bool = True) -> bool:
        """Judge some ticks alike; return whether the formation is assembled after them."""
        for _ in range(ticks):
            self.judge(*errors_m, slots_rest=slots_rest)
        return self.assembly.complete


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_it_is_assembled_when_all_have_been_within_the_tolerance_for_two_seconds(axis):
    watched = Watched()
    for tick in range(ASSEMBLED_TICKS + 1):
        assert watched.assembly.complete is (tick >= ASSEMBLED_TICKS)
        watched.judge(0.9 * TOLERANCE_M, -0.9 * TOLERANCE_M, axis=axis)
    other = Watched()
    for _ in range(2 * ASSEMBLED_TICKS):
        other.judge(0.0, -1.1 * TOLERANCE_M, axis=axis)
    assert not other.assembly.complete


def test_none_is_assembled_in_slots_that_move_or_without_following():
    assert not Watched().judged(2 * ASSEMBLED_TICKS, 0.0, 0.0, slots_rest=False)
    assert not Watched().judged(2 * ASSEMBLED_TICKS, 0.0, math.nan)


def test_on_the_straight_before_the_path_who_was_in_its_slot_may_be_twice_as_far_off():
    """Two real positions that drift by the tolerance sent four PX4s round again for ten minutes."""
    watched = Watched()
    assert watched.judged(ASSEMBLED_TICKS, 0.0, 0.0)
    assert watched.judged(ASSEMBLED_TICKS, 0.95 * LEAVES_M, 0.0)
    assert not watched.judged(1, 1.05 * LEAVES_M, 0.0)
    assert not watched.judged(2 * ASSEMBLED_TICKS, 0.95 * LEAVES_M, 0.0)


def test_a_leader_still_below_the_start_of_its_path_flies_a_holding_pattern_with_all_in_their_slots():
    watched = Watched()
    for _ in range(2 * ASSEMBLED_TICKS):
        watched.judge(0.0, 0.0, height_m=88.0)
    assert not watched.assembly.complete
    watched.guidance.rounds = 1
    (event,) = watched.judge(0.0, 0.0, height_m=88.0).events
    assert event.text == "the leader flies a holding pattern: it is 12 m below the start of its path"
    assert watched.judged(ASSEMBLED_TICKS, 0.0, 0.0)


def test_off_that_straight_the_tolerance_is_the_same_for_all():
    watched = Watched()
    assert watched.judged(ASSEMBLED_TICKS, 0.0, 0.0)
    watched.judge(1.1 * TOLERANCE_M, 0.0, on_run_in=False)
    assert not watched.assembly.complete


def test_a_holding_pattern_is_reported_once_with_who_was_out_of_its_slot_and_by_how_much():
    watched = Watched()
    watched.judge(0.2, -4.04)
    watched.judged(5, 0.2, 0.3)
    watched.guidance.rounds = 1
    (event,) = watched.judge(0.2, 0.3).events
    assert event.text == (
        "the leader flies a holding pattern: vehicle 3 was 4.0 m from its slot 0.6 s ago; "
        "allowed: 1.5 m (start.tolerance_m)"
    )
    assert (event.kind, str(event.vehicle), event.details) == ("lap", "3", {"laps": 1})
    assert watched.judge(0.2, 0.3).events == []
    watched.judge(math.nan, 0.0)
    watched.guidance.rounds = 2
    (event,) = watched.judge(0.0, 0.0).events
    assert "vehicle 2 was no member 0.1 s ago" in event.text
    watched.judged(ASSEMBLED_TICKS + 5, 0.0, 0.0, slots_rest=False)
    watched.guidance.rounds = 3
    (event,) = watched.judge(0.0, 0.0, slots_rest=False).events
    assert event.text == "the leader flies a holding pattern: its followers have not kept their slots for 2 s yet"
