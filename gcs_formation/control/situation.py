"""Input and output of every formation law at a tick, one column for each vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from airlink.clock import Instant
from flight_model.arrays import Array, Mask
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.estimation.flight_state import FlightStates, Indices, Setpoints
from gcs_formation.estimation.projection import States
from gcs_formation.guidance.leader import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading


@dataclass(frozen=True)
class Lead:
    """What the guidance asks of the leader, and how the path continues there."""

    leader: int
    """Its column."""
    at: Instant
    """Of the leader's state that it was asked for."""
    commanded: list[LeaderCommand]
    """For each column, what the leader flies by when that column's setpoint acts, inside the envelope."""
    path: RouteHeading


@dataclass(frozen=True)
class Situation:
    """Input of a law."""

    states: States
    lead: Lead
    slots: SlotMotion
    """(C, 3), at rest at 0 for the leader."""
    commanded: Setpoints
    """(C,) what each vehicle follows at the instant of its own state; NaN where nothing."""
    wind_sigma_mps: Array
    """(C,) standard deviation of each component of the wind in a state."""
    active: Mask
    """(C,) columns that follow setpoints; the others' states are no more than finite."""
    bandwidth: Array
    """(C, 3) share of their bandwidth that the loops of each channel are to have now; 1: as the scenario's gains."""
    replaced: Mask
    """(C, 3) channels whose last setpoint was the separation rule's: nothing is to be learnt from their errors."""


@dataclass(frozen=True)
class Decision:
    """Output of a law: its setpoints, and the quantities they came from."""

    columns: Indices
    """(M,) the vehicles that it commands; the rows of everything else."""
    state: FlightStates
    """(M,) columns: theirs, as the law took them."""
    setpoints: Setpoints
    """NaN for a vehicle that isn't active, as all that follows may be."""
    error_m: Array
    """(M, 3) formation errors; NaN for the leader."""
    mixed: Array
    """(M, 3) mixed errors of (13); NaN where the law has none."""
    gains: Array
    """(M, 9) k_p, k_i, k_d of the three channels; NaN where the law has none."""


class Law(Protocol):
    """A formation law, with the state it keeps between ticks."""

    def decide(self, situation: Situation, dt_s: float) -> Decision:
        """Return the setpoints of this tick, which is `dt_s` after the last one."""
        ...


def none_of(rows: int, columns: int) -> Array:
    """Return (rows, columns) of NaN."""
    return np.full((rows, columns), np.nan)
