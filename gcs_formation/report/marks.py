"""What happened to a flight: the vertical lines in its figures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

from formation_scenario.fields import Timed, VehicleSelection
from formation_scenario.formation import FormationChange
from formation_scenario.links import ImpairmentPatch, LinkChange
from gcs_formation.report.run_data import RunData

SAME_S = 0.5
"""Marks of one label no further apart than this are one."""
MOST_EVENTS = 12
"""Events shown; a link that comes and goes would hide everything else."""
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
    """disturbance, fault, shape, link, order or lost."""


def marks(run: RunData) -> list[Mark]:
    """Return planned changes and events, changes of leader, orders and lost links, by time."""
    begin, end = float(run.time_s[0]), float(run.time_s[-1])
    found = [*_planned(run), *_happened(run)]
    inside = (mark for mark in found if begin <= mark.time_s <= end)
    return _merged(sorted(inside))


def _planned(run: RunData) -> Iterator[Mark]:
    if not run.begun:
        return
    scenario = run.scenario
    for disturbance in scenario.disturbances:
        yield from _passing(disturbance, "disturbance", "disturbance", disturbance.until_s)
    for fault in scenario.faults:
        yield from _passing(fault, fault.kind, "fault", fault.until_s)
    for change in scenario.formation.changes:
        yield Mark(change.at_s, _changed(change), "shape")
    for change in scenario.links.changes:
        yield Mark(change.at_s, f"{_link(change)}{_of(change.vehicles)}", "link")


def _changed(change: FormationChange) -> str:
    """Return a change of the formation in a few words."""
    leader = f"leader {change.leader}" if change.leader is not None else ""
    spacing = f"spacing {change.spacing_m:g} m" if change.shape is None and change.spacing_m is not None else ""
    return ", ".join(part for part in (change.shape or "", spacing, leader) if part) or "slots"


def _passing(each: Timed, name: str, kind: str, until_s: float | None) -> Iterator[Mark]:
    """Yield when something begins and, if it does, ends."""
    yield Mark(each.at_s, f"{name}{_of(each.vehicles)}", kind)
    if until_s is not None:
        yield Mark(until_s, f"{name} over{_of(each.vehicles)}", kind)


def _happened(run: RunData) -> list[Mark]:
    marked = (Mark(float(e["t_s"]) - run.zero_s, *words) for e in run.events if (words := _words(e)) is not None)
    return list(islice(marked, MOST_EVENTS))


def _words(event: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return label and kind of an event that is worth a mark."""
    vehicle = event.get("vehicle", "?")
    match event.get("kind"), event.get("text"):
        case "link", "lost":
            return f"link lost ({vehicle})", "lost"
        case "leader", _:
            return f"leader {vehicle}", "shape"
        case "order", text if event.get("accepted"):
            return str(text).removesuffix(": accepted"), "order"
        case _:
            return None


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
