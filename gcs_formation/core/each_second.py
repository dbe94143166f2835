"""Stages of once a second: what changes slowly, and the heartbeats."""

from __future__ import annotations

from collections.abc import Callable

from airlink.clock import Instant
from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.fleet.dispatch import Dispatch
from gcs_formation.fleet.heartbeats import HeartbeatScheduler
from gcs_formation.link.link_health import LinkState
from gcs_formation.phases import COMMANDED, Phase


class OwnParts(Stage):
    """Ends the run if what vehicles have from outside, a delay estimator or an autopilot family, has failed.

    Before anything is computed from it.
    """

    name = "own_parts"
    when = EACH_SECOND

    def run(self, cycle: Cycle) -> None:
        """Fail the run by the first error of an extension's part."""
        for each in cycle.each:
            own = each.round_trips.own
            failure = each.autopilot.failure if own is None else own.failure or each.autopilot.failure
            if failure is not None:
                cycle.phase_machine.fail_by(failure, cycle.now, begun=commands_anybody(cycle))


class Strangers(Stage):
    """Answers and reports those whose frames aren't taken: refused by signature, or from no vehicle."""

    name = "strangers"
    when = EACH_SECOND

    def __init__(self, watch: Callable[[Instant], None]) -> None:
        """Take what watches: it needs the receiver, which is the station's."""
        self._watch = watch

    def run(self, cycle: Cycle) -> None:
        """Report refused senders, and answer those that need a heartbeat."""
        self._watch(cycle.now)


class Heartbeats(Stage):
    """Sends heartbeats and the mission time, last of what is sent once a second.

    A vehicle that has had no setpoints for a while gets none: its failsafe takes over then.
    """

    name = "heartbeats"
    when = EACH_SECOND

    def __init__(self, scheduler: HeartbeatScheduler, dispatch: Dispatch) -> None:
        """Take what knows who gets one, and who has had no setpoints."""
        self._scheduler, self._dispatch = scheduler, dispatch

    def run(self, cycle: Cycle) -> None:
        """Send heartbeats but to vehicles that have had no setpoints for a while, and the mission time to all."""
        now = cycle.now
        unguided = self._dispatch.unguided(now)
        cycle.send(self._scheduler.heartbeats(cycle.flight.mission_time_s(now), unguided, now), now)


def commands_anybody(cycle: Cycle) -> bool:
    """Return whether any vehicle received is commanded: by a step of its start-up, in the formation, or at the end."""
    commands = cycle.flight.phase in COMMANDED or cycle.flight.phase is Phase.LOITERING
    received = (each for each in cycle.each if each.connection.state is not LinkState.SEARCHING)
    return any(commands or each.start_up.acted for each in received)
