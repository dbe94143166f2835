"""A run without a summary: it was killed, it failed, or it has not ended yet."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from airlink.stream_parser import ParserCounts
from formation_scenario import Scenario
from gcs_formation.control.laws import law_kind
from gcs_formation.errors import RecordError
from gcs_formation.record.expectations import RunOutcome
from gcs_formation.record.figures_of_merit import if_finite
from gcs_formation.record.flight import RecordedFlight, judged, split, tables
from gcs_formation.record.link_verdicts import LinkFigures
from gcs_formation.record.run_directory import SPOOL, SUMMARY
from gcs_formation.record.summary import summarise
from gcs_formation.record.timeseries import Spool
from gcs_formation.report.run_data import Events, RunData, in_force, run_data
from gcs_formation.stability import scenario_delay_margin

LINK_DELAYS = ("delay_s", "up_s", "down_s")
UNKNOWN_IN_LINKS = (
    "injected_delay_ms",
    "injected_up_ms",
    "injected_down_ms",
    "injected_loss",
    "injected_loss_up",
    "measured_loss",
    "frames_in",
    "frames_out",
    "frames_bad",
    "frames_implausible",
    "frames_duplicate",
    "frames_late",
)
UNKNOWN_IN_CONTROL = ("late_ticks", "lateness")
UNKNOWN = (*UNKNOWN_IN_LINKS, *UNKNOWN_IN_CONTROL, "compute_ms", "wall_s", "real_time_factor", "worst_loop_delay_s")
"""Figures that only the process that flew could know."""
NOT_RECORDED = {"value": None, "held": None, "judged": False, "judged_share": 0.0, "reason": "not in the record"}


def unfinished(directory: Path, scenario: Scenario) -> RunData:
    """Return what an unfinished run recorded: its spool, its events, and the ground truth if there is any."""
    from gcs_formation.app.run import recorded_truth  # noqa: PLC0415 - few reports need what flies
    from gcs_formation.record.unfinished import recorded_events  # noqa: PLC0415

    events, cut_off = recorded_events(directory)
    columns, truth = Spool(directory / SPOOL).read(), recorded_truth(directory)
    if truth is not None:
        known = columns["t_s"] <= truth.last_s
        columns = {name: values[known] for name, values in columns.items()}
    if not columns["t_s"].size:
        phases = [str(event.get("text")) for event in events if event.get("kind") == "phase"]
        last = f"the last phase of the run was {phases[-1] if phases else 'connecting'}"
        raise RecordError(f"found no control tick in {directory}: {last}, and nothing was flown")
    unknown_s = np.full((columns["t_s"].size // len(scenario.vehicles), 2), np.nan)
    injected_s = {each.vehicle_id: unknown_s for each in scenario.vehicles}
    (whole,) = tables([columns], scenario, None if truth is None else truth.between, injected_s)
    flight = judged(split(whole, scenario), scenario, None if truth is None else truth.between, events)
    summary = _without_unknown(summarise(_outcome(in_force(scenario, events), flight)).to_dict())
    words = _missing(scenario, flight, events, cut_off=cut_off)
    return run_data(scenario, summary, events, flight, words)


def _outcome(scenario: Scenario, flight: RecordedFlight) -> RunOutcome:
    t_s = flight.common["t_s"]
    none = 0.0 if law_kind(scenario).has_margins else math.nan
    return RunOutcome(
        scenario=scenario,
        clock="unknown",
        flight=flight,
        links={
            identity: LinkFigures(
                delays_s=np.column_stack([own[name] for name in LINK_DELAYS]),
                delay_times_s=own["mission_time_s"],
                measured_loss=0.0,
                frames_in=0,
                frames_out=0,
                frames_bad=0,
            )
            for identity, own in flight.vehicles.items()
        },
        ticks_s=np.array((t_s, t_s, np.full(t_s.shape, np.nan))),
        delay_margin_s=if_finite(scenario_delay_margin(scenario)),
        worst_loop_delay_s=None,
        margin_used=max(float(np.fmax.reduce(own["margin_used"], initial=none)) for own in flight.vehicles.values()),
        received=ParserCounts(),
        frames_refused=0,
        simulated_s=float(t_s[-1]),
        wall_s=0.0,
        cut_short=True,
    )


def _without_unknown(summary: dict[str, Any]) -> dict[str, Any]:
    """Return the summary without the figures that only the process that flew could know."""
    return summary | {
        "version": None,
        "wall_s": None,
        "links": {name: link | dict.fromkeys(UNKNOWN_IN_LINKS) for name, link in summary["links"].items()},
        "received": dict.fromkeys(summary["received"]),
        "control": summary["control"] | dict.fromkeys(UNKNOWN_IN_CONTROL),
        "expect": [
            entry | (NOT_RECORDED if entry["metric"].partition(".")[0] in UNKNOWN else {})
            for entry in summary["expect"]
        ],
    }


def _missing(scenario: Scenario, flight: RecordedFlight, events: Events, *, cut_off: bool) -> tuple[str, ...]:
    failures = [str(event.get("text")) for event in events if event.get("kind") == "failure"]
    why = f"the run failed: {failures[-1]}" if failures else "the run was killed, or it has not ended yet"
    mission_s = float(flight.mission_time_s[-1])
    reached = f"t = {mission_s:.1f} s, of {scenario.duration_s:g} s"
    end = reached if np.isfinite(mission_s) else "a moment of the assembly: t = 0 wasn't reached"
    return (
        f"{SUMMARY}: {why}; what follows is from the record up to then",
        f"whatever came after {end}",
        "what was injected into the links, losses and counts of frames, late ticks, computing times",
        *(() if flight.truth else ("ground truth: errors are from telemetry, as the law saw them",)),
        *(("the end of the last event",) if cut_off else ()),
    )
