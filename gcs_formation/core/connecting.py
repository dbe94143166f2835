"""Stages that find the vehicles, start them, and begin to command the formation."""

from __future__ import annotations

from collections.abc import Callable

from airlink.clock import Instant
from airlink.messages import Message
from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.fleet.several_links import SeveralLinks
from gcs_formation.mission.gate import Gate
from gcs_formation.mission.starting import Starting
from gcs_formation.phases import Cause, Phase
from gcs_formation.vehicle.vehicle import Vehicle


class Links(Stage):
    """Judges each link by what was received, before a vehicle is judged by its messages."""

    name = "links"

    def __init__(self, log_link: Callable[[Vehicle, Instant], None], several: SeveralLinks) -> None:
        """Take what records the state of a link, and what chooses between several of a vehicle."""
        self._log_link, self._several = log_link, several

    def run(self, cycle: Cycle) -> None:
        """Check each, and record what has changed."""
        now = cycle.now
        self._several.choose_link(now)
        for vehicle in cycle.each:
            link = vehicle.connection
            if not link.in_order(now) and link.check(now, vehicle.sequence.loss):
                self._log_link(vehicle, now)


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
        for index, vehicle in enumerate(cycle.each):
            if vehicle.restarts > self._handled[index]:
                self._handled[index] = vehicle.restarts
                cycle.controller.estimator.restart_filter(vehicle.index)
                cycle.restarted.append(vehicle.index)
                pilots = ": it stays its pilot's" if vehicle.is_left else ""
                cycle.log_event(cycle.now, "restarted", f"its clock has begun again{pilots}", vehicle)


class Start(Stage):
    """Checks vehicles before the first command, and carries on their start-up, which waits for these checks."""

    name = "start"

    def __init__(self, gate: Gate, starting: Starting) -> None:
        """Start vehicles by `starting` once `gate` allows commands."""
        self._gate, self._starting = gate, starting

    def run(self, cycle: Cycle) -> None:
        """Do what is due of both."""
        now = cycle.now
        cycle.send(self._gate.requests(now) + cycle.beginning.requests(now), now)
        self._gate.open_if_ready()
        self._starting.advance(now)
        if self._gate.rehearsed:
            cycle.phase_machine.end_rehearsal(now)


class Begin(Stage):
    """Begins to command the formation if its leader follows setpoints."""

    name = "begin"

    def __init__(self, gate: Gate) -> None:
        """Take what says whether vehicles may be commanded."""
        self._gate = gate

    def run(self, cycle: Cycle) -> None:
        """Begin if it is time; decide by the phase whether this cycle commands the formation."""
        if cycle.flight.phase is Phase.CONNECTING and cycle.beginning.may_begin(cycle.now) and self._gate.passed:
            cycle.begins = cycle.phase_machine.move(Cause.LEADER_READY, cycle.now)
        cycle.decide()


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
