"""A run's directory: files written during the flight, and files written at the end."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO, cast

from airlink.cli.output_directory import RUN, refusal
from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from airlink.host_system import lock
from formation_scenario import Scenario, dump_scenario
from formation_scenario.registry import RECORD as EXTENSIONS
from formation_scenario.used_extensions import used_extensions
from gcs_formation.errors import RecordError
from gcs_formation.phases import NONE_COMMANDED
from gcs_formation.record.json_shape import INTEGER, NUMBER, TEXT, Maybe, Shape
from gcs_formation.record.timeseries import SpoolWriter, spools
from gcs_formation.record.tlog import TlogWriter
from gcs_formation.recorder import Event, Tick

SCENARIO = RUN
TLOG = "flight.tlog"
EVENTS = "events.jsonl"
SPOOL = "timeseries.ticks"
TRUTH = "truth.bin"
TIMESERIES = "timeseries.parquet"
SUMMARY = "summary.json"
REPORT = "report.html"
FIGURES = "figures"
"""Written by `report`."""
UNFLOWN = "unflown"
"""Subdirectory for a run into an earlier run's directory; it replaces the earlier one when it commands a vehicle."""
FLUSH_S = 1.0
EVENT_SCHEMA = 1
EVENT_SHAPE: Mapping[str, Shape] = {"t_s": NUMBER, "kind": TEXT, "text": TEXT}
RECORDING = "recording"
"""Kind of a record's first event, which says when instant 0 was."""
GOES_ON = "goes on"
"""Text of the event of that kind with which a resumed flight begins."""
PORT = "port"
"""Kind of the event that says to which of our ports a vehicle answers."""
EVENT_DETAILS: Mapping[str, Mapping[str, Shape | Maybe]] = {
    "design": {"design_delay_s": NUMBER},
    PORT: {"endpoint": TEXT, "port": INTEGER},
    RECORDING: {"speedup": Maybe(NUMBER)},
}
"""Further keys of some kinds of events, as far as they are read back."""


class RunDirectory:
    """Records a flight (a `Recorder`); flushed every second, which limits the loss by a crash."""

    _tick_listener: Callable[[Tick], None] | None = None

    def __init__(
        self,
        path: Path,
        scenario: Scenario | None,
        columns: Sequence[VehicleId | None],
        epoch_us: int,
        *,
        overwrite: bool = False,
        frames: bool = True,
        resume: bool = False,
        flush_s: float = FLUSH_S,
    ) -> None:
        """Create the directory and its files; `overwrite` allows an earlier run there, `frames` False omits the log.

        Without a `scenario` there is no run.yaml: for a record that isn't kept.

        An earlier run's record is kept until `replace_earlier`. One that ended before it commanded any vehicle is
        replaced at once, without `overwrite`, so that the run can be repeated after its cause is corrected. With
        `resume` an unfinished run's record is continued after its last complete entries. Files are flushed every
        `flush_s`.

        Raises:
            RecordError: it holds other files or an earlier run, it can't be written, or another run is recording there.
        """
        self.path = path
        """Where the record is at present."""
        self._earlier: TextIO | None = None
        """The locked events file of an earlier run that is still there, so that no other run can use the directory."""
        try:
            if not resume:
                self._keep_earlier(overwrite=overwrite)
            self.path.mkdir(parents=True, exist_ok=True)
            self._events = _own(self.path / EVENTS, whole_lines=resume)
            if recorded_in(self.path) != self.path:
                shutil.rmtree(self.path / UNFLOWN)
            if not resume:
                _begin(self.path, scenario)
            self._tlog = TlogWriter(self.path / TLOG, epoch_us) if frames else None
            self._spool = SpoolWriter(self.path / SPOOL, columns)
        except BlockingIOError as error:
            found = f"found another run that is recording into {path}; allowed: a directory of its own"
            raise RecordError(found) from error
        except OSError as error:
            raise RecordError(
                f"cannot write the run directory {path}: {error.strerror}; allowed: a directory that can be written"
            ) from error
        self._listener: Callable[[Event], None] | None = None
        self._files = [file for file in (self._tlog, self._spool) if file is not None]
        self.failure: str | None = None
        """Why recording has stopped, usually because the disk is full."""
        self._next_flush, self._flush_ns = Instant(0), round(flush_s * NANOSECONDS)
        if not resume:
            self.event(Event(Instant(0), RECORDING, "begins", None, {"epoch_us": epoch_us}))

    def tell_events_to(self, listener: Callable[[Event], None]) -> None:
        """Call a function with every event from now on."""
        self._listener = listener

    def tell_ticks_to(self, listener: Callable[[Tick], None]) -> None:
        """Call a function with every tick from now on."""
        self._tick_listener = listener

    def _keep_earlier(self, *, overwrite: bool) -> None:
        """If there is an earlier run that commanded vehicles, record into a subdirectory of it."""
        unflown = _commanded_none(self.path)
        refused = refusal(self.path, overwrite=overwrite or unflown)
        if refused is not None:
            raise RecordError(refused)
        if (self.path / SCENARIO).is_file() and not unflown:
            self._earlier = _locked(self.path / EVENTS)
            self.path /= UNFLOWN

    @property
    def is_in_subdirectory(self) -> bool:
        """Whether an earlier run's record is still in place."""
        return self._earlier is not None

    def replace_earlier(self) -> None:
        """Replace the earlier run's record, because this run has begun."""
        if self._earlier is None:
            return
        subdirectory, directory = self.path, self.path.parent
        try:
            _clear(directory)
            for file in subdirectory.iterdir():
                file.replace(directory / file.name)
            subdirectory.rmdir()
        except OSError as error:
            self._give_up(error)
        self._earlier.close()
        self.path, self._earlier = directory, None

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        """Record frames."""
        if self._tlog is None or self.failure is not None:
            return
        self._tlog.write(now, raws)
        if now >= self._next_flush:
            self._flush_in_time(now)

    def tick(self, tick: Tick) -> None:
        """Record a control tick."""
        if self._tick_listener is not None:
            self._tick_listener(tick)
        if self.failure is not None:
            return
        try:
            self._spool.add(tick)
        except OSError as error:
            self._give_up(error)
        if tick.now >= self._next_flush:
            self._flush_in_time(tick.now)

    def event(self, event: Event) -> None:
        """Record an event as a line of JSON; this is still tried after other files have failed."""
        if self._listener is not None:
            self._listener(event)
        try:
            self._events.write(json.dumps(event_line(event), ensure_ascii=False) + "\n")
            self._events.flush()
        except OSError as error:
            self._give_up(error)

    def flush(self) -> None:
        """Flush all files to the operating system."""
        for file in self._files:
            file.flush()

    def _flush_in_time(self, now: Instant) -> None:
        self._next_flush = Instant(now + self._flush_ns)
        try:
            self.flush()
        except OSError as error:
            self._give_up(error)

    def close(self) -> None:
        """Close the files, which end with what could be written. An earlier run's record that is there is kept."""
        if self._earlier is not None:
            self._earlier.close()
        for file in (*self._files, self._events):
            try:
                file.close()
            except OSError as error:
                self._give_up(error)

    def record_scenario(self, scenario: Scenario) -> None:
        """Replace run.yaml: a program has added to what was flown."""
        part = self.path / f"{SCENARIO}.part"
        try:
            part.write_text(dump_scenario(scenario), encoding="utf-8")
            part.replace(self.path / SCENARIO)
        except OSError as error:
            self._give_up(error)

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write summary.json atomically: its existence means that the record is complete."""
        text = json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False)
        part = self.path / f"{SUMMARY}.part"
        part.write_text(text + "\n", encoding="utf-8")
        part.replace(self.path / SUMMARY)

    def _give_up(self, error: OSError) -> None:
        self.failure = self.failure or f"cannot go on recording in {self.path}: {error.strerror or error}"


def recorded_in(path: Path) -> Path:
    """Return where the last run into a directory is recorded: in `UNFLOWN` if it didn't replace an earlier one."""
    return path / UNFLOWN if (path / UNFLOWN / SCENARIO).is_file() else path


def _commanded_none(path: Path) -> bool:
    """Return whether the run recorded there ended before it commanded any vehicle."""
    if not (path / EVENTS).is_file():
        return False
    try:
        events = [json.loads(line) for line in (path / EVENTS).read_bytes().splitlines()]
        causes = [event["cause"] for event in events if event["kind"] == "phase"]
    except (ValueError, KeyError, TypeError):
        return False  # truncated, or another program's
    return len(causes) == 1 and causes[0] in [cause.value for cause in NONE_COMMANDED]


def _clear(path: Path) -> None:
    """Remove the files of an earlier run."""
    left = (SUMMARY, TIMESERIES, TRUTH, REPORT, TLOG, EXTENSIONS)
    for stale in (*(path / name for name in left), *spools(path / SPOOL), *figures(path)):
        stale.unlink(missing_ok=True)


def figures(path: Path) -> list[Path]:
    """Return the figures that `report` has written of a run, in every format."""
    return [each for kind in ("png", "svg", "pdf") for each in (path / FIGURES).glob(f"*.{kind}")]


def _begin(path: Path, scenario: Scenario | None) -> None:
    """Remove an earlier run's files, and write what is flown."""
    _clear(path)
    if scenario is not None:
        _write_scenario(path, scenario)


def _write_scenario(path: Path, scenario: Scenario) -> None:
    """Write run.yaml, and which extensions it uses, if it uses any."""
    (path / SCENARIO).write_text(dump_scenario(scenario), encoding="utf-8")
    if used_extensions(scenario):
        found = json.dumps([each.to_dict() for each in used_extensions(scenario)], indent=2)
        (path / EXTENSIONS).write_text(found + "\n", encoding="utf-8")


def _own(path: Path, *, whole_lines: bool) -> TextIO:
    """Return a file opened for appending, locked while open: emptied, or cut after its last line with `whole_lines`.

    Raises:
        BlockingIOError: another process has it locked.
    """
    file = _locked(path)
    file.truncate(path.read_bytes().rfind(b"\n") + 1 if whole_lines else 0)
    return file


def _locked(path: Path) -> TextIO:
    file = path.open("a", encoding="utf-8")
    lock(file)
    return file


def event_shape(found: object) -> Shape:
    """Return the shape of a line of events."""
    kind = cast("dict[str, Any]", found).get("kind") if isinstance(found, dict) else None
    return {**EVENT_SHAPE, **EVENT_DETAILS.get(kind if isinstance(kind, str) else "", {})}


def event_line(event: Event) -> dict[str, Any]:
    """Return an event as docs/events.schema.json describes it."""
    line: dict[str, Any] = {
        "schema": EVENT_SCHEMA,
        "t_s": event.now / NANOSECONDS,
        "kind": event.kind,
        "text": event.text,
    }
    if event.vehicle is not None:
        line["vehicle"] = str(event.vehicle)
    details = {k: v if not isinstance(v, float) or math.isfinite(v) else None for k, v in event.details.items()}
    return line | details
