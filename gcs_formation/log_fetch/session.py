"""Fetches the logs of a run's vehicles into its directory, on sockets and the real clock."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, Final

from airlink.clock import MICROSECONDS, RealClock
from airlink.driver import Driver
from airlink.endpoint import PortError
from airlink.messages.command import LogEntry
from formation_scenario import Scenario
from gcs_formation.app.signing import flight_signing
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.from_scenario import planned
from gcs_formation.log_fetch.fetch import LogFetch, Wanted
from gcs_formation.log_fetch.log_times import last_s
from gcs_formation.record.run_directory import RECORDING
from gcs_formation.record.unfinished import from_ports, recorded_events

FOLDER: Final = "logs"
FIGURES: Final = "logs.json"
PART: Final = ".part"


class LogFiles:
    """The files of the logs: what is there of one that was interrupted is kept, and gone on with."""

    def __init__(self, directory: Path) -> None:
        """Keep them in a run's directory."""
        self.folder = directory / FOLDER
        self._open = dict[str, Path]()

    def kept(self, name: str, entry: LogEntry, suffix: str) -> int:
        """Return how many bytes of a vehicle's log are there; those that follow are added to these."""
        self.folder.mkdir(exist_ok=True)
        path = self.path(name, entry, suffix)
        part = path.with_name(path.name + PART)
        if path.is_file() and path.stat().st_size >= entry.size:
            return path.stat().st_size
        if path.is_file():
            path.replace(part)  # the vehicle has written more to it since
        self._open[name] = part
        return part.stat().st_size if part.is_file() else 0

    def path(self, name: str, entry: LogEntry, suffix: str) -> Path:
        """Return the file of a vehicle's log."""
        return self.folder / f"vehicle-{name.replace(':', '-')}-{entry.id:08d}{suffix}"

    def add(self, name: str, chunks: list[bytes]) -> None:
        """Add what has come."""
        if chunks and name in self._open:
            with self._open[name].open("ab") as file:
                file.write(b"".join(chunks))

    def finish(self, name: str) -> None:
        """Give a complete file its name."""
        part = self._open.pop(name, None)
        if part is not None and part.is_file():
            part.replace(part.with_name(part.name.removesuffix(PART)))


def fetch_logs(
    directory: Path,
    scenario: Scenario,
    number: int | None,
    only: Collection[str],
    ended: Callable[[Mapping[str, Wanted]], bool],
) -> list[dict[str, Any]]:
    """Fetch a log of each vehicle; return of each the file, its size, and its clock beside the flight's.

    Args:
        directory: the run's.
        scenario: what was flown.
        number: the log's number, None for each vehicle's newest.
        only: the vehicles' ids in words, empty for all.
        ended: asked after each event whether to end before all are fetched.

    Raises:
        RunAbortedError: a port is taken.
        RecordError: the run's events or a file can't be read or written.
    """
    clock, files = RealClock(), LogFiles(directory)
    endpoints, _, vehicles = planned(scenario)
    chosen = {str(identity): each for identity, each in vehicles.items() if not only or str(identity) in only}
    addresses = {name: (each.connection.socket, each.identity.system) for name, each in chosen.items()}
    suffixes = {name: ".ulg" if each.autopilot.family.startswith("PX4") else ".bin" for name, each in chosen.items()}
    fetch = LogFetch(
        endpoints,
        addresses,
        scenario.station.ids,
        number,
        flight_signing(scenario, clock).links,
        lambda name, entry: files.kept(name, entry, suffixes[name]),
    )

    def attend() -> bool:
        for name, each in fetch.wanted.items():
            if each.transfer is not None:
                files.add(name, each.transfer.chunks())
        return fetch.over or ended(fetch.wanted)

    try:
        with Driver(fetch, clock, from_ports(directory)) as driver:
            driver.run(attend)
        epoch_us = _epoch_us(directory)
        found = [_figures(files, suffixes, name, each, clock, epoch_us) for name, each in fetch.wanted.items()]
        _write(files.folder, found)
    except PortError as error:
        raise RunAbortedError(str(error)) from error
    except OSError as error:
        raise RecordError(f"cannot write to {files.folder}: {error.strerror or error}") from error
    return found


def _epoch_us(directory: Path) -> int | None:
    """Return when the run's clock began, microseconds since 1970; None where it didn't go by real time."""
    events = recorded_events(directory)[0]
    begins = next((event for event in events if event.get("kind") == RECORDING and "epoch_us" in event), None)
    hurried = any("speedup" in event for event in events if event.get("kind") == RECORDING)
    return None if begins is None or hurried else int(begins["epoch_us"])


def _figures(
    files: LogFiles, suffixes: Mapping[str, str], name: str, each: Wanted, clock: RealClock, epoch_us: int | None
) -> dict[str, Any]:
    """Return what is reported of a vehicle's log."""
    transfer = each.transfer
    found: dict[str, Any] = {"vehicle": name}
    if transfer is None or transfer.entry is None or not transfer.over or transfer.failure:
        why = each.failure or ("interrupted" if transfer is None or not transfer.failure else transfer.failure)
        return found | {"failure": why, "bytes": 0 if transfer is None else transfer.received}
    files.finish(name)
    path = files.path(name, transfer.entry, suffixes[name])
    booted_s, now_s = each.booted_s, clock.now() * 1e-9
    found |= {"file": f"{FOLDER}/{path.name}", "number": transfer.entry.id, "bytes": transfer.received}
    if booted_s is None or epoch_us is None:
        return found | {"offset_s": None, "why": "the vehicle or the run tells no clock to compare"}
    written_s = last_s(path.read_bytes())
    if written_s is not None and written_s > now_s - booted_s:
        return found | {"offset_s": None, "why": "the vehicle has restarted since the log was written"}
    offset_s = booted_s + (clock.utc_at_0_us - epoch_us) / MICROSECONDS
    return found | {"offset_s": round(offset_s, 6), "within_s": round(min(each.trips)[0] / 2.0, 6)}


def _write(folder: Path, found: list[dict[str, Any]]) -> None:
    """Write what is known of all; those of other vehicles stay as they are."""
    path = folder / FIGURES
    folder.mkdir(exist_ok=True)
    before = json.loads(path.read_text("utf-8")) if path.is_file() else []
    named = {each["vehicle"]: each for each in [*before, *found]}
    path.write_text(json.dumps(list(named.values()), indent=1) + "\n", encoding="utf-8")
