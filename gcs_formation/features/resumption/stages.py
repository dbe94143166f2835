# Compiled by mypyc: it runs every tick.

"""The stage that ends a resumed flight which can't go on, or was ending."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.features.resumption.takeover import WAIT_S, Takeover
from gcs_formation.phases import Cause, Phase


class TakenOver(Stage):
    """Ends a resumed flight in which no vehicle can be taken over, or which was ending, before it begins again."""

    name = "taken_over"
    after = ("start",)

    def __init__(self, takeover: Takeover) -> None:
        """Take what decides on vehicles."""
        self._takeover = takeover

    def run(self, cycle: Cycle) -> None:
        """End it if it is time."""
        if cycle.flight.phase is not Phase.CONNECTING:
            return
        takeover, phase_machine, now = self._takeover, cycle.phase_machine, cycle.now
        leads, reason = takeover.has_leader(now) and phase_machine.gate.passed, takeover.failure(now)
        if reason is not None:
            phase_machine.fail(reason, now, begun=takeover.took_any)
        elif takeover.is_over(now):
            phase_machine.move(Cause.CALLED_OFF, now)
        elif takeover.past.ending and takeover.settled(now) and (leads or takeover.waited(now, 2.0 * WAIT_S)):
            if leads:
                phase_machine.move(Cause.LEADER_READY, now)
            phase_machine.stop(now)
