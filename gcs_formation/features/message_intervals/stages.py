# Compiled by mypyc: it runs every tick.

"""Its stage."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.features.message_intervals.requested_again import MessageIntervals
from gcs_formation.phases import Phase


class RequestedAgain(Stage):
    """Requests missing messages again, of vehicles whose link and start-up have been judged in this cycle.

    At the end, while all loiter, nothing is computed from them.
    """

    name = "message_intervals"
    after = ("members",)

    def __init__(self, intervals: MessageIntervals) -> None:
        """Take what requests them."""
        self.intervals = intervals

    def run(self, cycle: Cycle) -> None:
        """Look whether some are missing."""
        if cycle.flight.phase is not Phase.LOITERING:
            self.intervals.check_all(cycle.now)
