"""Runs a fleet over UDP under the real clock."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from airlink.cli.status import Status
from airlink.clock import NANOSECONDS, RealClock
from airlink.udp import UdpDriver
from sim_vehicles.config import FleetConfig
from sim_vehicles.fleet import Fleet
from sim_vehicles.truth import TruthWriter


@dataclass(frozen=True)
class RunnerOptions:
    """How a fleet is run."""

    speedup: float = 1.0
    until_s: float | None = None
    clock_origin_ns: int | None = None
    """Instant 0 on the machine's monotonic clock, to share instants with another process."""
    truth: Path | None = None
    truth_rate_hz: float = 25.0
    parent_pid: int | None = None
    """The process that started us: we end when it does."""


def run(config: FleetConfig, options: RunnerOptions, started: Callable[[Fleet], None]) -> int:
    """Fly until told to stop; return the exit status. `started` is called once the sockets are open.

    Raises:
        PortError: a vehicle's own port can't be opened.
    """
    clock = RealClock(options.speedup, options.clock_origin_ns)
    recording = TruthWriter(options.truth, len(config.vehicles), options.truth_rate_hz) if options.truth else None
    with recording or nullcontext():
        begun = clock.now()
        utc_ns = time.time_ns() - (time.monotonic_ns() - clock.origin_ns)
        fleet = Fleet(replace(config, utc_at_0_us=utc_ns // 1000), begun, recording)
        stop = _Stop()

        def over() -> bool:
            late = options.until_s is not None and clock.now() - begun > options.until_s * NANOSECONDS
            return stop.signal is not None or late or options.parent_pid not in (None, os.getppid())

        with UdpDriver(fleet, clock) as driver:
            started(fleet)
            driver.run(over)
    return Status.INTERRUPTED if stop.signal == signal.SIGINT else Status.FINE


class _Stop:
    """The signal that asked us to end."""

    def __init__(self) -> None:
        self.signal: int | None = None
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.signal = number
