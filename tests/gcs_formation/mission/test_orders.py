"""Which orders are carried out, when, and what is reported about the others."""

from __future__ import annotations

from typing import Any

import pytest

from airlink.clock import Instant, after
from formation_scenario import load_scenario
from formation_scenario.formation import FormationChange
from formation_scenario.orders import End
from formation_scenario.transition_plan import NotFlyableError
from gcs_formation.mission.orders import Orders
from gcs_formation.phases import OVER, Cause, Flight, Phase
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog

START = Instant(0)


class Formation:
    """Accepts every change and end, unless it is set to refuse."""

    def __init__(self, phase: Phase = Phase.FLYING, planned: dict[float, str] | None = None) -> None:
        self.done: list[Any] = []
        self.refusal: str | None = None
        self.unflown: list[str] = []
        self.left: list[str] = []
        self.cut_short = False
        self.error: Exception | None = None
        self.flight, self.logged = Flight(phase), EventLog()
        self.record_lateness: Any = lambda _: None
        keys = scenario(orders=[{"at_s": at_s, "order": order} for at_s, order in (planned or {}).items()])
        formation: Any = self
        self.orders = Orders(load_scenario(keys), formation, formation, self.logged)

    def under_way(self, ended: Instant | None) -> list[str]:
        return ["a change is under way"] if ended else []

    def order_speed(self, speed_mps: float, now: Instant) -> str | None:
        return self._do(speed_mps)

    def order_change(self, change: FormationChange, now: Instant) -> str | None:
        return self._do((change.shape, change.spacing_m, change.leader))

    def end_by_order(self, manner: End, now: Instant) -> str | None:
        if self.refusal is None:
            self.cut_short = self.cut_short or self.flight.phase not in OVER
            self.flight.move(Cause.ORDERED, now)
        return self._do(manner)

    def _do(self, what: Any) -> str | None:
        if self.error:
            raise self.error
        if self.refusal is None:
            self.done.append(what)
        return self.refusal


@pytest.mark.parametrize(
    ("text", "done"),
    [
        ("speed 24", 24.0),
        ("shape line 40", ("line", 40.0, None)),
        ("spacing 25", (None, 25.0, None)),
        ("leader 3", (None, None, 3)),
        ("land", "land"),
    ],
)
def test_an_order_is_carried_out_and_said_to_be(text: str, done: Any) -> None:
    formation = Formation()
    assert formation.orders.execute(text, START) == (True, f"{text}: accepted")
    assert formation.done == [done]
    (said,) = formation.logged
    assert (said.kind, said.text, said.details) == ("order", f"{text}: accepted", {"accepted": True})


def test_what_can_not_be_flown_is_refused_with_the_reason_any_that_finds_it() -> None:
    formation = Formation()
    formation.refusal = "found 40 m/s; allowed: 16 to 28 m/s"
    assert formation.orders.execute("speed 40", START) == (False, f"speed 40: refused: {formation.refusal}")
    for error in (NotFlyableError("a way of 9 m/s", "2 m/s", 3.0), ValueError("no vehicle 9")):
        formation.error = error
        answer = formation.orders.execute("leader 9", START)
        assert answer == (False, f"leader 9: refused: {error}")
        assert formation.logged[-1].details == {"accepted": False}
    assert formation.done == []


def test_what_is_no_order_is_refused_with_what_is_allowed() -> None:
    answer = Formation().orders.execute("sahpe line", START)
    assert not answer.accepted
    assert answer.text.startswith("sahpe line: refused: found 'sahpe line'; allowed: shape NAME [SPACING_M], ")


@pytest.mark.parametrize("phase", list(Phase))
def test_changes_are_for_a_formation_that_flies_and_its_end_for_any_time(phase: Phase) -> None:
    formation, taken = Formation(phase), phase in (Phase.ASSEMBLING, Phase.FLYING)
    for text in ("speed 24", "shape line"):
        assert formation.orders.execute(text, START).accepted is taken
    assert len(formation.done) == 2 * taken
    if not taken:
        assert formation.logged[0].text.endswith(f"the run is {phase.value}; allowed: assembling, flying")
    assert formation.orders.execute("loiter", START).accepted


def test_planned_orders_that_are_refused_are_left_undone_and_so_is_a_change_that_is_still_postponed() -> None:
    formation = Formation(planned={5: "speed 24", 9: "speed 40"})
    formation.flight.path_began = START
    formation.orders.advance(after(START, 6.0))
    formation.refusal = "found 40 m/s"
    formation.orders.advance(after(START, 10.0))
    assert not formation.orders.execute("speed 50", START).accepted
    assert formation.orders.undone == ["order at 9 s: speed 40: refused: found 40 m/s"], "the operator was told"
    formation.unflown, formation.left = ["the change to line wasn't flown"], ["the change of the formation at 20 s"]
    assert formation.orders.undone[1:] == formation.unflown + formation.left


def test_an_order_that_the_flights_end_leaves_no_time_for_is_left_undone_unless_it_was_cut_short() -> None:
    formation = Formation(planned={9: "shape line", 90: "land"})
    formation.flight.path_began = START
    formation.flight.move(Cause.PATH_ENDED, after(START, 8.0))
    formation.orders.advance(after(START, 10.0))
    refused = "order at 9 s: shape line: refused: the run is ending; allowed: assembling, flying"
    assert formation.orders.undone == [refused, "order at 90 s: land: the flight was over", "a change is under way"]
    formation.cut_short = True
    assert formation.orders.undone == [refused]


def test_the_last_of_several_planned_orders_to_end_the_flight_counts() -> None:
    """None of them counts if the flight was cut short otherwise: by the operator, or by `--until`."""
    formation, cut = Formation(planned={9: "rtl", 10: "loiter"}), Formation(planned={9: "rtl", 10: "loiter"})
    for each in (formation, cut):
        each.flight.path_began = START
    cut.orders.execute("land", after(START, 8.0))
    for at_s in (9.0, 10.0):
        for each in (formation, cut):
            each.orders.advance(after(START, at_s))
    assert (formation.done, cut.done) == (["rtl", "loiter"], ["land"])
    assert formation.orders.undone == cut.orders.undone == []


def test_planned_orders_are_given_when_they_are_due_each_once_in_the_order_of_their_times() -> None:
    formation = Formation(Phase.ASSEMBLING, {20: "speed 24", 5: "shape line", 5.5: "spacing 25"})
    formation.orders.advance(after(START, 60.0))
    assert formation.done == [], "the path hasn't begun"
    formation.flight.move(Cause.PATH_BEGUN, after(START, 60.0))
    found: list[int] = []
    for at_s in (4.9, 5.0, 5.1, 19.0, 21.0, 30.0):
        formation.orders.advance(after(START, 60.0 + at_s))
        found.append(len(formation.done))
    assert found == [0, 1, 1, 2, 3, 3]
    assert formation.done == [("line", None, None), (None, 25.0, None), 24.0]
    late = Formation(planned={1: "speed 24", 2: "speed 25"})
    late.flight.path_began = START
    late.orders.advance(after(START, 9.0))
    assert late.done == [24.0, 25.0]
