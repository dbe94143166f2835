"""Links' changes are translated once for vehicles that share them, and each file of recorded delays is read once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from formation_scenario import ScenarioError, links_of_vehicles, load_scenario
from formation_scenario.scripted import ScriptedLink
from formation_scenario.traces.keys import Trace
from formation_scenario.traces.reading import read_trace
from formation_scenario.traces.recorded import RecordedDelays
from gcs_formation.app.check import check_report
from gcs_formation.app.link_injection import LinkSchedule
from gcs_formation.phases import Flight

PATH: dict[str, Any] = {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]}
CHANGES, VEHICLES = 30, 6


def keys(*changes: dict[str, Any]) -> dict[str, Any]:
    return {"vehicles": {"count": VEHICLES}, "path": PATH, "links": {"changes": list(changes)}}


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Return the files of recorded delays that were read."""
    found = list[Path]()

    def counted(trace: Trace) -> RecordedDelays:
        found.append(Path(trace.file))
        return read_trace(trace)

    monkeypatch.setattr(links_of_vehicles, "read_trace", counted)
    return found


def begun() -> Flight:
    """Return a flight whose path began at instant 0."""
    flight = Flight()
    flight.resume(Instant(0), Instant(0))
    return flight


def at_s(seconds: float) -> Instant:
    return after(Instant(0), seconds)


def test_recorded_delays_are_read_once_however_many_changes_of_how_many_vehicles_name_them(
    tmp_path: Path, reads: list[Path]
) -> None:
    one, other = tmp_path / "one.txt", tmp_path / "other.txt"
    one.write_text("40\n60\n")
    other.write_text("100\n")
    files = [str(one), str(other)] * (CHANGES // 2)
    scenario = load_scenario(keys(*({"at_s": i, "trace_file": file} for i, file in enumerate(files, 1))))
    check_report(scenario)
    schedule = LinkSchedule(scenario, begun())
    assert sorted(reads) == [one, other]
    vehicle = scenario.vehicles[2].vehicle_id
    for mission_s, delay_s in ((1.5, 0.05), (CHANGES + 1.0, 0.1)):
        for way in schedule.both_directions(vehicle, at_s(mission_s)):
            assert way.process is not None
            assert way.process(100, at_s(mission_s)) == pytest.approx(delay_s)


def test_a_file_that_is_no_record_of_delays_is_read_once_and_refused_at_every_place(
    tmp_path: Path, reads: list[Path]
) -> None:
    broken = tmp_path / "broken.txt"
    broken.write_text("40\nmany\n")
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys(*({"at_s": i, "trace_file": str(broken)} for i in (1, 2, 3))))
    assert [problem.key for problem in refused.value.problems] == [f"links.changes.{i}.trace_file" for i in range(3)]
    assert reads == [broken]


def test_vehicles_with_the_same_links_share_one_translation_also_once_a_program_has_changed_them() -> None:
    changes: list[dict[str, Any]] = [
        *({"at_s": i, "delay_ms": i} for i in range(1, CHANGES)),
        {"at_s": 90, "vehicles": [3], "loss": 0.5},
    ]
    scenario = load_scenario(keys(*changes))
    schedule = LinkSchedule(scenario, begun())
    one, two, three, *_ = (each.vehicle_id for each in scenario.vehicles)

    def delays_s(vehicle: VehicleId) -> list[float]:
        return [way.delay_s for way in schedule.both_directions(vehicle, at_s(20.5))]

    def shared(vehicle: VehicleId = two) -> bool:
        return schedule.both_directions(one, at_s(20.5))[0] is schedule.both_directions(vehicle, at_s(20.5))[0]

    assert shared()
    assert not shared(three)
    assert delays_s(one) == delays_s(three) == [0.02, 0.02]
    assert schedule.change(ScriptedLink(delay_ms=70))
    assert shared()
    assert delays_s(one) == delays_s(three) == [0.07, 0.07]
    assert schedule.both_directions(three, at_s(90.5))[0].loss == 0.5
    assert not schedule.change(ScriptedLink(vehicles=(1,), delay_ms=70))
    assert schedule.change(ScriptedLink(vehicles=(1,), delay_ms=80))
    assert not shared()
    assert (delays_s(one), delays_s(two)) == ([0.08, 0.08], [0.07, 0.07])
