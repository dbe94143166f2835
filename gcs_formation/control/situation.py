"""Input and output of every formation law at a tick, lists with an entry for each of C columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from airlink.clock import Instant
from flight_model.autopilot import FlightState
from flight_model.slot import Slot, Triple
from gcs_formation.control.follower import LawParameters
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
    slots: list[Slot]
    """At rest at 0 for the leader."""
    commanded: list[Triple]
    """What each vehicle follows at the instant of its own state; NaN where nothing."""
    wind_variance: list[float]
    """Of each component of the wind in a state, (m/s)²."""
    active: list[bool]
    """Columns that follow setpoints; the others' states are no more than finite."""
    bandwidth: list[list[float]]
    """Share of their bandwidth that the loops of each channel are to have now; 1: as the scenario's gains."""
    replaced: list[list[bool]]
    """Channels whose last setpoint was the separation rule's: nothing is to be learnt from their errors."""


@dataclass(frozen=True)
class Decided:
    """What a law has decided for one vehicle, and the quantities that it came from."""

    column: int
    state: FlightState
    """As the law took it."""
    setpoint: Triple
    """Of no meaning for a vehicle that isn't active, as all that follows."""
    error_m: Triple
    """Formation error; NaN for the leader."""
    mixed: Triple
    """Mixed errors of (13); NaN where the law has none."""
    gains: tuple[float, ...]
    """k_p of the three channels, k_i, k_d; NaN where the law has none."""


class Law(Protocol):
    """A formation law, with the state it keeps between ticks."""

    def decide(self, situation: Situation, dt_s: float) -> list[Decided]:
        """Return what the vehicles that it commands are told at this tick, which is `dt_s` after the last one."""
        ...

    def retune(self, parameters: LawParameters) -> None:
        """Go on with other gains; a law without those of `LawParameters` keeps its own."""
        ...
