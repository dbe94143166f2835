"""Stages that compute the setpoints: what is wanted, guidance and law, and what changes or sees their setpoints."""

from __future__ import annotations

from gcs_formation.core.cycle import IN_COMMAND, LED, Cycle, Stage
from gcs_formation.fleet.dispatch import Dispatch
from gcs_formation.mission.orders import Orders


class Wanted(Stage):
    """Gives planned orders that are due, and goes on with changes of the formation, before anything is steered by it.

    At the end of the flight nothing changes any more.
    """

    name = "wanted"
    when = IN_COMMAND

    def __init__(self, orders: Orders) -> None:
        """Work through `orders`, those planned in the scenario and those given in flight."""
        self._orders = orders

    def run(self, cycle: Cycle) -> None:
        """Do what is due."""
        now, phase_machine = cycle.now, cycle.phase_machine
        cycle.late = phase_machine.waited_long_enough(cycle.last_tick, now)
        cycle.mission_s = cycle.flight.mission_time_s(now)
        cycle.opening = phase_machine.opening
        self._orders.advance(now)
        if cycle.opening is None:
            cycle.reconfiguration.advance(now, cycle.mission_s)


class Delays(Stage):
    """Measures the links as they are now: their delays say when a setpoint acts."""

    name = "delays"
    when = IN_COMMAND

    def __init__(self, dispatch: Dispatch) -> None:
        """Take what delays the leader's setpoints where links differ."""
        self._dispatch = dispatch

    def run(self, cycle: Cycle) -> None:
        """Put them into the cycle."""
        leader = cycle.controller.plan.leader
        cycle.links, cycle.hold_s = self._dispatch.links(leader, cycle.findings.doubted, cycle.now)
        for identity, each in cycle.findings.losses.items():
            if cycle.vehicles[identity].index == leader:
                cycle.links[leader].loss, cycle.links[leader].mean_gap = each.loss, each.mean_gap


class Tick(Stage):
    """Begins the record of the cycle: who is commanded, from which state on, by what the links can do."""

    name = "tick"
    when = IN_COMMAND

    def run(self, cycle: Cycle) -> None:
        """Set the cycle's phase and its tick, which has states and links, and no setpoints yet."""
        cycle.phase = cycle.flight.phase
        controller, phase = cycle.controller, cycle.phase.value
        cycle.tick = controller.begin_tick(cycle.now, cycle.mission_s, phase, cycle.links, cycle.findings.margin_used)


class Leader(Stage):
    """Begins this cycle's setpoints, after which those sent before are complete; without a leader there are none."""

    name = "leader"
    when = IN_COMMAND

    def run(self, cycle: Cycle) -> None:
        """Look whether there is one."""
        cycle.follow_leader(led=cycle.controller.follow(cycle.tick))


class Law(Stage):
    """Predicts the states to when setpoints act, steers the leader, and lets the law compute followers' setpoints."""

    name = "law"
    when = LED

    def run(self, cycle: Cycle) -> None:
        """Put setpoints into the tick."""
        cycle.measured = cycle.controller.decide(cycle.tick, cycle.findings.bandwidth, begin_regardless=cycle.late)


class OwnFilters(Stage):
    """Lets setpoint filters of extensions change setpoints; what keeps vehicles safe comes after them."""

    name = "filters"
    when = LED

    def run(self, cycle: Cycle) -> None:
        """Change the tick's setpoints by each filter, in the order in which they are named."""
        cycle.controller.filter(cycle.tick)


class SetpointsTaken(Stage):
    """Takes the setpoints as those that act: from here on the states are predicted through them."""

    name = "final"
    when = LED

    def run(self, cycle: Cycle) -> None:
        """Add the tick's setpoints to the history by which states are predicted."""
        cycle.controller.take_final(cycle.tick)


class OwnMonitors(Stage):
    """Shows the tick to monitors of extensions: nothing changes it any more."""

    name = "monitors"
    when = LED

    def run(self, cycle: Cycle) -> None:
        """Show each monitor the tick; one that raises ends the run."""
        cycle.controller.monitor(cycle.tick)


class Assembled(Stage):
    """Judges by the errors of the tick whether every follower is in its slot, so that the path may begin."""

    name = "assembled"
    when = LED

    def run(self, cycle: Cycle) -> None:
        """Compare every follower's error with `start.tolerance_m`."""
        cycle.controller.conclude(cycle.tick)
