"""The control cycle: what its stages share, and what a stage is."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Sequence
from typing import ClassVar, Final

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.messages import Message
from flight_model.slot import CHANNELS
from formation_scenario import Scenario
from gcs_formation.controller.controller import FormationController
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.sample import Sample
from gcs_formation.fleet.frame_loss import FrameLoss
from gcs_formation.fleet.heartbeats import HeartbeatScheduler
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.mission.beginning import Beginning
from gcs_formation.mission.ending import Ending
from gcs_formation.mission.phase_machine import FlightPhaseMachine
from gcs_formation.mission.reconfiguration import Reconfiguration
from gcs_formation.phases import COMMANDED, Flight, Phase
from gcs_formation.recorder import LogEvent, Tick, VehicleLink
from gcs_formation.vehicle.vehicle import Vehicle

Send = Callable[[list[tuple[Vehicle, Message]], Instant], None]
"""Sends messages to vehicles."""

ALWAYS: Final = 0
EACH_SECOND: Final = 1
IN_COMMAND: Final = 2
NOT_IN_COMMAND: Final = 3
LED: Final = 4
"""In which cycles a stage runs: in all, in one a second (with the heartbeats), in those that command the formation, in
the others, and in those that command it and in which there is a leader to follow."""
WHENS: Final = 5


class Findings:
    """What one stage says to others of a flight, as long as none says otherwise."""

    max_used = math.nan
    """Largest share of a delay margin that a loop used so far; NaN as long as no share is known."""
    longest_s = math.nan
    """Longest loop delay so far, s."""

    def __init__(self, scenario: Scenario, vehicles: dict[VehicleId, Vehicle], count: int) -> None:
        """Begin without any; `count` is the number of vehicles, C, with a virtual leader."""
        self.doubted = [False] * count
        """(C,) whose setpoints are refused, unacknowledged or apparently not followed."""
        self.saturated = [False] * count
        """(C,) which fly as fast as they can, and are commanded to be faster."""
        self.sinking = set[VehicleId]()
        """Vehicles that lose height although commanded to climb."""
        self.losses = {identity: FrameLoss(vehicle) for identity, vehicle in vehicles.items()}
        """What is known of each vehicle's lost frames."""
        self.beyond = set[VehicleId]()
        """Vehicles that are to be held because a loop is unstable by its delay."""
        self.waiting = set[VehicleId]()
        """Vehicles that wait for the formation to be commanded, and circle until then."""
        self.margin_used = [math.nan] * count
        """(C,) share of the delay margin that the loops use; NaN while unknown."""
        self.bandwidth = [[1.0] * len(CHANNELS) for _ in range(count)]
        """(C, 3) share of the full bandwidth that the law's loops should have."""
        self.time_constants_off = [[0.0] * count for _ in CHANNELS]
        """(3, C) relative differences of the time constants of airspeed, heading and height from the models'."""
        self.tuned = scenario
        """The scenario with the gains in force."""
        self.silent_aloft = list[VehicleId]()
        """Silent vehicles that were last received in the air, if all others are down."""
        self.others_listen = False
        """Whether a second ground station receives the vehicles, and may read what this one doesn't."""
        self.crashed = frozenset[VehicleId]()
        """Which of these are known to lie on the ground."""

    def lie(self, crashed: Collection[VehicleId]) -> None:
        """Take which of the silent vehicles lie on the ground."""
        self.crashed = frozenset(crashed)


class Cycle:
    """One control cycle, from the newest telemetry to setpoints: each stage reads and writes it, in their order.

    Made once for a flight. Indices are those of the controller; what one stage says to another is here.
    """

    as_written: Scenario
    """The scenario as it was written, with what it says of radios."""
    heartbeats: HeartbeatScheduler
    """Schedules heartbeats and TIMESYNC requests."""
    radio_reports: RadioReports
    """What radios report of themselves."""
    now: Instant
    """The instant of the cycle."""
    mission_s: float
    """Seconds since the leader passed the start of its path; NaN before."""
    phase: Phase
    """Phase of the run in which the formation is commanded."""
    opening: Ending | None = None
    """The ending of the flight, if it had begun before this cycle and the formation is still commanded."""
    links: list[VehicleLink]
    """(C,) the measured links."""
    measured: MeasuredStates
    """The newest states, in cycles with a leader to follow."""
    tick: Tick
    """Setpoints and what they come from; the record of the cycle."""
    last_tick: Tick | None = None
    """The last one that commanded the formation."""
    newest: Tick | None = None
    """The last one that was recorded, commanded or not."""
    begins = False
    """Whether the formation begins to be commanded in this cycle."""
    late = False
    """Whether the path begins even if followers aren't in their slots."""
    hold_s = 0.0
    """For how long the leader's setpoints are held back, s."""

    def __init__(
        self,
        scenario: Scenario,
        controller: FormationController,
        vehicles: dict[VehicleId, Vehicle],
        phase_machine: FlightPhaseMachine,
        reconfiguration: Reconfiguration,
        log_event: LogEvent,
        send: Send,
        utc_at_0_s: float | None,
    ) -> None:
        """Begin a flight.

        Args:
            scenario: as far as the station knows it.
            controller: what computes setpoints; it has the models, the filters of the states and the setpoints sent.
            vehicles: the vehicles, the leader first.
            phase_machine: the phases of the run, and how it is ended.
            reconfiguration: changes of the formation; who leads.
            log_event: records events.
            send: sends messages.
            utc_at_0_s: UTC at instant 0, s since 1970, if the machine's clock is set to it.
        """
        self.scenario, self.controller, self.vehicles = scenario, controller, vehicles
        self.each = list(vehicles.values())
        self.phase_machine, self.membership, self.reconfiguration = (
            phase_machine,
            phase_machine.membership,
            reconfiguration,
        )
        self.log_event, self.send = log_event, send
        self.flight: Flight = phase_machine.flight
        self.utc_at_0_s = utc_at_0_s
        self.beginning = Beginning(scenario, vehicles)
        """How the formation begins to be commanded; another where the flight is resumed."""
        self.controlled_ticks = self.recorded_ticks = 0
        """Cycles in which the formation was commanded; all that were recorded since the first take-off."""
        count = controller.count
        self.samples: list[Sample | None] = [None] * count
        """(C,) what vehicles reported since the last cycle."""
        self.restarted = list[int]()
        """Indices of vehicles that have just restarted: what was known of them is forgotten."""
        self.findings = Findings(scenario, vehicles, count)
        self._holds = [False] * WHENS
        self._stages, self._whens = list[Stage](), list[int]()

    def order(self, stages: Sequence[Stage]) -> None:
        """Take the stages, in the order in which they run."""
        self._stages = list(stages)
        self._whens = [each.when for each in stages]

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages, in the order in which they run."""
        return tuple(self._stages)

    def stage(self, name: str) -> Stage:
        """Return the stage of a name.

        Raises:
            KeyError: there is none.
        """
        for each in self._stages:
            if each.name == name:
                return each
        raise KeyError(f"found '{name}'; allowed: {', '.join(each.name for each in self._stages)}")

    def run(self, now: Instant, *, second: bool) -> None:
        """Run the stages of a cycle at `now`; `second`: those of once a second, too."""
        self.now, self.begins, stages, whens = now, False, self._stages, self._whens
        holds = self._holds
        holds[ALWAYS], holds[EACH_SECOND] = True, second
        holds[IN_COMMAND] = holds[NOT_IN_COMMAND] = holds[LED] = False
        for index in range(len(stages)):
            if holds[whens[index]]:
                stages[index].run(self)

    def decide(self) -> None:
        """Decide, by the phase, whether this cycle commands the formation."""
        commands = self.flight.phase in COMMANDED
        self._holds[IN_COMMAND], self._holds[NOT_IN_COMMAND] = commands, not commands

    def follow_leader(self, *, led: bool) -> None:
        """Take whether there is a leader to follow in this cycle."""
        self._holds[LED] = led


@mypyc_attr(allow_interpreted_subclasses=True)
class Stage(ABC):
    """One step of the control cycle. Its docstring says what it needs, and why it stands where it does."""

    name: ClassVar[str]
    """Its name, by which others refer to it."""
    when: ClassVar[int] = ALWAYS
    """In which cycles it runs."""
    after: ClassVar[tuple[str, ...]] = ()
    """Names of stages that run before it, one of the core's among them: it runs before the next one of the core. For a
    stage of the core their order says that."""

    @abstractmethod
    def run(self, cycle: Cycle) -> None:
        """Do its step of the cycle."""
