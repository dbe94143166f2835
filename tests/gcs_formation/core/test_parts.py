"""The parts of a station work together: a short flight of a leader and a follower, stage by stage."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant, after
from airlink.messages.system import Heartbeat
from airlink.stream_parser import StreamParser
from formation_scenario import load_scenario
from gcs_formation.core import feature, parts
from gcs_formation.core.cycle import ALWAYS, EACH_SECOND, IN_COMMAND, LED, NOT_IN_COMMAND, Cycle, Findings, Stage
from gcs_formation.core.feature import Feature, derived, features, resumed_beginning, take_endings
from gcs_formation.core.parts import Parts
from gcs_formation.core.sending import Phases
from gcs_formation.core.stages import core_stages, ordered
from gcs_formation.errors import RunAbortedError
from gcs_formation.mission.beginning import Beginning
from gcs_formation.mission.gate import UNCHECKED
from gcs_formation.phases import COMMANDED, Phase
from tests.flights.in_memory import MemoryRecorder, World

KEYS: dict[str, Any] = {"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}


class Kept(MemoryRecorder):
    """Keeps frames, too."""

    def __init__(self) -> None:
        super().__init__()
        self.raws = list[tuple[float, bytes]]()

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        self.raws += [(now / NANOSECONDS, raw) for raw in raws]


@cache
def flown() -> tuple[World, Kept]:
    """Fly 1 s along the path, 6 s after the start in the air, and circle for 0.5 s at the end."""
    kept = Kept()
    world = World(recorder=lambda _: kept, duration_s=1, vehicles={"count": 2}, finish={"loiter_s": 0.5})
    world.run()
    return world, kept


def test_a_flight_goes_through_its_phases_and_is_counted() -> None:
    world, kept = flown()
    assert world.words("phase") == ["assembling", "flying", "ending", "loitering", "done"]
    recorded = [tick.phase for tick in kept.ticks]
    assert list(dict.fromkeys(recorded)) == ["connecting", "assembling", "flying", "ending", "loitering"]
    commanded = [tick for tick in kept.ticks if tick.phase in [phase.value for phase in COMMANDED]]
    station = world.station
    assert (station.controlled_ticks, station.recorded_ticks) == (len(commanded), len(kept.ticks))
    assert (station.last_tick, station.newest) == (commanded[-1], kept.ticks[-1])
    assert recorded.count("flying") == 10
    assert station.features == tuple(features())


def test_ticks_come_at_the_rate_of_the_law_with_a_mission_time_from_the_paths_begin() -> None:
    world, kept = flown()
    times_s = np.array([tick.now for tick in kept.ticks]) / NANOSECONDS
    np.testing.assert_allclose(np.diff(times_s), 0.1, atol=1e-9)
    (begun_s,) = world.times_s("phase", text="flying")
    mission_s = np.array([tick.mission_time_s for tick in kept.ticks])
    np.testing.assert_allclose(mission_s[times_s > begun_s], times_s[times_s > begun_s] - begun_s, atol=1e-9)
    assert np.isnan(mission_s[times_s <= begun_s]).all()


def test_who_flies_in_the_formation_has_setpoints_and_others_have_none() -> None:
    """The follower has a slot until the end begins, and flies in it; the leader has none."""
    _, kept = flown()
    for tick in kept.ticks:
        commanded = tick.phase not in ("connecting", "loitering")
        assert list(tick.active) == [commanded] * 2
        assert [bool(np.isfinite(each).all()) for each in tick.setpoints] == [commanded] * 2
        assert np.isfinite(tick.slots_m[1]).all() == (tick.phase in ("assembling", "flying"))
        assert np.isnan(tick.slots_m[0]).all()
        assert np.isnan(tick.error_of(0)).all()
        if tick.phase == "flying":
            assert np.abs(tick.error_of(1)).max() < 0.5
            assert np.abs(tick.state[0].height_m - 100.0) < 0.5


def test_each_vehicle_gets_a_heartbeat_a_second_and_one_at_once_when_the_path_begins() -> None:
    """With it comes the mission time."""
    world, kept = flown()
    parser, found = StreamParser(), list[float]()
    for at_s, raw in kept.raws:
        for frame in parser.feed(raw):
            if isinstance(frame.message, Heartbeat) and frame.system == world.station.scenario.station.ids[0]:
                found.append(at_s)
    times_s, count = np.unique(found, return_counts=True)
    assert count[1:].tolist() == [2] * (times_s.size - 1)
    (begun_s,) = world.times_s("phase", text="flying")
    hastened = times_s[times_s > begun_s][0]
    assert hastened == pytest.approx(begun_s + 0.1)
    regular = np.diff(times_s)[times_s[1:] != hastened]
    np.testing.assert_allclose(regular, 1.0, atol=1e-9)
    assert regular.size >= 10


def test_before_the_first_cycle_none_is_known_to_fail() -> None:
    known = Findings(load_scenario(KEYS), {}, 2)
    assert (known.sinking, known.beyond, known.waiting, known.silent_aloft) == (set(), set(), set(), [])
    assert (known.saturated, known.others_listen, known.crashed) == ([False] * 2, False, frozenset())
    assert math.isnan(known.max_used)
    assert math.isnan(known.longest_s)
    assert (known.losses, known.tuned) == ({}, load_scenario(KEYS))


def test_what_stages_say_is_known_after_the_flight() -> None:
    world, _ = flown()
    findings, cycle = world.station.cycle.findings, world.station.cycle
    assert (findings.doubted, findings.saturated, findings.sinking) == ([False] * 2, [False] * 2, set())
    assert (findings.beyond, findings.waiting, findings.silent_aloft) == (set(), set(), [])
    assert (findings.others_listen, findings.crashed) == (False, frozenset())
    assert 0.0 < findings.max_used < 1.0
    assert 0.0 < findings.longest_s < 2.0
    assert set(findings.losses) == set(cycle.vehicles)
    assert (cycle.hold_s, cycle.late, cycle.begins) == (0.0, False, False)
    assert cycle.restarted == []


def made(keys: dict[str, Any] | None = None, *, resumed: Any = None, send: Any = None, utc_s: float = 5.0) -> Parts:
    scenario = load_scenario(keys or KEYS, flown=True)
    return Parts(scenario, Mock(), Mock(), send or Mock(), utc_s, UNCHECKED, resumed, None)


def test_the_parts_of_a_flight_know_each_other() -> None:
    """The cycle has the scenario as the station knows it, and that as it was written."""
    scenario = load_scenario(KEYS)
    recorder, log, send = Mock(), Mock(), Mock()
    found = Parts(scenario, recorder, log, send, 7.0, UNCHECKED, None, None)
    cycle = found.cycle
    assert (cycle.as_written, cycle.scenario, found.recorder) == (scenario, found.scenario, recorder)
    assert (cycle.controller, cycle.vehicles, cycle.each) == (
        found.controller,
        found.vehicles,
        list(found.vehicles.values()),
    )
    assert list(found.vehicles) == [each.vehicle_id for each in scenario.vehicles]
    assert (cycle.phase_machine, cycle.membership, cycle.reconfiguration) == (
        found.phase_machine,
        found.membership,
        found.reconfiguration,
    )
    assert (cycle.flight, cycle.send, cycle.log_event) == (found.phase_machine.flight, send, log)
    assert (cycle.heartbeats, cycle.radio_reports) == (found.heartbeats, found.radio_reports)
    assert (cycle.utc_at_0_s, cycle.samples, cycle.restarted) == (7.0, [None, None], [])
    assert (cycle.controlled_ticks, cycle.recorded_ticks, cycle.last_tick, cycle.newest) == (0, 0, None, None)
    assert (cycle.opening, cycle.begins, cycle.late, cycle.hold_s) == (None, False, False, 0.0)
    assert type(cycle.beginning) is Beginning
    assert len(found.endpoints) == len(found.networks) == 1
    found._fail("in vain", Instant(3))
    assert found.phase_machine.flight.phase is Phase.FAILED
    assert "in vain" in [call.args[2] for call in log.call_args_list]


class Resumed(Beginning):
    """The beginning of a flight that goes on."""

    from_start = False


COPTERS = {
    "vehicles": {"count": 2, "autopilot": "arducopter"},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [500, 0, 30]]},
}
HOVERS = COPTERS | {"vehicles": {"count": 2, "model": "arducopter"}}


@pytest.mark.parametrize(
    ("keys", "resumed", "together"),
    [
        (KEYS, False, False),
        (KEYS | {"start": {"in_air": True}}, False, False),
        (COPTERS, False, True),
        (COPTERS, True, False),
        (HOVERS | {"start": {"in_air": True}}, False, False),
    ],
)
def test_vehicles_that_hover_wait_for_each_other_when_they_take_off_from_the_start(
    keys: dict[str, Any], monkeypatch: pytest.MonkeyPatch, *, resumed: bool, together: bool
) -> None:
    starting = Mock()
    monkeypatch.setattr(parts, "Starting", starting)
    monkeypatch.setattr(parts, "resumed_beginning", lambda cycle, _: Resumed(cycle.scenario, cycle.vehicles))
    found = made(keys, resumed=Mock() if resumed else None)
    assert found.scenario.hovers is (keys["path"] != KEYS["path"])
    assert starting.call_args.kwargs["together"] is together
    assert starting.call_args.args[4] is found.cycle.beginning
    assert isinstance(found.cycle.beginning, Resumed) is resumed


CORE = (
    ("own_parts", EACH_SECOND), ("strangers", EACH_SECOND), ("heartbeats", EACH_SECOND),
    ("links", ALWAYS), ("restarts", ALWAYS), ("start", ALWAYS), ("begin", ALWAYS), ("commands", ALWAYS),
    ("samples", IN_COMMAND), ("estimates", IN_COMMAND), ("members", ALWAYS),
    ("wanted", IN_COMMAND), ("delays", IN_COMMAND), ("tick", IN_COMMAND), ("leader", IN_COMMAND),
    ("law", LED), ("filters", LED), ("final", LED), ("monitors", LED), ("assembled", LED),
    ("setpoints", IN_COMMAND), ("record", IN_COMMAND), ("events", IN_COMMAND), ("phases", IN_COMMAND),
    ("look_on", NOT_IN_COMMAND), ("stand_ins", ALWAYS), ("end", ALWAYS),
)  # fmt: skip
"""The core's stages as docs/control-cycle.md lists them, and in which cycles each runs."""


@pytest.mark.parametrize("until_s", [None, 45.0])
def test_the_stages_of_every_flight_stand_in_their_order_and_a_time_to_end_at_may_be_given(
    until_s: float | None,
) -> None:
    found = made()
    stages = core_stages(found, until_s, Mock(), Mock())
    assert [(each.name, each.when) for each in stages] == list(CORE)
    (phases,) = (each for each in stages if isinstance(each, Phases))
    guidance = SimpleNamespace(guidance=SimpleNamespace(started=False))
    cycle: Any = SimpleNamespace(now=Instant(0), opening=None, phase=Phase.FLYING, controller=guidance, mission_s=1.0)
    cycle.scenario, cycle.phase_machine = found.scenario, Mock()
    phases.run(cycle)
    cycle.phase_machine.end_in_time.assert_called_once_with(math.inf if until_s is None else until_s, Instant(0))


def test_a_station_that_has_heard_none_watches_and_commands_none() -> None:
    """In a cycle once a second strangers are looked at; nothing is recorded before a take-off."""
    found, strangers, log_link = made(), Mock(), Mock()
    found.cycle.order(core_stages(found, None, strangers, log_link))
    for number in range(4):
        found.cycle.run(after(Instant(0), 0.5 * number), second=number % 2 == 0)
    assert [call.args for call in strangers.call_args_list] == [(Instant(0),), (after(Instant(0), 1.0),)]
    assert not found.recorder.tick.called  # type: ignore[attr-defined]
    assert (found.cycle.controlled_ticks, found.cycle.recorded_ticks) == (0, 0)
    assert found.phase_machine.flight.phase is Phase.CONNECTING
    assert found.cycle.now == after(Instant(0), 1.5)


def named(called: str, *behind: str) -> Stage:
    class Named(Stage):
        name, after = called, behind

        def run(self, cycle: Cycle) -> None:
            """Do nothing."""

    made_: Any = Named
    return made_()


def in_order(core: str, *brought: Stage) -> str:
    return " ".join(each.name for each in ordered([named(each) for each in core.split()], list(brought)))


def test_stages_of_features_stand_behind_those_that_they_name_each_once() -> None:
    assert in_order("a b c", named("y", "a"), named("x", "a"), named("z", "b", "x")) == "a x y b z c"
    assert in_order("a b", named("x", "a", "z"), named("z", "a")) == "a z x b"
    assert in_order("a b", named("x", "a", "gone")) == "a x b"
    assert in_order("a b") == "a b"


@pytest.mark.parametrize(
    ("brought", "found"),
    [
        ([named("x", "gone")], "found stage x after gone; allowed: a, b"),
        ([named("x")], "found stage x after ; allowed: a, b"),
        ([named("x", "a", "y"), named("y", "a", "x")], "found stages that wait for each other: x, y"),
        ([named("x", "a"), named("x", "b")], "found stages of one name among a, b, x, x"),
        ([named("b", "a")], "found stages of one name among a, b, b"),
    ],
)
def test_stages_that_cannot_be_placed_are_refused(brought: list[Stage], found: str) -> None:
    with pytest.raises(ValueError, match=found):
        in_order("a b", *brought)


def brought(monkeypatch: pytest.MonkeyPatch, **each: Feature) -> None:
    monkeypatch.setattr(feature, "features", lambda: each)


def test_a_feature_may_resume_and_end_flights(monkeypatch: pytest.MonkeyPatch) -> None:
    cycle: Any = SimpleNamespace(phase_machine=SimpleNamespace(endings=None))
    past: Any = "past"
    made_: Any = Feature
    resumes = made_("resumes", Mock(), resumes=lambda *given: ("resumed", *given))
    ends = made_("ends", Mock(), ends=lambda given: ("endings", given))
    brought(monkeypatch, a=resumes, b=ends)
    assert resumed_beginning(cycle, past) == ("resumed", cycle, past)
    take_endings(cycle)
    assert cycle.phase_machine.endings == ("endings", cycle)
    brought(monkeypatch, a=resumes, b=ends, c=resumes, d=ends)
    with pytest.raises(RunAbortedError, match="found features a, c, each of which resumes flights"):
        resumed_beginning(cycle, past)
    with pytest.raises(RunAbortedError, match="found features b, d, each of which ends flights"):
        take_endings(cycle)


def test_columns_that_features_derive_stand_behind_those_of_each_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each feature is given the events and the vehicles' names once, then the times of each block."""
    asked = list[Any]()

    def columns(events: Any, vehicles: Any) -> Any:
        asked.append((events, vehicles))
        return lambda time_s: {"doubled": np.stack((2.0 * time_s, 3.0 * time_s), axis=1)}

    brought(monkeypatch, a=Feature("derives", Mock(), columns=columns), b=Feature("derives none", Mock()))

    def blocks() -> Iterator[dict[str, Any]]:
        yield from ({"t_s": np.array([[at_s, at_s], [at_s + 1.0, at_s + 1.0]])} for at_s in (0.0, 5.0))

    events, names = [{"kind": "mode"}], ["1", "2"]
    found = list(derived(blocks(), events, names))
    assert asked == [(events, names)]
    assert [each["doubled"].tolist() for each in found] == [[[0.0, 0.0], [2.0, 3.0]], [[10.0, 15.0], [12.0, 18.0]]]
    assert all(list(each) == ["t_s", "doubled"] for each in found)


def test_every_feature_says_what_it_does() -> None:
    found = features()
    assert list(found) == sorted(found)
    assert all(each.does for each in found.values())
    assert len({each.does for each in found.values()}) == len(found)
