"""What a report reads from summary.json."""

from __future__ import annotations

from flight_model.slot import CHANNELS
from gcs_formation.record.json_shape import (
    INTEGER,
    NUMBER,
    NUMBER_OR_NULL,
    TEXT,
    TEXT_OR_NULL,
    TRUTH_OR_NULL,
    Each,
    Maybe,
    Shape,
)
from gcs_formation.record.path_distance import FIGURES
from gcs_formation.record.timeseries import ERROR

AXIS: Shape = dict.fromkeys(("rms", "max", "steady_max"), NUMBER_OR_NULL)
OFF_PATH: Shape = dict.fromkeys(("rms", "max"), NUMBER_OR_NULL)
SUMMARY_SHAPE: Shape = {
    **dict.fromkeys(("name", "clock"), TEXT),
    **{"seed": INTEGER, "duration_s": NUMBER, "real_time_factor": NUMBER_OR_NULL},
    "followers": Each(
        {
            **dict.fromkeys(ERROR, AXIS),
            **dict.fromkeys(("settled_at_s", "left_at_s"), NUMBER_OR_NULL),
            **dict.fromkeys(("in_slot_share", "followed_share"), Maybe(NUMBER_OR_NULL)),
            "effort": dict.fromkeys(CHANNELS, dict.fromkeys(("variation_per_s", "step_p95"), NUMBER_OR_NULL)),
        }
    ),
    "links": Each(
        {
            **dict.fromkeys(("injected_delay_ms", "injected_up_ms", "injected_down_ms"), NUMBER_OR_NULL),
            **dict.fromkeys(("measured_up_ms", "measured_down_ms"), NUMBER_OR_NULL),
            "measured_delay_ms": dict.fromkeys(("p50", "p99"), NUMBER_OR_NULL),
            **dict.fromkeys(("frames_in", "frames_out", "frames_bad"), NUMBER_OR_NULL),
            **dict.fromkeys(("injected_loss_up", "injected_loss", "measured_loss"), Maybe(NUMBER_OR_NULL)),
        }
    ),
    "control": {
        "rate_hz": NUMBER,
        **dict.fromkeys(("ticks", "late_ticks"), INTEGER),
        "period_ms": dict.fromkeys(("p50", "p99", "max"), NUMBER_OR_NULL),
        "compute_ms": dict.fromkeys(("p50", "p99"), NUMBER_OR_NULL),
        "lateness": Maybe(TEXT_OR_NULL),
    },
    "safety": {
        **{"violations": INTEGER, "fence_m": Maybe(NUMBER_OR_NULL)},
        **dict.fromkeys(("min_separation_m", "min_clearance_m"), NUMBER_OR_NULL),
    },
    "path": Maybe(dict.fromkeys(("leader", "centre"), dict.fromkeys(FIGURES, OFF_PATH))),
    "stability": dict.fromkeys(("delay_margin_s", "worst_loop_delay_s"), NUMBER_OR_NULL),
    "expect": Each(
        {
            **{"metric": TEXT, "value": NUMBER_OR_NULL, "held": TRUTH_OR_NULL, "reason": Maybe(TEXT)},
            "judged_share": Maybe(NUMBER),
            **dict.fromkeys(("from_s", "to_s", "below", "above"), Maybe(NUMBER)),
        }
    ),
    **dict.fromkeys(("undone", "unsafe"), Maybe(Each(TEXT))),
}
"""The keys and their types (docs/summary.schema.json)."""
