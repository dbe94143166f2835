# Compiled by mypyc: it runs every tick.

"""Its stages: shares in use, bandwidths, and who is beyond its margin, are said in the findings."""

from __future__ import annotations

from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.errors import NotFiniteError
from gcs_formation.features.delay_margins.margin_watch import DesignWatch, MarginWatch
from gcs_formation.phases import COMMANDED


class GainDesign(Stage):
    """Designs gains again for slower links, before margins are judged by these gains."""

    name = "gain_design"
    when = EACH_SECOND
    after = ("own_parts",)

    def __init__(self, watch: DesignWatch) -> None:
        """Design by `watch`, which both stages share."""
        self._watch = watch

    def run(self, cycle: Cycle) -> None:
        """Design them if links are slower than they are for."""
        if cycle.flight.phase in COMMANDED:
            self._watch.check_loops(cycle.now)
            cycle.findings.tuned = self._watch.scenario


class FirstGainDesign(Stage):
    """Designs gains for the links as they are found, before the first setpoint."""

    name = "first_gain_design"
    after = ("begin",)

    def __init__(self, watch: DesignWatch) -> None:
        """Design by `watch`, which both stages share."""
        self._watch = watch

    def run(self, cycle: Cycle) -> None:
        """Design them if the formation begins to be commanded."""
        if cycle.begins:
            self._watch.check_loops(cycle.now, begins=True)
            cycle.findings.tuned = self._watch.scenario


class DelayMargins(Stage):
    """Judges the loops' delays by their margins. It needs the time constants' errors, which use up margins, too."""

    name = "delay_margins"
    when = EACH_SECOND
    after = ("own_parts", "gain_design", "time_constants_off")

    def __init__(self, watch: MarginWatch, cycle: Cycle) -> None:
        """Take what judges; its findings are the cycle's."""
        self._watch, findings = watch, cycle.findings
        findings.margin_used, findings.bandwidth = watch.used, watch.bandwidth
        if watch.holds:
            findings.beyond = watch.beyond
        findings.max_used = watch.max_used

    def run(self, cycle: Cycle) -> None:
        """Judge them; a law may fail to state its margins."""
        watch, controller, findings = self._watch, cycle.controller, cycle.findings
        try:
            watch.check_loops(cycle.now, cycle.reconfiguration.leader, findings.time_constants_off)
        except NotFiniteError as error:
            controller.fault = controller.fault or error
        findings.max_used, findings.longest_s = watch.max_used, watch.longest_s
