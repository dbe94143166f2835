"""When a follower takes over, and which: by the rank of links, and by who flies, may come back, or sinks."""

from __future__ import annotations

import math
from itertools import permutations
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from gcs_formation.features.succession.candidates import Candidate, best_successor, can_lead
from gcs_formation.features.succession.stages import Succession, successor
from gcs_formation.phases import Phase
from gcs_formation.vehicle.member import Member

SPACING_M = 30.0
NOW = after(Instant(0), 10.0)
ALIKE = Candidate(2, 40.0, 0.04, 0.04, 0.01)
"""In the middle of the steps in which links are compared: 20 ms, 2 % and 5 ms."""


def varied(index: int, figure: str, value: float) -> Candidate:
    figures: dict[str, Any] = ALIKE._asdict() | {"vehicle_index": index, figure: value}
    return Candidate(**figures)


def first_of(other: Candidate, spacing_m: float = SPACING_M) -> int | None:
    """Return who leads of the usual candidate, 2, and another one."""
    found = best_successor([ALIKE, other], spacing_m)
    assert found == best_successor([other, ALIKE], spacing_m)
    return found


@pytest.mark.parametrize(
    ("figure", "better", "alike"),
    [
        ("delay_s", 0.0299, (0.0301, 0.0499)),
        ("loss", 0.0299, (0.0301, 0.0499)),
        ("jitter_s", 0.0074, (0.0076, 0.0124)),
        ("distance_m", 39.4, (39.6, 40.4)),
    ],
)
def test_figures_within_a_step_of_each_other_decide_nothing_and_a_step_less_does(
    figure: str, better: float, alike: tuple[float, float]
) -> None:
    """Then the lowest index leads. 3 is better by a step of one figure."""
    assert first_of(varied(3, figure, better)) == 3
    for value in alike:
        assert first_of(varied(3, figure, value)) == 2
        assert first_of(varied(1, figure, value)) == 1
    assert first_of(varied(1, figure, 2.0 * getattr(ALIKE, figure) - better)) == 2


@pytest.mark.parametrize("figure", ["delay_s", "jitter_s"])
def test_what_is_not_known_of_a_link_is_worse_than_any_figure(figure: str) -> None:
    assert first_of(varied(1, figure, math.nan)) == 2
    assert best_successor([varied(2, figure, math.nan)], SPACING_M) == 2


@pytest.mark.parametrize(("distance_m", "leads"), [(70.0, 1), (70.01, 2)])
def test_a_better_link_counts_up_to_a_spacing_beyond_the_nearest(distance_m: float, leads: int) -> None:
    assert first_of(Candidate(1, distance_m, 0.0, 0.0, 0.0)) == leads


FIGURES = st.tuples(*(st.integers(0, 3) for _ in range(4)))


@settings(max_examples=25)
@given(st.lists(FIGURES, min_size=1, max_size=4))
def test_of_candidates_near_one_another_the_one_with_the_least_figures_in_their_order_leads(
    each: list[tuple[int, ...]],
) -> None:
    """In whatever order they come: delay in 20 ms, loss in 2 %, jitter in 5 ms, distance in metres."""
    made = [
        Candidate(index, 40.0 + metres, 0.02 * delay, 0.02 * loss, 0.005 * jitter)
        for index, (delay, loss, jitter, metres) in enumerate(each)
    ]
    best = each.index(min(each))
    assert {best_successor(order, SPACING_M) for order in permutations(made)} == {best}


@pytest.mark.parametrize(("received_s", "age_s", "can"), [(1.0, 1.0, True), (1.001, 1.0, False), (1.0, 1.001, False)])
def test_a_second_is_the_longest_silence_of_one_that_may_lead(received_s: float, age_s: float, can: bool) -> None:
    vehicle: Any = SimpleNamespace(round_trips=SimpleNamespace(received_at=lambda now: after(now, -received_s)))
    assert can_lead(vehicle, age_s, NOW) is can


def test_a_candidate_has_the_figures_of_its_link() -> None:
    vehicle: Any = SimpleNamespace(
        clock=SimpleNamespace(one_way_s=0.3),
        sequence=SimpleNamespace(loss=0.2),
        jitter=SimpleNamespace(jitter_s=0.1),
    )
    assert Candidate.of(4, vehicle, 55.0) == (4, 55.0, 0.3, 0.2, 0.1)


class Flight:
    """A leader and three followers 40, 60 and 90 m behind it, all alike, in a formation with a spacing of 30 m."""

    def __init__(self) -> None:
        self.now = NOW
        self.each = [self._vehicle(index) for index in range(4)]
        self.ages_s, self.fresh, self.late_orders = [0.1] * 4, [True] * 4, set[int]()
        self.reconfiguration = SimpleNamespace(leader=self.each[0], replace_leader=Mock())
        self.flight = SimpleNamespace(phase=Phase.FLYING)
        self.findings = SimpleNamespace(beyond=set(), sinking=set[VehicleId]())
        self.membership = SimpleNamespace(
            is_fresh=lambda vehicle, *_: self.fresh[vehicle.index],
            judge_one=Mock(),
            order_may_come=lambda vehicle, now: vehicle.index in self.late_orders and now == NOW,
        )
        states = [FlightState(-behind_m, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0) for behind_m in (0, 40, 60, 90)]
        plan = SimpleNamespace(leader=0, arrangement=SimpleNamespace(spacing_m=SPACING_M))
        estimator = SimpleNamespace(age_s=lambda index, _: self.ages_s[index])
        self.controller = SimpleNamespace(estimator=estimator, plan=plan, last_tick=SimpleNamespace(state=states))
        self.scenario = SimpleNamespace(formation=SimpleNamespace(succession="nearest"))

    @staticmethod
    def _vehicle(index: int) -> Any:
        return SimpleNamespace(
            index=index,
            identity=VehicleId(1, index + 1),
            member=Member.FLYING,
            round_trips=SimpleNamespace(received_at=lambda now: now),
            clock=SimpleNamespace(one_way_s=0.1),
            sequence=SimpleNamespace(loss=0.0),
            jitter=SimpleNamespace(jitter_s=0.001),
        )

    def lose(self) -> None:
        """Let the leader be judged lost."""
        self.each[0].member = Member.NO_LINK

    def successor(self) -> int | None:
        """Let the stage run; return who is reported to lead."""
        cycle: Any = self
        Succession().run(cycle)
        calls = self.reconfiguration.replace_leader.call_args_list
        assert [each.args[1] for each in calls] == [NOW] * len(calls)
        return calls[-1].args[0] if calls else None


@pytest.fixture
def flight() -> Flight:
    return Flight()


def test_a_leader_that_flies_is_not_replaced_and_a_lost_one_is_by_the_nearest(flight: Flight) -> None:
    assert flight.successor() is None
    flight.membership.judge_one.assert_called_once()
    flight.lose()
    assert flight.successor() == 1


@pytest.mark.parametrize(
    ("phase", "replaced"),
    [
        (Phase.CONNECTING, False),
        (Phase.LOITERING, False),
        (Phase.ASSEMBLING, True),
        (Phase.FLYING, True),
        (Phase.ENDING, True),
    ],
)
def test_it_is_replaced_only_while_the_formation_is_commanded(flight: Flight, phase: Phase, replaced: bool) -> None:
    flight.lose()
    flight.flight.phase = phase
    assert (flight.successor() is not None) is replaced
    assert flight.membership.judge_one.called is replaced


def test_without_a_leader_there_is_none_to_replace(flight: Flight) -> None:
    flight.lose()
    flight.reconfiguration.leader = None
    assert flight.successor() is None


def test_one_with_a_better_link_leads_if_it_is_within_a_spacing_of_the_nearest(flight: Flight) -> None:
    flight.lose()
    flight.each[3].clock.one_way_s = 0.0
    assert flight.successor() == 1
    flight.each[2].clock.one_way_s = 0.02
    assert flight.successor() == 2


@pytest.mark.parametrize("why", ["sinks", "holds", "is not received", "does not receive"])
def test_who_sinks_or_does_not_fly_along_or_is_not_heard_does_not_lead(flight: Flight, why: str) -> None:
    flight.lose()
    nearest = flight.each[1]
    if why == "sinks":
        flight.findings.sinking.add(nearest.identity)
    elif why == "holds":
        nearest.member = Member.HOLDING
    elif why == "is not received":
        flight.ages_s[1] = 1.1
    else:
        nearest.round_trips = SimpleNamespace(received_at=lambda now: after(now, -1.1))
    assert flight.successor() == 2


@pytest.mark.parametrize("member", [Member.HOLDING, Member.RETURNING, Member.PARTED, Member.HOMEWARD])
def test_where_none_flies_along_one_leads_that_loiters_and_is_heard(flight: Flight, member: Member) -> None:
    flight.lose()
    for each in flight.each[1:]:
        each.member = member
    flight.fresh = [True, False, True, True]
    loiters = member in (Member.HOLDING, Member.RETURNING)
    assert flight.successor() == (2 if loiters else None)


@pytest.mark.parametrize(
    ("late_order", "is_fresh", "replaced"), [(True, True, False), (True, False, True), (False, True, True)]
)
def test_a_leader_that_a_late_command_has_made_loiter_is_given_time_to_come_back(
    flight: Flight, late_order: bool, is_fresh: bool, replaced: bool
) -> None:
    flight.each[0].member = Member.HOLDING
    flight.late_orders = {0} if late_order else set()
    flight.fresh[0] = is_fresh
    assert (flight.successor() is not None) is replaced


@pytest.mark.parametrize("why", ["none may", "nothing is known yet"])
def test_none_takes_over_where_none_is_to_or_before_the_first_setpoints(flight: Flight, why: str) -> None:
    """A leader that sinks goes on leading then."""
    cycle: Any = flight
    if why == "none may":
        flight.scenario.formation.succession = "none"
    else:
        flight.controller.last_tick = None
    assert successor(cycle) is None
    flight.findings.sinking.add(flight.each[0].identity)
    assert flight.successor() is None
    flight.lose()
    assert flight.successor() is None


def test_a_leader_that_sinks_is_replaced_as_soon_as_another_can_lead(flight: Flight) -> None:
    flight.findings.sinking.add(flight.each[0].identity)
    assert flight.successor() == 1


def test_one_that_has_been_quiet_for_a_while_is_judged_silent_only_if_another_can_lead(flight: Flight) -> None:
    """Its telemetry is fresh by the usual limit and late by the shorter one."""

    def is_fresh(*arguments: Any) -> bool:
        return len(arguments) == 4

    flight.membership.is_fresh = is_fresh
    for succession, fresh in (("nearest", False), ("none", True)):
        flight.scenario.formation.succession = succession
        flight.successor()
        assert flight.membership.judge_one.call_args.kwargs == {"fresh": fresh}
