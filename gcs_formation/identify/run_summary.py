"""What a run's summary tells of its recording: the links' delays, and whether late ticks make it unfit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from formation_scenario.bounded_read import require_file
from gcs_formation.record.json_shape import INTEGER, NUMBER_OR_NULL, Each, mismatch
from gcs_formation.record.lateness import SPOILT_SHARE
from gcs_formation.record.run_directory import SUMMARY


def _summary(directory: Path, shape: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the summary of a run, None where it hasn't this shape or isn't there."""
    try:
        require_file(directory / SUMMARY)
        summary: Any = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return summary if mismatch(summary, shape, SUMMARY) is None else None


def unfit(directory: Path) -> str | None:
    """Return why a run isn't fit for time constants and a dead time, by its late ticks; None if it is."""
    summary = _summary(directory, {"control": {"ticks": INTEGER, "late_ticks": INTEGER}})
    late, count = (0, 0) if summary is None else (summary["control"][each] for each in ("late_ticks", "ticks"))
    if late <= SPOILT_SHARE * count:
        return None
    return (
        f"found {late} of {count} control ticks late ({late / count:.1%}); allowed: {SPOILT_SHARE:.0%}. This recording "
        "is unfit: time constants and dead time are those of a machine that was held up, and deviations don't cover "
        "that; record again while nothing else runs"
    )


def delays_s(directory: Path) -> dict[int, float]:
    """Return the measured round-trip delay of each vehicle's link, s, as far as the summary has it."""
    summary = _summary(directory, {"links": Each({"measured_delay_ms": {"p50": NUMBER_OR_NULL}})})
    if summary is None:
        return {}
    delays = {name.rpartition(":")[2]: each["measured_delay_ms"]["p50"] for name, each in summary["links"].items()}
    return {int(system): 2e-3 * ms for system, ms in delays.items() if ms is not None and system.isdecimal()}
