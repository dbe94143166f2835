"""A flight whose vehicles are all down before its end is over at once; silence alone doesn't tell that they are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import gcs_formation
from gcs_formation.phases import Phase
from tests.flights.conftest import STRAIGHT, scenario
from tests.flights.in_memory import World

COPTERS: dict[str, Any] = {
    "vehicles": {"count": 3, "autopilot": "arducopter"},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 20], [1000, 0, 20]]},
    "duration_s": 100,
}
CRASH: dict[str, Any] = {"at_s": 5, "vehicles": "all", "kind": "crash"}


def aborted(tmp_path: Path, **keys: Any) -> tuple[str, dict[str, Any], float]:
    """Return why a flight by `run` failed, its summary, and the mission time at which it was over."""
    with pytest.raises(gcs_formation.RunAbortedError) as raised:
        gcs_formation.run(scenario(path=STRAIGHT, **keys), clock="virtual", out=tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    last = json.loads((tmp_path / "run" / "events.jsonl").read_text().splitlines()[-1])
    return str(raised.value), summary, last["t_s"] - summary["begun_s"]


def test_run_knows_that_silent_vehicles_have_crashed(tmp_path: Path):
    words, summary, over_s = aborted(tmp_path, duration_s=100, faults=[CRASH])
    assert words == "all vehicles are down before the flight is over (silent on the ground: 1, 2, 3)"
    assert summary["failure"] == words
    assert over_s < CRASH["at_s"] + 10.0
    assert not (tmp_path / "run" / "truth.bin").exists()


def test_a_crash_just_before_the_end_is_no_success(tmp_path: Path):
    words, _, _ = aborted(tmp_path, duration_s=7, faults=[CRASH])
    assert words.startswith("all vehicles were down before the flight was over: from 5.")


@pytest.mark.slow
def test_one_that_flies_flies_on(tmp_path: Path):
    crashes = [{**CRASH, "vehicles": [1, 3]}]
    found = gcs_formation.run(scenario(duration_s=25, faults=crashes), clock="virtual", out=tmp_path / "run")
    assert found.figures["duration_s"] == pytest.approx(25.0, abs=0.2)
    assert found.figures["failure"] is None


def test_silence_alone_is_waited_for():
    """The station by itself, as in `fly`, can't know that they have crashed."""
    flown = World(duration_s=60)
    flown.fly_to(2.0)
    for number in (1, 2, 3):
        flown.inject(number, "crash")
    flown.fly_to(40.0)
    assert (flown.station.flight.phase, flown.station.phase_machine.failure) == (Phase.FLYING, None)


def test_vehicles_that_their_pilots_land_end_the_flight():
    flown = World(**COPTERS)
    flown.fly_to(2.0)
    for number in (1, 2, 3):
        flown.inject(number, "pilot", mode="RTL")
    flown.network.run(lambda: not any(flown.vehicle(each).pilot.airborne for each in (1, 2, 3)))
    landed_s = flown.now_s
    flown.run()
    assert flown.now_s < landed_s + 10.0
    assert flown.station.flight.phase is Phase.FAILED
    assert flown.station.phase_machine.failure == "all vehicles are down before the flight is over (disarmed: 1, 2, 3)"
