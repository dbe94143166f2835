"""Reads what a run left that has no summary: it was killed, its disk was full, it failed, or it still flies."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from airlink.frame import ParserCounts
from flight_model.arrays import Array
from formation_scenario import Scenario
from gcs_formation.app.run import recorded_truth
from gcs_formation.errors import RecordError
from gcs_formation.record.expectations import ControlFigures, LinkFigures, Outcome
from gcs_formation.record.flight import Flight, join, split
from gcs_formation.record.run_directory import EVENTS, SPOOL, SUMMARY
from gcs_formation.record.summary import summarise
from gcs_formation.record.timeseries import in_words, read_spool
from gcs_formation.stability import scenario_delay_margin

LINK_DELAYS = ("delay_s", "up_s", "down_s")
UNKNOWN_IN_LINKS = (
    "injected_delay_ms",
    "injected_up_ms",
    "injected_down_ms",
    "injected_loss",
    "measured_loss",
    "frames_in",
    "frames_out",
    "frames_bad",
    "frames_implausible",
)
UNKNOWN_IN_CONTROL = ("late_ticks",)
UNKNOWN = (*UNKNOWN_IN_LINKS, *UNKNOWN_IN_CONTROL, "compute_ms", "wall_s", "real_time_factor", "worst_loop_delay_s")
"""Figures that only the process which flew could have given."""


@dataclass(frozen=True)
class Recovered:
    """What can be told of an unfinished run."""

    summary: Mapping[str, Any]
    """As summary.json, None for what isn't known."""
    columns: Mapping[str, Array]
    """As timeseries.parquet."""
    events: tuple[Mapping[str, Any], ...]
    missing: tuple[str, ...]
    """What is missing, in words."""


def recover(directory: Path, scenario: Scenario) -> Recovered:
    """Return what an unfinished run recorded: from its spool, its events, and the ground truth if that was written.

    Raises:
        OSError: a file can't be read.
        ValueError: a file isn't what it should be.
        RecordError: nothing was flown.
    """
    events, cut_off = _events(directory / EVENTS)
    columns = read_spool(directory / SPOOL)
    truth = recorded_truth(directory, scenario)
    if truth is not None:
        known = columns["t_s"] <= truth.time_s[-1]
        columns = {name: values[known] for name, values in columns.items()}
    if not columns["t_s"].size:
        raise RecordError(f"found no control tick in {directory}: {_last_phase(events)}, and nothing was flown")
    unknown_s = np.full((columns["t_s"].size // len(scenario.vehicles), 2), np.nan)
    flight = split(columns, scenario, truth, {each.vehicle_id: unknown_s for each in scenario.vehicles})
    summary = _without_unknown(summarise(_outcome(scenario, flight)).to_dict())
    words = _missing(scenario, flight, events, cut_off=cut_off)
    return Recovered(summary, in_words(join(flight)), events, words)


def _events(path: Path) -> tuple[tuple[Mapping[str, Any], ...], bool]:
    """Return the events, and whether the last line was cut off."""
    lines = path.read_bytes().splitlines() if path.is_file() else []
    events = [_parsed(line) for line in lines]
    if events and events[-1] is None:
        return tuple(event for event in events if event is not None), True
    return tuple(event for event in events if event is not None), False


def _parsed(line: bytes) -> Mapping[str, Any] | None:
    try:
        return json.loads(line)
    except ValueError:
        return None


def _last_phase(events: tuple[Mapping[str, Any], ...]) -> str:
    phases = [str(event.get("text")) for event in events if event.get("kind") == "phase"]
    return f"the last phase of the run was {phases[-1] if phases else 'connecting'}"


def _outcome(scenario: Scenario, flight: Flight) -> Outcome:
    t_s = next(iter(flight.vehicles.values()))["t_s"]
    return Outcome(
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
        control=ControlFigures(scenario.law.rate_hz, t_s, t_s, np.full(t_s.shape, np.nan)),
        delay_margin_s=_finite(scenario_delay_margin(scenario)),
        worst_loop_delay_s=None,
        margin_used=max(_largest(own["margin_used"]) for own in flight.vehicles.values()),
        received=ParserCounts(),
        frames_refused=0,
        simulated_s=float(t_s[-1]),
        wall_s=0.0,
        cut_short=True,
    )


def _without_unknown(summary: dict[str, Any]) -> dict[str, Any]:
    """Return the summary without the figures that only the process which flew could have given."""
    links = {name: link | dict.fromkeys(UNKNOWN_IN_LINKS) for name, link in summary["links"].items()}
    expect = [
        entry | ({"value": None, "held": None} if entry["metric"].partition(".")[0] in UNKNOWN else {})
        for entry in summary["expect"]
    ]
    return summary | {
        "wall_s": None,
        "links": links,
        "received": dict.fromkeys(summary["received"]),
        "control": summary["control"] | dict.fromkeys(UNKNOWN_IN_CONTROL),
        "expect": expect,
    }


def _missing(
    scenario: Scenario, flight: Flight, events: tuple[Mapping[str, Any], ...], *, cut_off: bool
) -> tuple[str, ...]:
    failures = [str(event.get("text")) for event in events if event.get("kind") == "failure"]
    why = f"the run failed: {failures[-1]}" if failures else "the run was killed, or it has not ended yet"
    mission_s = float(flight.mission_time_s[-1])
    begun = np.isfinite(mission_s)
    end = (
        f"t = {mission_s:.1f} s, of {scenario.duration_s:g} s"
        if begun
        else "a moment of the assembly: t = 0 wasn't reached"
    )
    missing = [
        f"{SUMMARY}: {why}; what follows is from the record up to then",
        f"whatever came after {end}",
        "what was injected into the links, losses and counts of frames, late ticks, computing times",
    ]
    missing += [] if flight.truth else ["ground truth: errors are from telemetry, as the law saw them"]
    return (*missing, *(["the end of the last event"] if cut_off else []))


def _largest(values: Array) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else 0.0


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
