"""A progress line, shown on terminals only."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from airlink.clock import NANOSECONDS
from gcs_formation.link.connection import LinkState
from gcs_formation.phases import Phase
from gcs_formation.station import Station


class Silent:
    """Shows nothing."""

    def show(self, station: Station) -> None:
        """Show nothing."""


class ProgressLine:
    """One line at the bottom of a terminal, rewritten."""

    def __init__(self, console: Console) -> None:
        """Write to `console`."""
        self._live = Live(console=console, transient=True, auto_refresh=False)
        self._live.start()

    def show(self, station: Station) -> None:
        """Show time, worst error and links."""
        with suppress(OSError):  # the terminal was closed while the vehicles still fly
            self._live.update(Text(progress_text(station), no_wrap=True, overflow="ellipsis"), refresh=True)

    def close(self) -> None:
        """Remove the line."""
        with suppress(OSError):
            self._live.stop()


def progress_text(station: Station) -> str:
    """Return the progress in words: phase and time, worst formation error, delay, state of the links."""
    parts = [_where(station), _worst_error(station), _delay(station), _links(station)]
    return "  ".join(part for part in parts if part)


def _where(station: Station) -> str:
    tick = station.last_tick
    phase = station.flight.phase
    if tick is None:
        doing = sorted({v.start_up.doing for v in station.vehicles.values() if not v.start_up.finished})
        return f"{phase.value}: {', '.join(doing)}" if doing else phase.value
    if phase is Phase.FLYING:
        return f"t {tick.mission_time_s:.0f} of {station.scenario.duration_s:.0f} s"
    return f"{phase.value} {tick.now / NANOSECONDS:.0f} s"


def _worst_error(station: Station) -> str:
    tick = station.last_tick
    if tick is None or np.isnan(tick.error_m[1:]).all():
        return ""
    worst = np.nanmax(np.abs(tick.error_m[1:]), axis=0)
    return f"worst error {worst[0]:.2f} / {worst[1]:.2f} / {worst[2]:.2f} m"


def _delay(station: Station) -> str:
    delays = [v.clock.one_way_s for v in station.vehicles.values() if not math.isnan(v.clock.one_way_s)]
    used = station.margins.most_used
    return f"delay {max(delays) * 1e3:.0f} ms, {used:.0%} of its margin" if delays else ""


def _links(station: Station) -> str:
    states = [vehicle.connection.state for vehicle in station.vehicles.values()]
    named = [f"{states.count(state)} {state.value}" for state in LinkState if state in states]
    return f"links: {', '.join(named)}"
