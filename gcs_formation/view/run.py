"""A recording from a run's directory: of a flight under way, a finished one, or one whose station was killed."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from airlink.host_system import is_locked
from flight_model.arrays import Indices
from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.registry import Files, load_extensions
from gcs_formation.errors import RecordError
from gcs_formation.phases import OVER, Phase
from gcs_formation.record.run_directory import EVENTS, SCENARIO, SPOOL, SUMMARY, TIMESERIES, TLOG, recorded_in
from gcs_formation.record.timeseries import PHASES, spools
from gcs_formation.view.log import name_of_mode
from gcs_formation.view.recording import COLUMN, COLUMNS, RADIO, SEEN, STATE, Rows, State, Times
from gcs_formation.view.scene import scene
from gcs_formation.view.seen_in_frames import FrameReader, of
from gcs_formation.view.tick_rows import SeriesTicks, SpoolTicks

STEP_S = 1.0
"""Step of what frames tell."""
LOG_BYTES = 2**20
"""Of the log, read at a poll."""
SILENT_S = 2.0
"""A station that writes nothing for so long, wall time, is silent: stopped, or its machine is."""
CONCLUDES_S = 120.0
"""How long after its end a station may take to write the summary, wall time."""
MAX_EVENTS = 100_000
FRESH_S = 5.0
"""Where the law knows no state yet, a vehicle is where it said within this time."""
SEEN_COLUMNS = [COLUMN[name] for name in SEEN]
RADIO_COLUMNS = [COLUMN[name] for name in RADIO]
CONNECTING = float(PHASES.index(Phase.CONNECTING.value))
NONE = Times(np.empty(0), np.empty(0), np.empty(0))


class RunRecording:
    """What a run's directory holds, as far as it has been written."""

    phases = PHASES

    def __init__(self, path: Path, plugins: Files = ()) -> None:
        """Read the scenario and what has been recorded.

        Raises:
            RecordError: it isn't the directory of a run, or a file in it can't be read.
        """
        self._path, self._directory = path, recorded_in(path)
        if not (self._directory / SCENARIO).is_file():
            raise RecordError(f"found no {SCENARIO} in {path}; allowed: the directory of a run, or a log (*.tlog)")
        try:
            self._scenario: Scenario = load_scenario(
                self._directory / SCENARIO, flown=True, plugins=load_extensions(plugins)
            )
        except (OSError, ScenarioError) as error:
            raise RecordError(f"cannot read {self._directory / SCENARIO}: {error}") from error
        self._order = [each.vehicle_id for each in self._scenario.vehicles]
        self._systems = [each.system for each in self._order]
        self._scene = scene(self._scenario)
        self.state: State = "concluding"
        self.generation = 0
        self._events, self._events_at = list[dict[str, Any]](), 0
        self._parts: list[SpoolTicks | SeriesTicks] = []
        self._log_at, self._log_done = 0, False
        self._frames = FrameReader(
            STEP_S, name_of_mode, self._scenario.origin.geodetic, _by_radio(self._scenario), copies=True
        )
        self._seen_s, self._seen = np.empty(0), np.empty((0, len(self._order), len(COLUMNS)), dtype=np.float32)
        self._early = 0
        """How many points of what frames tell come before the first tick: until then vehicles are where they say."""
        self._grew_s, self._locked = 0.0, True
        self._times = NONE
        self.poll(0.0)

    @property
    def vehicles(self) -> Sequence[str]:
        """The scenario's vehicles."""
        return [str(each) for each in self._order]

    @property
    def directory(self) -> Path:
        """Where orders to the flight are given."""
        return self._path

    @property
    def times(self) -> Times:
        """When the ticks were."""
        return self._times

    @property
    def events(self) -> Sequence[Mapping[str, Any]]:
        """The lines of events.jsonl."""
        return self._events

    def scene(self) -> Mapping[str, Any]:
        """Return what the scenario says."""
        return self._scene

    def poll(self, wall_s: float) -> None:
        """Read what is new; `wall_s`: a clock that only goes on."""
        self._directory = recorded_in(self._path)
        try:
            grew = self._read_events() | self._read_ticks() | self._read_log()
        except (OSError, ValueError) as error:
            raise RecordError(f"cannot read the run in {self._directory}: {error}") from error
        self._grew_s = wall_s if grew else self._grew_s
        self.state = self._state(wall_s)

    def rows(self, ticks: Indices) -> Rows:
        """Return the rows of some ticks, which are in order."""
        rows = np.empty((ticks.size, len(self._order), len(COLUMNS)), dtype=np.float32)
        early = ticks < self._early
        rows[early] = self._seen[ticks[early]]
        begin = self._early
        for part in self._parts:
            own = (ticks >= begin) & (ticks < begin + part.times.time_s.size)
            rows[own] = part.rows(ticks[own] - begin)
            begin += part.times.time_s.size
        later = ~early
        if self._seen_s.size:
            last = np.maximum(np.searchsorted(self._seen_s, self._times.time_s[ticks[later]], side="right") - 1, 0)
            tail = rows[later]
            seen = self._seen[last]
            tail[:, :, SEEN_COLUMNS] = seen[:, :, SEEN_COLUMNS]
            recorded = tail[:, :, RADIO_COLUMNS]
            tail[:, :, RADIO_COLUMNS] = np.where(np.isnan(recorded), seen[:, :, RADIO_COLUMNS], recorded)
            unknown = np.isnan(tail[:, :, 0]) & (seen[:, :, COLUMN["age_s"]] < FRESH_S)
            tail[unknown, : len(STATE)] = seen[unknown, : len(STATE)]
            rows[later] = tail
        return rows

    def _state(self, wall_s: float) -> State:
        if (self._directory / SUMMARY).is_file():
            return "ended"
        if is_locked(self._directory / EVENTS):
            return "silent" if wall_s - self._grew_s > SILENT_S else "live"
        phases = [event.get("text") for event in self._events if event.get("kind") == "phase"]
        over = bool(phases) and phases[-1] in {phase.value for phase in OVER}
        return "concluding" if over and wall_s - self._grew_s < CONCLUDES_S else "killed"

    def _read_events(self) -> bool:
        data, self._events_at = _appended(self._directory / EVENTS, self._events_at, whole_lines=True)
        for line in data.splitlines():
            try:
                event: Any = json.loads(line)
            except ValueError:
                continue
            if isinstance(event, dict) and len(self._events) < MAX_EVENTS:
                self._events.append(event)
        return bool(data)

    def _read_ticks(self) -> bool:
        series, frame = self._directory / TIMESERIES, self._scenario.formation.frame
        finished = series.is_file() and (self._directory / SUMMARY).is_file()
        if finished and not any(isinstance(part, SeriesTicks) for part in self._parts):
            self._parts = [SeriesTicks(series, self._order, frame)]
            self.generation += 1
            self._index()
            return True
        if finished:
            return False
        paths = spools(self._directory / SPOOL)
        for path in paths[len(self._parts) :]:
            if _has_line(path):
                self._parts.append(SpoolTicks(path, self._order, frame))
        grew = sum(part.poll(path) for part, path in zip(self._parts, paths, strict=False)) > 0
        if grew:
            self._index()
        return grew

    def _read_log(self) -> bool:
        """Read on in the log; what it says of a finished flight is shown when all of it is read."""
        data, self._log_at = _appended(self._directory / TLOG, self._log_at, max_bytes=LOG_BYTES)
        if data:
            self._begin_log()
            self._frames.feed(data)
            times_s, systems, rows = self._frames.read_new()
            self._seen_s = np.concatenate([self._seen_s, times_s])
            self._seen = np.concatenate([self._seen, of(rows, systems, self._systems)])
            self._index()
        elif self._parts and not self._log_done and self._log_at:
            self._log_done = True
            self.generation += 1
        return bool(data)

    def _begin_log(self) -> None:
        epochs = (event["epoch_us"] for event in self._events if isinstance(event.get("epoch_us"), int))
        if self._frames.begun:
            return
        epoch_us = next(epochs, None)
        if epoch_us is not None:
            self._frames.begins_at(epoch_us)

    def _index(self) -> None:
        """Put the times together: of what frames tell until the first tick, and of ticks."""
        parts = [part.times for part in self._parts if part.times.time_s.size]
        first_s = float(parts[0].time_s[0]) if parts else np.inf
        early = int(np.searchsorted(self._seen_s, first_s))
        if parts and early < self._early:
            self.generation += 1
        self._early = early
        seen_s = self._seen_s[:early]
        before = Times(seen_s, np.full(early, np.nan), np.full(early, CONNECTING))
        self._times = Times(*(np.concatenate(each) for each in zip(before, *parts, strict=True)))


def _by_radio(scenario: Scenario) -> Collection[int] | None:
    """Return of whom a radio's report in the log is: none is known of several radios until the flight is over."""
    radios = scenario.channel_members()
    if len(radios) == 1:
        return {vehicle.vehicle_id.system for vehicle in radios[0][1]}
    shared = not radios and len({vehicle.endpoint for vehicle in scenario.vehicles}) == 1
    return None if shared else ()


def _has_line(path: Path) -> bool:
    with path.open("rb") as file:
        return file.readline().endswith(b"\n")


def _appended(path: Path, begin: int, max_bytes: int = -1, *, whole_lines: bool = False) -> tuple[bytes, int]:
    """Return what a file has from a byte on, and the byte after that."""
    try:
        with path.open("rb") as file:
            file.seek(begin)
            data = file.read(max_bytes)
    except FileNotFoundError:
        return b"", begin
    if whole_lines:
        data = data[: data.rfind(b"\n") + 1]
    return data, begin + len(data)
