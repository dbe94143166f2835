"""The parts of a station that every flight has, each made with those that it needs."""

from __future__ import annotations

from collections.abc import Callable

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.signing.signed_links import SignedLinks, receiver_of
from formation_scenario import Scenario
from gcs_formation.controller.controller import FormationController
from gcs_formation.core.cycle import Cycle, Send
from gcs_formation.core.feature import resumed_beginning
from gcs_formation.fleet.dispatch import Dispatch
from gcs_formation.fleet.flood_watch import FloodWatch
from gcs_formation.fleet.heartbeats import HeartbeatScheduler
from gcs_formation.fleet.membership import Membership
from gcs_formation.fleet.senders import Senders
from gcs_formation.fleet.several_links import SeveralLinks
from gcs_formation.fleet.signature_watch import SignatureWatch
from gcs_formation.from_scenario import as_known, narrow_links, planned
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.mission.gate import Gate, PreFlightOptions
from gcs_formation.mission.orders import Orders
from gcs_formation.mission.past_flight import PastFlight
from gcs_formation.mission.phase_machine import FlightPhaseMachine
from gcs_formation.mission.reconfiguration import Reconfiguration
from gcs_formation.mission.starting import Starting
from gcs_formation.recorder import LogEvent, Recorder
from gcs_formation.vehicle.vehicle import Vehicle


class Parts:
    """What stages of the core and the station work with."""

    def __init__(
        self,
        scenario: Scenario,
        recorder: Recorder,
        log_event: LogEvent,
        send: Send,
        utc_at_0_s: float | None,
        caution: PreFlightOptions,
        resumed: PastFlight | None,
        signing: SignedLinks | None,
    ) -> None:
        """Make the parts; see `Station`. `log_event` records events, `send` sends messages.

        Raises:
            RunAbortedError: an extension can't begin, or the flight can't be resumed.
        """
        stated, narrow, scenario = scenario, narrow_links(scenario), as_known(scenario)
        self.scenario, self.recorder, self.receiver = scenario, recorder, receiver_of(signing)
        self.controller = FormationController(scenario)
        self.endpoints, self.networks, self.vehicles = planned(scenario)
        fleet: tuple[dict[VehicleId, Vehicle], LogEvent] = (self.vehicles, log_event)
        self.membership, self.dispatch = Membership(scenario, *fleet), Dispatch(scenario, self.vehicles)
        self.gate = Gate(scenario, self.vehicles, caution, log_event, self._fail)
        self.phase_machine = FlightPhaseMachine(
            scenario, self.controller, self.membership, self.dispatch, *fleet, self.gate
        )
        self.reconfiguration = Reconfiguration(scenario, self.controller, *fleet)
        self.cycle = Cycle(
            scenario,
            self.controller,
            self.vehicles,
            self.phase_machine,
            self.reconfiguration,
            log_event,
            send,
            utc_at_0_s,
        )
        flight, fail = self.phase_machine.flight, self.phase_machine.fail
        self.several_links = SeveralLinks(*fleet)
        ids, try_port = scenario.station.ids, self.several_links.try_port
        self.senders = Senders(self.vehicles, self.networks, flight, log_event, fail, ids, try_port)
        self.flood = FloodWatch(log_event)
        self.signatures = SignatureWatch(signing, self.receiver, self.networks, *fleet)
        connections = [link.connection for each in self.vehicles.values() for link in each.each_link]
        self.radio_reports = RadioReports(connections, self.signatures.is_open)
        if resumed is not None:
            self.cycle.beginning = resumed_beginning(self.cycle, resumed)
        begins = self.cycle.beginning
        self.starting = Starting(
            self.vehicles,
            self.endpoints,
            flight,
            self.gate,
            begins,
            log_event,
            fail,
            together=scenario.hovers and not scenario.start.in_air and begins.from_start,
        )
        self.orders = Orders(scenario, self.phase_machine, self.reconfiguration, log_event)
        self.heartbeats = HeartbeatScheduler(*fleet, narrow, self.radio_reports, 1.0 / scenario.law.rate_hz)
        self.cycle.as_written, self.cycle.heartbeats = stated, self.heartbeats
        self.cycle.radio_reports = self.radio_reports

    def resume(self, resumed: PastFlight) -> None:
        """Go on with an interrupted flight."""
        self.phase_machine.flight.resume(resumed.at, resumed.path_began)
        self.phase_machine.gate.let_go_on()
        self.heartbeats.resume(resumed.at)
        self.reconfiguration.resume(resumed)
        self.orders.resume(resumed.mission_s)

    def _fail(self, text: str, now: Instant) -> None:
        """End the run: the `GiveUp` of parts created before `phase_machine`."""
        self.phase_machine.fail(text, now)


LogLink = Callable[[Vehicle, Instant], None]
"""Records the state of a vehicle's link."""
