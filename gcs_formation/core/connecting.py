"""Stages that find the vehicles, start them, and begin to command the formation."""

from __future__ import annotations

from collections.abc import Callable

from airlink.clock import Instant
from airlink.messages import Message
from formation_scenario import Scenario
from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.fleet.several_links import SeveralLinks
from gcs_formation.mission.resumption import WAIT_S, Takeover
from gcs_formation.mission.starting import PreFlight, Starting
from gcs_formation.phases import Cause, Phase
from gcs_formation.vehicle.vehicle import Vehicle


class Links(Stage):
    """Judges each link by what was heard, before a vehicle is judged by its messages."""

    name = "links"

    def __init__(self, note_link: Callable[[Vehicle, Instant], None], several: SeveralLinks) -> None:
        """Take what records the state of a link, and what chooses between several of a vehicle."""
        self._note_link, self._several = note_link, several

    def run(self, cycle: Cycle) -> None:
        """Check each, and record what has changed."""
        now = cycle.now
        self._several.watch(now)
        for vehicle in cycle.each:
            link = vehicle.connection
            if not link.in_order(now) and link.check(now, vehicle.sequence.loss):
                self._note_link(vehicle, now)


class Restarts(Stage):
    """Forgets what was known of a vehicle that has restarted, before it is started again."""

    name = "restarts"

    def __init__(self, cycle: Cycle) -> None:
        """Begin with vehicles that haven't restarted."""
        self._handled = [0] * len(cycle.each)
        """How many restarts of each vehicle have been handled."""

    def run(self, cycle: Cycle) -> None:
        """Look at each vehicle."""
        cycle.restarted.clear()
        for place, vehicle in enumerate(cycle.each):
            if vehicle.restarts > self._handled[place]:
                self._handled[place] = vehicle.restarts
                cycle.controller.estimator.forget(vehicle.column)
                cycle.restarted.append(vehicle.column)
                cycle.note(cycle.now, "restarted", "its clock has begun again", vehicle)


class Start(Stage):
    """Checks vehicles before the first command, and carries on their start-up, which waits for these checks."""

    name = "start"

    def __init__(self, preflight: PreFlight, starting: Starting, takeover: Takeover) -> None:
        """Take both, and what decides on vehicles of a flight that is resumed."""
        self._preflight, self._starting, self._takeover = preflight, starting, takeover

    def run(self, cycle: Cycle) -> None:
        """Do what is due of both."""
        now = cycle.now
        cycle.send(self._preflight.requests(now) + self._takeover.failsafes.requests(now), now)
        self._preflight.watch()
        vehicles = self._preflight.limits.take_news()
        if vehicles is not None:
            cycle.reconfiguration.plan_with(vehicles)
        self._starting.advance(now)
        if self._preflight.rehearsed:
            cycle.course.end_rehearsal(now)


class Begin(Stage):
    """Begins to command the formation if its leader follows setpoints; a flight resumed while ending is ended."""

    name = "begin"

    def __init__(self, scenario: Scenario, preflight: PreFlight, starting: Starting, takeover: Takeover) -> None:
        """Take what tells whether the leader is ready, and which vehicles a resumed flight takes over."""
        self._scenario, self._preflight, self._starting, self._takeover = scenario, preflight, starting, takeover

    def run(self, cycle: Cycle) -> None:
        """Begin if it is time; decide by the phase whether this cycle commands the formation."""
        if cycle.flight.phase is Phase.CONNECTING:
            self._begin(cycle, cycle.now)
        cycle.decide()

    def _begin(self, cycle: Cycle, now: Instant) -> None:
        takeover, resumed, course = self._takeover, self._takeover.resumed, cycle.course
        leads, reason = self._has_leader(cycle, now) and self._preflight.passed, takeover.failure(now)
        if reason is not None:
            course.fail(reason, now, begun=takeover.took_any)
        elif takeover.is_over(now):
            course.move(Cause.CALLED_OFF, now)
        elif resumed is not None and resumed.ending:
            if takeover.settled(now) and (leads or takeover.waited(now, 2.0 * WAIT_S)):
                if leads:
                    course.move(Cause.LEADER_READY, now)
                course.stop(now)
        elif leads and course.move(Cause.LEADER_READY, now):
            cycle.begins = True

    def _has_leader(self, cycle: Cycle, now: Instant) -> bool:
        """Return whether the leader follows setpoints; in a resumed flight, let another vehicle lead if needed."""
        resumed = self._takeover.resumed
        if resumed is None or not resumed.near:
            return self._starting.leader_ready(self._scenario.leader)
        leader = self._takeover.leader(now)
        if leader is not None:
            cycle.reconfiguration.lead(leader, now)
        return leader is not None


class Commands(Stage):
    """Sends commands that are due, those that stages before it have just given among them."""

    name = "commands"

    def run(self, cycle: Cycle) -> None:
        """Send one for each vehicle that has one."""
        commands = list[tuple[Vehicle, Message]]()
        for vehicle in cycle.each:
            command = vehicle.commands.due(cycle.now)
            if command is not None:
                commands.append((vehicle, command))
        cycle.send(commands, cycle.now)
