"""Delay margins: how much delay a loop closed over the link can have before it loses stability."""

from gcs_formation.stability.consensus_margins import consensus_delay_margin
from gcs_formation.stability.law_margins import LawMargins, law_loops, law_margins, scenario_delay_margin
from gcs_formation.stability.mismatch import LoopDelay, Usage
from gcs_formation.stability.pid_margins import loop_delay_s

__all__ = [
    "LawMargins",
    "LoopDelay",
    "Usage",
    "consensus_delay_margin",
    "law_loops",
    "law_margins",
    "loop_delay_s",
    "scenario_delay_margin",
]
