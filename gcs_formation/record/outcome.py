"""Everything about a run that its summary is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from airlink.frame import ParserCounts
from airlink.identity import VehicleId
from formation_scenario import Scenario
from gcs_formation.arrays import Array
from gcs_formation.record import figures_of_merit as figures
from gcs_formation.record.flight import Flight

LATE_S = 0.010
"""A tick that begins later than this after it was due is late."""


class Injected(NamedTuple):
    """What was injected into a vehicle's link."""

    up_s: float
    """Realised mean delay of the uplink."""
    down_s: float
    loss: float
    """Share of the downlink's datagrams lost."""


@dataclass(frozen=True)
class LinkFigures:
    """Counts and delays (s) of one vehicle's link."""

    delays_s: Array
    """(P, 3) of each answered probe: one way, half the round trip; up and down, NaN where the split isn't known."""
    delay_times_s: Array
    """Mission times of the probes, NaN before the path began."""
    measured_loss: float
    frames_in: int
    frames_out: int
    frames_bad: int
    frames_implausible: int = 0
    injected: Injected | None = None
    """None where nothing is known of the link, as in `fly` behind something else."""


@dataclass(frozen=True)
class ControlFigures:
    """When ticks were due and when they began, in s of the run's clock; how long they took, in s of real time."""

    rate_hz: float
    due_s: Array
    begun_s: Array
    compute_s: Array

    def to_dict(self) -> dict[str, Any]:
        """Return the `control` part of the summary."""
        period_ms = np.diff(self.begun_s) * 1e3
        return {
            "rate_hz": self.rate_hz,
            "ticks": int(self.begun_s.size),
            "late_ticks": int((self.begun_s - self.due_s > LATE_S).sum()),
            "period_ms": figures.percentiles(period_ms, 50, 99)
            | {"max": float(period_ms.max()) if period_ms.size else None},
            "compute_ms": figures.percentiles(self.compute_s * 1e3, 50, 99),
        }


@dataclass(frozen=True)
class Outcome:
    """All that a summary is made from."""

    scenario: Scenario
    clock: str
    flight: Flight
    links: Mapping[VehicleId, LinkFigures]
    control: ControlFigures
    delay_margin_s: float | None
    worst_loop_delay_s: float | None
    margin_used: float
    """Largest share of the delay margin that a loop used."""
    received: ParserCounts
    """What has come from everybody, vehicles and others."""
    frames_refused: int
    """Of the sound frames, those that weren't taken for any of the vehicles'."""
    simulated_s: float
    wall_s: float
    cut_short: bool
    """Whether the run was ended (`--until`, an order, Ctrl-C) before the path or the time was."""
