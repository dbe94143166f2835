"""In which cycles a stage runs, and what features bring of which there may be one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant
from gcs_formation.core import feature
from gcs_formation.core.cycle import ALWAYS, EACH_SECOND, IN_COMMAND, LED, NOT_IN_COMMAND, Cycle, Stage
from gcs_formation.errors import RunAbortedError
from gcs_formation.phases import Flight, Phase

NAMES = {ALWAYS: "always", EACH_SECOND: "second", IN_COMMAND: "command", NOT_IN_COMMAND: "other", LED: "led"}


def cycle_of(phase: Phase, *, led: bool, ran: list[str]) -> Cycle:
    """Return a cycle whose stages note that they run; the first two decide as `begin` and `leader` do."""

    def stage(called: str, runs: int) -> Stage:
        class Noting(Stage):
            name, when = called, runs

            def run(self, cycle: Cycle) -> None:
                ran.append(called)
                if called == "decides":
                    cycle.decide()
                if called == "command":
                    cycle.follow_leader(led=led)

        made: Any = Noting
        return made()

    made: Any = Cycle.__new__(Cycle)
    made.flight, made._holds = Flight(phase), [False] * 5
    made.order([stage("decides", ALWAYS), *(stage(called, runs) for runs, called in NAMES.items())])
    return made


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("second", [True, False])
@pytest.mark.parametrize("led", [True, False])
def test_a_stage_runs_in_the_cycles_that_it_says(phase: Phase, *, second: bool, led: bool) -> None:
    """The formation is commanded from assembly until vehicles circle at the end; followers need a leader."""
    ran = list[str]()
    cycle = cycle_of(phase, led=led, ran=ran)
    cycle.begins = True
    cycle.run(Instant(5), second=second)
    commands = phase in (Phase.ASSEMBLING, Phase.FLYING, Phase.ENDING)
    expected = ["decides", "always"] + ["second"] * second + ["command"] * commands + ["other"] * (not commands)
    assert ran == expected + ["led"] * (commands and led)
    assert (cycle.now, cycle.begins) == (5, False)


def test_what_held_in_one_cycle_says_nothing_of_the_next() -> None:
    ran = list[str]()
    cycle = cycle_of(Phase.FLYING, led=True, ran=ran)
    cycle.run(Instant(0), second=True)
    cycle.flight = Flight(Phase.LOITERING)
    ran.clear()
    cycle.run(Instant(1), second=False)
    assert ran == ["decides", "always", "other"]


def test_a_stage_is_found_by_its_name() -> None:
    cycle = cycle_of(Phase.FLYING, led=True, ran=[])
    assert cycle.stage("led").when == LED
    assert [each.name for each in cycle.stages] == ["decides", *NAMES.values()]
    with pytest.raises(KeyError, match="found 'flies'; allowed: decides, always, second, command, other, led"):
        cycle.stage("flies")


def test_of_what_only_one_feature_may_bring_two_are_refused_by_name() -> None:
    assert feature.only_one({}, "ends flights") is None
    assert feature.only_one({"a": None, "b": None}, "ends flights") is None
    assert feature.only_one({"a": None, "b": 3}, "ends flights") == 3
    with pytest.raises(RunAbortedError, match="found features a, c, each of which ends flights; allowed: one of them"):
        feature.only_one({"a": 1, "b": None, "c": 2}, "ends flights")


def test_without_a_feature_that_resumes_flights_none_is_resumed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feature, "features", dict)
    nothing: Any = SimpleNamespace(phase_machine=SimpleNamespace(endings=None))
    with pytest.raises(RunAbortedError, match="found no feature that resumes a flight; allowed: fly it from its start"):
        feature.resumed_beginning(nothing, nothing)
    feature.take_endings(nothing)
    assert nothing.phase_machine.endings is None
