"""Input and output of every formation law at a tick; lists have an entry for each of C vehicles."""

from __future__ import annotations

from abc import ABC, abstractmethod

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from flight_model.flight_state import FlightState
from flight_model.slot import Slot, Vector3
from gcs_formation.control.follower_loops import LawParameters
from gcs_formation.control.fuzzy_pid import Gains
from gcs_formation.control.setpoint import Replaced
from gcs_formation.estimation.projection import States
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_commands import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading


class Lead:
    """The guidance's commands to the leader, and how the path continues."""

    def __init__(self, leader: int, at: Instant, commanded: list[LeaderCommand], path: RouteHeading) -> None:
        """Take the guidance's output.

        Args:
            leader: its index.
            at: instant of the leader's state that the guidance used.
            commanded: for each vehicle, the command that the leader follows when that vehicle's setpoint acts, within
                the envelope.
            path: how it continues.
        """
        self.leader = leader
        self.at = at
        self.commanded = commanded
        self.path = path


class CycleInput:
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
            lead: the leader's commands.
            slots: at rest at 0 for the leader.
            history: setpoints sent to the vehicles.
            wind_variance: of each component of the wind in a state, (m/s)².
            active: vehicles that follow setpoints; the others' states are finite but otherwise meaningless.
            bandwidth: share of the full bandwidth for each channel's loop now; 1: the scenario's gains.
            replaced: channels whose last setpoint was the separation rule's: their errors aren't integrated.
        """
        self.states = states
        self.lead = lead
        self.slots = slots
        self.history = history
        self.wind_variance = wind_variance
        self.active = active
        self.bandwidth = bandwidth
        self.replaced = replaced

    def commanded(self, index: int) -> Vector3:
        """Return the setpoint that a vehicle follows at the instant of its own state; NaN before the first."""
        return self.history.commanded(self.states.instant(index) - 1, index)


@mypyc_attr(acyclic=True)
class LawOutput:
    """A law's decision for one vehicle, and the quantities behind it."""

    def __init__(
        self, index: int, state: FlightState, setpoint: Vector3, error_m: Vector3, mixed: Vector3, gains: Gains
    ) -> None:
        """Take the decision; it has no meaning for an inactive vehicle.

        Args:
            index: the vehicle's.
            state: the one that the law used.
            setpoint: speed, heading and height.
            error_m: formation error; NaN for the leader.
            mixed: mixed errors of (13); NaN where the law has none.
            gains: NaN where the law has none.
        """
        self.index = index
        self.state = state
        self.setpoint = setpoint
        self.error_m = error_m
        self.mixed = mixed
        self.gains = gains


class Law(ABC):
    """A formation law, with its state between ticks."""

    @abstractmethod
    def decide(self, cycle_input: CycleInput, dt_s: float) -> list[LawOutput]:
        """Return the decisions for the vehicles that it commands at this tick, which is `dt_s` after the last one."""

    @abstractmethod
    def retune(self, parameters: LawParameters) -> None:
        """Use other gains from now on; a law that has none of `LawParameters` keeps its own."""
