"""Measures when control ticks were due, when they began, and how long they took."""

from __future__ import annotations

import time

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import Endpoint
from airlink.engine import Datagram
from gcs_formation.record.outcome import ControlFigures
from gcs_formation.station import Station


class TimedStation:
    """Wraps a station and times its control ticks; itself an engine."""

    def __init__(self, station: Station) -> None:
        """Time the ticks of `station`."""
        self._station = station
        self._due: list[int] = []
        self._begun: list[int] = []
        self._taken: list[float] = []

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the station's endpoints."""
        return self._station.endpoints()

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Hand on a datagram."""
        self._station.receive(datagram, now)

    def datagrams_to_send(self) -> list[Datagram]:
        """Return what the station sends."""
        return self._station.datagrams_to_send()

    def next_timer(self) -> Instant | None:
        """Return the station's timer."""
        return self._station.next_timer()

    def handle_timer(self, now: Instant) -> None:
        """Pass on the timer; record it if it was a tick that commanded the formation."""
        due, ticks = self._station.next_timer(), self._station.controlled_ticks
        began = time.perf_counter()
        self._station.handle_timer(now)
        if due is not None and self._station.controlled_ticks > ticks:
            self._taken.append(time.perf_counter() - began)
            self._due.append(due)
            self._begun.append(now)

    def figures(self, rate_hz: float) -> ControlFigures:
        """Return the times of all ticks."""
        return ControlFigures(
            rate_hz,
            np.array(self._due, dtype=np.float64) / NANOSECONDS,
            np.array(self._begun, dtype=np.float64) / NANOSECONDS,
            np.array(self._taken),
        )
