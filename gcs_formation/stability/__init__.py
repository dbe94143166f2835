"""Delay margins: how late a loop closed over the link may be before it loses stability."""

from gcs_formation.stability.consensus import (
    consensus_delay_margin,
    consensus_rightmost_root,
    ground_consensus_delay_margin,
)
from gcs_formation.stability.graphs import as_adjacency, graph_adjacency
from gcs_formation.stability.law import (
    ConsensusMargins,
    LawMargins,
    consensus_margins,
    law_margins,
    scenario_adjacency,
    scenario_delay_margin,
)
from gcs_formation.stability.loops import (
    FIXED_GAINS,
    MID_RANGE,
    SMALL_SIGNAL,
    Autopilot,
    GainRange,
    Loop,
    LoopMargins,
    Mixer,
    PidGains,
    Plant,
    delay_margin,
    forward_plant,
    height_plant,
    loop_delay_s,
    loop_margin,
    right_plant,
    worst_loop_margin,
)
from gcs_formation.stability.prediction import MismatchMargin, predicted_mismatch_margin
from gcs_formation.stability.report import FollowerMargins, ScenarioMargins, scenario_loops, scenario_margins

__all__ = [
    "FIXED_GAINS",
    "MID_RANGE",
    "SMALL_SIGNAL",
    "Autopilot",
    "ConsensusMargins",
    "FollowerMargins",
    "GainRange",
    "LawMargins",
    "Loop",
    "LoopMargins",
    "MismatchMargin",
    "Mixer",
    "PidGains",
    "Plant",
    "ScenarioMargins",
    "as_adjacency",
    "consensus_delay_margin",
    "consensus_margins",
    "consensus_rightmost_root",
    "delay_margin",
    "forward_plant",
    "graph_adjacency",
    "ground_consensus_delay_margin",
    "height_plant",
    "law_margins",
    "loop_delay_s",
    "loop_margin",
    "predicted_mismatch_margin",
    "right_plant",
    "scenario_adjacency",
    "scenario_delay_margin",
    "scenario_loops",
    "scenario_margins",
    "worst_loop_margin",
]
