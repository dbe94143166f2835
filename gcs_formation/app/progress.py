"""Which events a user is shown during a flight, and in which words."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import TextIO

import numpy as np

from airlink.cli import counted
from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from gcs_formation.app import result_text
from gcs_formation.app.waiting import waits_for
from gcs_formation.link.link_health import LinkState
from gcs_formation.mission.gate import IN_ORDER
from gcs_formation.phases import Phase
from gcs_formation.recorder import Event
from gcs_formation.station import Station

QUIET = ("mode", "statustext", "ready")
"""Kinds that every start has many of; they are in events.jsonl only."""
PASSING = {"link": ("stale",), "parameters": (IN_ORDER,)}
USUAL = {"link": ("connected",), "member": ("flying in formation", "starting")}
"""Texts that are shown only after another text of the same kind: a link is back, a vehicle rejoined the formation."""


def words(event: Event) -> str:
    """Return an event in words: `vehicle 3, link: lost`; a phase by its name and cause."""
    if event.kind == "phase":
        return f"{event.text}: {event.details['cause']}" if "cause" in event.details else event.text
    kind = event.kind.replace("_", " ")
    return f"{kind}: {event.text}" if event.vehicle is None else f"vehicle {event.vehicle}, {kind}: {event.text}"


class Progress:
    """Prints a line for each phase and each important event. A stream that isn't a terminal gets no status line."""

    def __init__(self, stream: TextIO | None = None) -> None:
        """Write to `stream`; without one print nothing."""
        self._stream = stream
        self._unusual = set[tuple[str, VehicleId | None]]()

    def show(self, station: Station) -> None:
        """Show the station's status, where there is a status line; called a few times a second."""

    def remind(self, station: Station, now: Instant) -> None:
        """Say what is waited for before the path begins; called where nothing may have been said for long."""
        words = waits_for(station)
        if words:
            self.say(f"start + {now / NANOSECONDS:6.1f} s  {station.flight.phase.value}: {words}")

    def show_event(self, event: Event, mission_s: float) -> None:
        """Print an event if it is important; `mission_s` is NaN before the path has begun."""
        if self._has_weight(event):
            begun = not math.isnan(mission_s)
            since = f"t     = {mission_s:6.1f} s" if begun else f"start + {event.now / NANOSECONDS:6.1f} s"
            self.say(f"{since}  {words(event)}")

    def say(self, line: str) -> None:
        """Write a line."""
        if self._stream is not None:
            with suppress(OSError, ValueError):  # the reader is gone while the vehicles still fly
                self._stream.write(f"{line}\n")
                self._stream.flush()

    def close(self) -> None:
        """Show nothing more."""

    def _has_weight(self, event: Event) -> bool:
        if event.kind in QUIET or event.text in PASSING.get(event.kind, ()):
            return False
        about = event.kind, event.vehicle
        if event.text not in USUAL.get(event.kind, ()):
            self._unusual.add(about)
            return True
        was_unusual = about in self._unusual
        self._unusual.discard(about)
        return was_unusual


class StatusLine(Progress):
    """A status line at the bottom of a terminal, rewritten in place; important events are printed above it."""

    def __init__(self, stream: TextIO) -> None:
        from rich.console import Console  # noqa: PLC0415 - rich takes 5 % of a short flight to import
        from rich.live import Live  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        super().__init__()
        self._text = partial(Text, no_wrap=True, overflow="crop")
        self._console = Console(file=stream, highlight=False)
        self._live = Live(console=self._console, transient=True, auto_refresh=False)
        self._live.start()

    def show(self, station: Station) -> None:
        """Show time, worst error, delay and links, as far as they fit."""
        with suppress(OSError):  # the terminal was closed while the vehicles still fly
            # A line as wide as the terminal would move the cursor to the next one.
            text = result_text.line(progress_parts(station), self._console.width - 1)
            self._live.update(self._text(text), refresh=True)

    def remind(self, station: Station, now: Instant) -> None:
        """Say nothing: the status line does."""

    def say(self, line: str) -> None:
        """Write a line above the status line."""
        with suppress(OSError):
            for part in result_text.wrapped(line, self._console.width - 1):
                self._console.print(self._text(part))

    def close(self) -> None:
        """Remove the status line."""
        with suppress(OSError):
            self._live.stop()


def progress_on(stream: TextIO | None) -> Progress:
    """Return what shows progress on a stream; None is a stream that was closed from the start."""
    if stream is not None and stream.isatty() and os.environ.get("TERM") != "dumb":
        return StatusLine(stream)
    return Progress(stream)


def progress_parts(station: Station) -> Sequence[tuple[str, ...]]:
    """Return the parts of the status line, most important first, each in wordings from long to short."""
    return _where(station), _worst_error(station), _links(station), _delay(station)


def _where(station: Station) -> tuple[str, ...]:
    tick, phase = station.last_tick, station.flight.phase
    if tick is None:
        doing = sorted({v.start_up.doing for v in station.vehicles.values() if not v.start_up.finished})
        return (f"{phase.value}: {', '.join(doing)}", phase.value) if doing else (phase.value,)
    if phase is Phase.FLYING:
        return (f"t {tick.mission_time_s:.0f} of {station.scenario.duration_s:.0f} s", f"t {tick.mission_time_s:.0f} s")
    since, waits = f"{phase.value}, {tick.now / NANOSECONDS:.0f} s after the start", waits_for(station)
    return (f"{since}: {waits}", since, phase.value) if waits else (since, phase.value)


def _worst_error(station: Station) -> tuple[str, ...]:
    tick = station.last_tick
    errors_m = np.array(() if tick is None else tick.error_m)
    if np.isnan(errors_m).all():
        return ("",)
    worst = np.nanmax(np.abs(errors_m), axis=0)
    each = f"{worst[0]:.2f} / {worst[1]:.2f} / {worst[2]:.2f} m"
    return f"worst error {each}", f"error {each}", f"error {worst.max():.2f} m"


def _delay(station: Station) -> tuple[str, ...]:
    delays = [v.clock.one_way_s for v in station.vehicles.values() if not math.isnan(v.clock.one_way_s)]
    if not delays:
        return ("",)
    longest = f"delay {max(delays) * 1e3:.0f} ms"
    used = station.cycle.findings.max_used
    return (longest,) if math.isnan(used) else (f"{longest}, {used:.0%} of margin", longest)


def _links(station: Station) -> tuple[str, ...]:
    states = [vehicle.connection.state for vehicle in station.vehicles.values()]
    named = [f"{states.count(state)} {state.value}" for state in LinkState if state in states]
    well = states.count(LinkState.CONNECTED)
    return ", ".join(named), f"{well} of {counted(len(states), 'link')}"
