# Compiled by mypyc: it runs every tick.

"""Its stages: who is doubted, and who sinks, is said in the findings."""

from __future__ import annotations

from gcs_formation.core.cycle import IN_COMMAND, NOT_IN_COMMAND, Cycle, Stage
from gcs_formation.features.conformance.monitor import ConformanceMonitor


class Answers(Stage):
    """Judges answers and effects of commands, after vehicles that have just left the formation are known."""

    name = "conformance_of_answers"
    after = ("members", "message_intervals")

    def __init__(self, monitor: ConformanceMonitor) -> None:
        """Judge by `monitor`, which all three stages share."""
        self._monitor = monitor

    def run(self, cycle: Cycle) -> None:
        """Judge effects of commands, answers, refusals and silence, in this order."""
        self._monitor.judge_commands(cycle.now)
        self._monitor.judge_answers(cycle.now)
        self._monitor.judge_refusals(cycle.now)
        self._monitor.judge_silence(cycle.now)


class Motion(Stage):
    """Judges motion by the setpoints as they were sent, which the tick has when it is recorded."""

    name = "conformance_of_motion"
    when = IN_COMMAND
    after = ("record",)

    def __init__(self, monitor: ConformanceMonitor, cycle: Cycle) -> None:
        """Take what judges; its findings are the cycle's."""
        self._monitor = monitor
        cycle.findings.doubted, cycle.findings.sinking = monitor.doubted, monitor.sinking
        monitor.saturated = cycle.findings.saturated

    def run(self, cycle: Cycle) -> None:
        """Compare each vehicle's motion with its setpoints, every 0.4 s."""
        self._monitor.judge_motion(cycle.tick, cycle.now)


class NoMotion(Stage):
    """Expects no motion by setpoints, where none are sent."""

    name = "no_conformance_of_motion"
    when = NOT_IN_COMMAND
    after = ("phases",)

    def __init__(self, monitor: ConformanceMonitor) -> None:
        """Judge by `monitor`, which all three stages share."""
        self._monitor = monitor

    def run(self, cycle: Cycle) -> None:
        """Begin every vehicle's period of setpoints again when setpoints are sent next."""
        del cycle
        self._monitor.stand_down()
