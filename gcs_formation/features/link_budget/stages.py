# Compiled by mypyc: it runs every tick.

"""The stage that fits what goes over a link to what it carries."""

from __future__ import annotations

from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.features.link_budget.link_budget import LinkBudget


class Budget(Stage):
    """Fits what goes over a link to what it carries. It needs to know how much of their margin loops use."""

    name = "budget"
    when = EACH_SECOND
    after = ("own_parts", "delay_margins")

    def __init__(self, budget: LinkBudget) -> None:
        """Change rates by `budget`."""
        self._budget = budget

    def run(self, cycle: Cycle) -> None:
        """Ask for other rates where they change."""
        findings = cycle.findings
        requests = self._budget.due_requests(cycle.now, findings.margin_used, leaves_unread=findings.others_listen)
        cycle.send(requests, cycle.now)
