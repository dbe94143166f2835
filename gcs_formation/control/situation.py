"""Input and output of every formation law at a tick, lists with an entry for each of C columns."""

from __future__ import annotations

from abc import ABC, abstractmethod

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from flight_model.autopilot_model import FlightState
from flight_model.slot import Slot, Triple
from gcs_formation.control.follower import LawParameters
from gcs_formation.control.fuzzy_pid import Gains
from gcs_formation.control.setpoint import Replaced
from gcs_formation.estimation.projection import States
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_guidance import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading


class Lead:
    """What the guidance asks of the leader, and how the path continues there."""

    def __init__(self, leader: int, at: Instant, commanded: list[LeaderCommand], path: RouteHeading) -> None:
        """Take what is asked for.

        Args:
            leader: its column.
            at: the instant of the leader's state that it was asked for.
            commanded: for each column, what the leader flies by when that column's setpoint acts, in the envelope.
            path: how it continues.
        """
        self.leader = leader
        self.at = at
        self.commanded = commanded
        self.path = path


class Situation:
    """Input of a law."""

    def __init__(
        self,
        states: States,
        lead: Lead,
        slots: list[Slot],
        history: SetpointHistory,
        wind_variance: list[float],
        active: list[bool],
        bandwidth: list[list[float]],
        replaced: list[Replaced],
    ) -> None:
        """Take what is known at a tick.

        Args:
            states: of all vehicles.
            lead: what the leader does.
            slots: at rest at 0 for the leader.
            history: the setpoints that they were sent.
            wind_variance: of each component of the wind in a state, (m/s)².
            active: columns that follow setpoints; the others' states are no more than finite.
            bandwidth: share of their bandwidth that the loops of each channel are to have now; 1: as the scenario's
                gains.
            replaced: channels whose last setpoint was the separation rule's: nothing is to be learnt from their errors.
        """
        self.states = states
        self.lead = lead
        self.slots = slots
        self.history = history
        self.wind_variance = wind_variance
        self.active = active
        self.bandwidth = bandwidth
        self.replaced = replaced

    def commanded(self, column: int) -> Triple:
        """Return what a vehicle follows at the instant of its own state; NaN where nothing."""
        return self.history.commanded(self.states.instant(column) - 1, column)


@mypyc_attr(acyclic=True)
class Decided:
    """What a law has decided for one vehicle, and the quantities that it came from."""

    def __init__(
        self, column: int, state: FlightState, setpoint: Triple, error_m: Triple, mixed: Triple, gains: Gains
    ) -> None:
        """Take the decision; of no meaning for a vehicle that isn't active.

        Args:
            column: the vehicle's.
            state: as the law took it.
            setpoint: speed, heading and height.
            error_m: formation error; NaN for the leader.
            mixed: mixed errors of (13); NaN where the law has none.
            gains: NaN where the law has none.
        """
        self.column = column
        self.state = state
        self.setpoint = setpoint
        self.error_m = error_m
        self.mixed = mixed
        self.gains = gains


class Law(ABC):
    """A formation law, with the state it keeps between ticks."""

    @abstractmethod
    def decide(self, situation: Situation, dt_s: float) -> list[Decided]:
        """Return what the vehicles that it commands are told at this tick, which is `dt_s` after the last one."""

    @abstractmethod
    def retune(self, parameters: LawParameters) -> None:
        """Go on with other gains; a law without those of `LawParameters` keeps its own."""
