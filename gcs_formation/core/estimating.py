"""Stages that take what vehicles report, and decide which of them fly in the formation."""

from __future__ import annotations

from gcs_formation.core.cycle import IN_COMMAND, Cycle, Stage
from gcs_formation.fleet.membership_and_succession import Membership
from gcs_formation.phases import Phase


class Samples(Stage):
    """Takes each vehicle's newest state as it reports it.

    Before vehicles are judged by the age of their states, in case the station was held up.
    """

    name = "samples"
    when = IN_COMMAND

    def run(self, cycle: Cycle) -> None:
        """Put them into the cycle."""
        leader, samples = cycle.controller.plan.leader, cycle.samples
        for column in range(len(samples)):
            samples[column] = None
        for vehicle in cycle.each:
            column = vehicle.column
            samples[column] = vehicle.sampler.new(cycle.now, flew=vehicle.flew, leads=column == leader)


class Estimates(Stage):
    """Filters the samples: states, their noise, the wind. They have been examined by then."""

    name = "estimates"
    when = IN_COMMAND

    def run(self, cycle: Cycle) -> None:
        """Update the filters."""
        cycle.controller.take(cycle.samples)


class Members(Stage):
    """Decides which vehicles fly in the formation, and which one succeeds a lost leader; by the age of their states."""

    name = "members"

    def __init__(self, membership: Membership) -> None:
        """Take what decides."""
        self._membership = membership

    def run(self, cycle: Cycle) -> None:
        """Decide, unless all loiter."""
        if cycle.flight.phase is Phase.LOITERING:
            return
        now, changes, estimator = cycle.now, cycle.reconfiguration, cycle.controller.estimator
        leader, connecting = changes.leader, cycle.flight.phase is Phase.CONNECTING
        beyond, sinking = cycle.findings.beyond, cycle.findings.sinking

        def replaceable() -> bool:
            return changes.successor(sinking, now) is not None

        if leader and not connecting:
            sinks = leader.identity in sinking
            if self._membership.leader_lost(leader, estimator, now, replaceable, beyond, sinks=sinks):
                changes.succeed(sinking, now)
        self._membership.judge(changes.leader, estimator, now, connecting=connecting, beyond=beyond)
