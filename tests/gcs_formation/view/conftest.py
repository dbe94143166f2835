"""One short flight, recorded: as it was while it flew, as a kill would have left it, and finished."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

import gcs_formation
from gcs_formation.view.recording import State
from gcs_formation.view.run import RunRecording
from tests.flights.conftest import scenario


@dataclass(frozen=True)
class Flown:
    """Where the records are, and what was seen of the flight while it flew."""

    finished: Path
    killed: Path
    state_in_flight: State
    ticks_in_flight: int


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """Fly three vehicles for a few seconds."""
    place = tmp_path_factory.mktemp("viewed")
    keys = scenario(name="<script>alert(1)</script>", duration_s=6, vehicles={"count": 3}, start={"in_air": True})
    with gcs_formation.Flight(keys, out=place / "run") as flight:
        recording = None
        for tick in flight:
            if tick.mission_time_s > 3.0 and recording is None:
                flight._flying.session.recorder.flush()
                recording = RunRecording(place / "run")
                shutil.copytree(place / "run", place / "killed")
    assert recording is not None
    return Flown(place / "run", place / "killed", recording.state, recording.times.time_s.size)
