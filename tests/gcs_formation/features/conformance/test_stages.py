"""Its three stages: what each of them judges, in which order, and what they say to other stages."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.core.cycle import IN_COMMAND, NOT_IN_COMMAND
from gcs_formation.features.conformance.feature import FEATURE
from gcs_formation.features.conformance.stages import Answers, Motion, NoMotion
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog
from tests.gcs_formation.features.conformance.test_monitor import NUMBERS, vehicle

NOW = Instant(7)


def cycle_of(judged: Any = None) -> Any:
    """Return a cycle with three vehicles and the findings at its beginning."""
    return SimpleNamespace(
        scenario=load_scenario(scenario()),
        controller=judged,
        vehicles={VehicleId(1, number): vehicle(number) for number in NUMBERS},
        log_event=EventLog(),
        findings=SimpleNamespace(doubted=None, sinking=None, saturated=[False, True, False]),
        tick=SimpleNamespace(active=[True] * 3),
        now=NOW,
    )


class Called:
    """A monitor that records what it is asked to judge."""

    def __init__(self) -> None:
        self.calls, self.doubted, self.sinking = list[tuple[Any, ...]](), [False, True], {VehicleId(1, 2)}
        self.saturated = list[bool]()

    def __getattr__(self, name: str) -> Any:
        return lambda *given: self.calls.append((name, *given))


def test_answers_are_judged_from_the_effects_of_commands_to_the_silence_of_channels() -> None:
    called: Any = Called()
    Answers(called).run(cycle_of())
    names = "judge_commands", "judge_answers", "judge_refusals", "judge_silence"
    assert called.calls == [(name, NOW) for name in names]


def test_motion_is_judged_by_the_tick_and_the_findings_have_who_is_doubted_and_who_sinks() -> None:
    called: Any = Called()
    cycle = cycle_of()
    stage = Motion(called, cycle)
    assert cycle.findings.doubted is called.doubted
    assert cycle.findings.sinking is called.sinking
    assert called.saturated is cycle.findings.saturated
    stage.run(cycle)
    assert called.calls == [("judge_motion", cycle.tick, NOW)]


def test_where_no_setpoints_are_sent_no_motion_is_expected() -> None:
    called: Any = Called()
    NoMotion(called).run(cycle_of())
    assert called.calls == [("stand_down",)]


def test_motion_is_judged_where_setpoints_are_sent_and_none_is_doubted_at_the_beginning() -> None:
    cycle = cycle_of()
    answers, motion, no_motion = FEATURE.stages(cycle)
    assert isinstance(answers, Answers)
    assert isinstance(motion, Motion)
    assert isinstance(no_motion, NoMotion)
    assert (motion.when, no_motion.when) == (IN_COMMAND, NOT_IN_COMMAND)
    assert (cycle.findings.doubted, cycle.findings.sinking) == ([False] * 3, set())
