"""Stages that take what vehicles report, and decide which of them fly in the formation."""

from __future__ import annotations

from gcs_formation.core.cycle import IN_COMMAND, Cycle, Stage
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
        for index in range(len(samples)):
            samples[index] = None
        for vehicle in cycle.each:
            index = vehicle.index
            samples[index] = vehicle.sampler.new(cycle.now, flew=vehicle.flew, leads=index == leader)


class Estimates(Stage):
    """Filters the samples: states, their noise, the wind. They have been examined by then."""

    name = "estimates"
    when = IN_COMMAND

    def run(self, cycle: Cycle) -> None:
        """Give each vehicle's filter its newest sample; without one its state is predicted on."""
        cycle.controller.update_states(cycle.samples)


class Members(Stage):
    """Decides which vehicles fly in the formation, by the age of their states; without a leader none does.

    Once all loiter none flies in it any more; their pilots may take them over still.
    """

    name = "members"

    def run(self, cycle: Cycle) -> None:
        """Decide by the phase."""
        phase = cycle.flight.phase
        if phase is Phase.LOITERING:
            cycle.membership.update_at_end(cycle.now)
        else:
            leader, estimator = cycle.reconfiguration.leader, cycle.controller.estimator
            connecting, beyond = phase is Phase.CONNECTING, cycle.findings.beyond
            if connecting and cycle.findings.waiting:
                beyond = beyond | cycle.findings.waiting
            cycle.membership.update(leader, estimator, cycle.now, connecting=connecting, beyond=beyond)
