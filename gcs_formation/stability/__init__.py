"""Delay margins: how much delay a loop closed over the link can have before it loses stability."""

from gcs_formation.stability.consensus import (
    consensus_delay_margin,
    consensus_rightmost_root,
    ground_consensus_delay_margin,
    ground_consensus_loops,
)
from gcs_formation.stability.graphs import as_adjacency, graph_adjacency
from gcs_formation.stability.law import (
    ConsensusMargins,
    LawMargins,
    consensus_margins,
    law_loops,
    law_margins,
    scenario_adjacency,
    scenario_delay_margin,
)
from gcs_formation.stability.loops import (
    FIXED_GAINS,
    MID_RANGE,
    SMALL_SIGNAL,
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
from gcs_formation.stability.pid_loops import FollowerMargins, ScenarioMargins, follower_loops, scenario_margins
from gcs_formation.stability.prediction import MismatchMargin, predicted_mismatch_margin
from gcs_formation.stability.usage import LoopDelay, Usage

__all__ = [
    "FIXED_GAINS",
    "MID_RANGE",
    "SMALL_SIGNAL",
    "ConsensusMargins",
    "FollowerMargins",
    "GainRange",
    "LawMargins",
    "Loop",
    "LoopDelay",
    "LoopMargins",
    "MismatchMargin",
    "Mixer",
    "PidGains",
    "Plant",
    "ScenarioMargins",
    "Usage",
    "as_adjacency",
    "consensus_delay_margin",
    "consensus_margins",
    "consensus_rightmost_root",
    "delay_margin",
    "follower_loops",
    "forward_plant",
    "graph_adjacency",
    "ground_consensus_delay_margin",
    "ground_consensus_loops",
    "height_plant",
    "law_loops",
    "law_margins",
    "loop_delay_s",
    "loop_margin",
    "predicted_mismatch_margin",
    "right_plant",
    "scenario_adjacency",
    "scenario_delay_margin",
    "scenario_margins",
    "worst_loop_margin",
]
