"""What happened to a flight: the vertical lines in its figures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from formation_scenario.fields import VehicleSelection
from formation_scenario.formation import FormationChange
from formation_scenario.links import ImpairmentPatch, LinkChange
from gcs_formation.report.run_data import RunData

SAME_S = 0.5
"""Marks of one label no further apart than this are one."""
MOST_EVENTS = 12
"""Lost links shown; a link that comes and goes would hide everything else."""
WORDS = {
    "delay_ms": "delay {:g} ms",
    "jitter_ms": "jitter {:g} ms",
    "loss": "loss {:.0%}",
    "duplicate": "twice {:.0%}",
    "rate_kbps": "{:g} kbit/s",
}


class Mark(NamedTuple):
    """Something at a mission time, in a word or two."""

    time_s: float
    label: str
    kind: str
    """disturbance, fault, shape, link or lost."""


def marks(run: RunData) -> list[Mark]:
    """Return what was planned to happen and which links were lost, in time order, within the flown time."""
    begin, end = float(run.time_s[0]), float(run.time_s[-1])
    found = [*_planned(run), *_lost_links(run)]
    inside = (mark for mark in found if begin <= mark.time_s <= end)
    return _merged(sorted(inside))


def _planned(run: RunData) -> Iterator[Mark]:
    if not run.begun:
        return
    scenario = run.scenario
    for disturbance in scenario.disturbances:
        yield Mark(disturbance.at_s, f"disturbance{_of(disturbance.vehicles)}", "disturbance")
    for fault in scenario.faults:
        yield Mark(fault.at_s, f"{fault.kind}{_of(fault.vehicles)}", "fault")
    for change in scenario.formation.changes:
        yield Mark(change.at_s, _changed(change), "shape")
    for change in scenario.links.changes:
        yield Mark(change.at_s, f"{_link(change)}{_of(change.vehicles)}", "link")


def _changed(change: FormationChange) -> str:
    """Return a change of the formation in a few words."""
    leader = f"leader {change.leader}" if change.leader is not None else ""
    spacing = f"spacing {change.spacing_m:g} m" if change.shape is None and change.spacing_m is not None else ""
    return ", ".join(part for part in (change.shape or "", spacing, leader) if part) or "slots"


def _lost_links(run: RunData) -> list[Mark]:
    lost = [event for event in run.events if event.get("kind") == "link" and event.get("text") == "lost"]
    return [_lost(event, run.zero_s) for event in lost[:MOST_EVENTS]]


def _lost(event: Mapping[str, Any], zero_s: float) -> Mark:
    return Mark(float(event["t_s"]) - zero_s, f"link lost ({event.get('vehicle', '?')})", "lost")


def _of(vehicles: VehicleSelection) -> str:
    if vehicles == "all":
        return ""
    return f" ({', '.join(map(str, vehicles[:3]))}{', …' if len(vehicles) > 3 else ''})"


def _link(change: LinkChange) -> str:
    ways = ("", "up ", "down ")
    patches: tuple[ImpairmentPatch | None, ...] = (change, change.uplink, change.downlink)
    words = [
        way + text.format(value)
        for way, patch in zip(ways, patches, strict=True)
        if patch is not None
        for key, text in WORDS.items()
        if (value := getattr(patch, key)) is not None
    ]
    return ", ".join(words) or "link change"


def _merged(ordered: Iterable[Mark]) -> list[Mark]:
    kept: list[Mark] = []
    for mark in ordered:
        same = (other for other in kept if mark.time_s - other.time_s <= SAME_S and other.label == mark.label)
        if next(same, None) is None:
            kept.append(mark)
    return kept
