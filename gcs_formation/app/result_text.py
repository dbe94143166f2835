"""Text for a terminal: the result of a run, and its status during the flight."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from airlink.cli import counted
from airlink.clock import NANOSECONDS, Instant
from flight_model.arrays import Array
from flight_model.slot import UNKNOWN
from gcs_formation.link.link_health import LinkState
from gcs_formation.record.expectations import FAILINGS
from gcs_formation.record.summary import Summary
from gcs_formation.station import Station
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

GAP = "  "
WIDE = 10**6
MAX_ROWS = 24
WHOLE = 0.995
"""Share of the time from which a follower counts as having followed all of it."""
WIDTH = 80
"""Width of a status page, and of tables in a pipe or file; there, sentences aren't wrapped."""
SHORT = {
    Member.STARTING: "starting",
    Member.FLYING: "in formation",
    Member.PARTED: "parted",
    Member.NO_LINK: "not heard",
    Member.HOLDING: "told to loiter",
    Member.RETURNING: "coming back",
    Member.HOMEWARD: "sent home",
}


class ColumnGroup(NamedTuple):
    """Columns of a table that are kept or dropped together."""

    heads: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    keep: int
    """Groups with the lowest number are dropped first where the table is too wide."""


def table(groups: Sequence[ColumnGroup], width: int) -> list[str]:
    """Return a table's lines with as many groups as fit, at least the one with the highest `keep`."""
    chosen = list(groups)
    lines = _lines(chosen)
    while len(chosen) > 1 and max(map(len, lines)) > width:
        chosen.remove(min(chosen, key=lambda group: group.keep))
        lines = _lines(chosen)
    return lines


def line(parts: Sequence[tuple[str, ...]], width: int) -> str:
    """Return parts side by side. While they don't fit, parts are shortened, then dropped, the last one first."""
    wordings = [[*each, ""] for each in parts]
    while len(_joined(wordings)) > width:
        longest = max(map(len, wordings))
        next(each for each in reversed(wordings) if len(each) == longest).pop(0)
    return _joined(wordings)


def wrapped(text: str, width: int) -> list[str]:
    """Return a text wrapped at word boundaries; all lines but the first are indented."""
    lines = textwrap.wrap(text, max(width, 1), subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return lines or [""]


def _joined(wordings: Sequence[Sequence[str]]) -> str:
    return GAP.join(wording[0] for wording in wordings if wording[0])


def _lines(groups: Sequence[ColumnGroup]) -> list[str]:
    """Return one line for each row: the first column and texts are left-aligned, figures right-aligned."""
    heads = [head for group in groups for head in group.heads]
    rows = [heads, *([cell for row in each for cell in row] for each in zip(*(g.rows for g in groups), strict=True))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        GAP.join(
            cell.rjust(width) if i else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def summary_text(summary: Summary, directory: Path, width: int | None = None) -> str:
    """Return a run's figures as a table, its verdicts, and where its files are; `width`: of the terminal, if any."""
    figures = summary.to_dict()
    words = [_headline(figures), _source(figures)]
    rows = table(_follower_groups(figures), width or WIDTH) if figures["followers"] else []
    left = len(figures["followers"]) - MAX_ROWS
    after = [f"… and {left} more in summary.json"] if left > 0 else []
    after += [
        *_partly(figures),
        *_path(figures),
        *_safety(figures),
        *_verdicts(summary),
        *summary.breaches,
        *spoilt(summary),
        f"recorded in {directory}",
    ]
    return "\n".join([*_wrapped(words, width), *rows, *_wrapped(after, width)])


def result_line(summary: Summary) -> str:
    """Return how a run came out, for a log."""
    verdicts, figures = [verdict.held for verdict in summary.verdicts], summary.to_dict()
    counts = {"held": verdicts.count(True), "broken": verdicts.count(False), "not judged": verdicts.count(None)}
    counted = ", ".join(f"{count} {name}" for name, count in counts.items() if count) or "none"
    more = [f"{len(figures[key])} {words}" for key, words in FAILINGS.items() if figures[key]]
    if figures["control"]["lateness"]:
        more.append(f"late ticks: {figures['control']['late_ticks']} of {figures['control']['ticks']}")
    if figures["assembled"] is False:
        more.append("not everyone was in its slot when the path began")
    outcome = "; ".join((f"expectations: {counted}", f"safety: {figures['safety']['violations']} violations", *more))
    return f"{'result':<16}  flown to t = {figures['duration_s']:.1f} s; {outcome}"


HELD = {True: "held", False: "not held", None: "nothing judged"}
NOTHING_EXPECTED = "nothing was judged: the scenario has no expect"


def held_text(summary: Summary) -> str:
    """Return in a few words whether a run kept what was expected of it, and of how much that wasn't judged."""
    waiting = sum(verdict.held is None for verdict in summary.verdicts)
    part = f" ({waiting} of {len(summary.verdicts)} not judged)" if waiting and summary.held is not None else ""
    return HELD[summary.held] + part


def spoilt(summary: Summary) -> list[str]:
    """Return the line that says how late ticks spoilt the flight; no line if they didn't."""
    text = summary.to_dict()["control"]["lateness"]
    return [text] if text else []


def unjudged(summary: Summary) -> list[str]:
    """Return the line that says how many expectations weren't judged, and why; no line if all were."""
    reasons = [verdict.reason for verdict in summary.verdicts if verdict.held is None]
    nothing = "nothing was judged: " if len(reasons) == len(summary.verdicts) else ""
    counts = f"{nothing}{len(reasons)} of {counted(len(summary.verdicts), 'expectation')} not judged"
    return [f"{counts} ({'; '.join(dict.fromkeys(reasons))})"] if reasons else []


def _wrapped(lines: Sequence[str], width: int | None) -> list[str]:
    return [part for line in lines for part in wrapped(line, width or WIDE)]


def _verdicts(summary: Summary) -> list[str]:
    """Return a line for each expectation; if there are many, only those that didn't hold, and a count."""
    if len(summary.verdicts) <= MAX_ROWS:
        return [f"expect {verdict}" for verdict in summary.verdicts]
    held, waiting = (sum(verdict.held is state for verdict in summary.verdicts) for state in (True, None))
    others = [f"expect {verdict}" for verdict in summary.verdicts if verdict.held is not True]
    not_judged = f", {waiting} not judged" if waiting else ""
    return [*others[:MAX_ROWS], f"expect: {held} of {len(summary.verdicts)} held{not_judged}"]


def _headline(figures: dict[str, Any]) -> str:
    """Return what was flown and how long it took; the factor counts all simulated seconds."""
    begun_s, wall_s, factor = figures["begun_s"], figures["wall_s"], figures["real_time_factor"]
    flown = "didn't reach its path" if begun_s is None else f"flew {figures['duration_s']:.1f} s of its path"
    before = f" after {begun_s:.1f} s of take-off and assembly" if begun_s else ""
    pace = f"; {factor * wall_s:.1f} s in all, in {wall_s:.1f} s: {factor:.1f} times real time" if factor else ""
    return f"{figures['name']} {flown}{before}{pace}"


def _source(figures: dict[str, Any]) -> str:
    source = "ground truth" if figures["truth"] else "telemetry"
    axes = "|x|, |y|, |z|: forward, right, up (north, east, up in frame north)"
    frame = f"{axes}; max and rms from t = 0 on, steady: from 30 s after settling on"
    return f"formation errors by {source}, m; {frame}" if figures["followers"] else "no vehicle followed"


def _follower_groups(figures: dict[str, Any]) -> list[ColumnGroup]:
    """Return the table's columns. The largest errors are kept longest, then the settling time."""
    shown = dict(list(figures["followers"].items())[:MAX_ROWS])
    axes = {vehicle: [follower[f"error_{axis}_m"] for axis in "xyz"] for vehicle, follower in shown.items()}
    links = [figures["links"][vehicle] for vehicle in shown]
    largest = [(vehicle, *(_number(axis["max"]) for axis in own)) for vehicle, own in axes.items()]
    up_down = [[_number(link[f"measured_{direction}_ms"], 0) for direction in ("up", "down")] for link in links]
    return [
        ColumnGroup(("vehicle", "max x", "y", "z"), largest, keep=4),
        ColumnGroup(
            ("steady x", "y", "z"), [[_number(axis["steady_max"]) for axis in own] for own in axes.values()], keep=2
        ),
        ColumnGroup(("rms x", "y", "z"), [[_number(axis["rms"]) for axis in own] for own in axes.values()], keep=1),
        ColumnGroup(("settled s",), [(_settled(follower),) for follower in shown.values()], keep=3),
        ColumnGroup(("one-way ms",), [(_number(link["measured_delay_ms"]["p50"], 0),) for link in links], keep=2),
        ColumnGroup(("up", "down"), up_down, keep=0),
    ]


def _partly(figures: dict[str, Any]) -> list[str]:
    """Return the share of the time that errors cover, for vehicles that didn't follow all the time."""
    shares = {vehicle: follower["followed_share"] for vehicle, follower in figures["followers"].items()}
    partly = [f"{vehicle} {share:.0%}" for vehicle, share in shares.items() if share is not None and share < WHOLE]
    return [f"errors of a part of the time, in which they followed: {', '.join(partly)}"] if partly else []


def _path(figures: dict[str, Any]) -> list[str]:
    """Return how far the leader and the formation's centre were from the path; nothing if it wasn't begun."""
    words = {"across_m": "across", "along_m": "along", "height_m": "in height"}
    errors = (
        ", ".join(f"{word} {_number(each[name]['rms'])}/{_number(each[name]['max'])}" for name, word in words.items())
        for each in figures["path"].values()
    )
    leader, centre = errors
    begun = figures["path"]["leader"]["across_m"]["rms"] is not None
    return [f"from the path, rms/max m: the leader {leader}; the formation's centre {centre}"] if begun else []


def _safety(figures: dict[str, Any]) -> list[str]:
    """Return what is of the whole flight, take-off and end included, and what of it wasn't seen or doesn't count."""
    safety, control = figures["safety"], figures["control"]
    fence = "" if safety["fence_m"] is None else f", {_number(safety['fence_m'], 1)} m outside the fence"
    pilots = ", ".join(f"vehicle {who} {_number(m, 1)} m" for who, m in safety["outside_by_pilot_m"].items())
    return [
        f"from take-off to the end: least separation {_number(safety['min_separation_m'], 1)} m, clearance "
        f"{_number(safety['min_clearance_m'], 1)} m{fence}, {safety['violations']} violations; "
        f"{control['late_ticks']} of {control['ticks']} ticks late",
        *([f"outside the fence by its pilot or its failsafe, which doesn't count: {pilots}"] if pilots else []),
        *_unseen(safety["unseen_s"]),
    ]


def _unseen(unseen_s: float) -> list[str]:
    return [f"no positions for {unseen_s:.1f} s of the flight: no limit was judged then"] if unseen_s else []


def _settled(follower: dict[str, Any]) -> str:
    """Return when a follower settled, and when it left its slot again."""
    settled, left_s = _number(follower["settled_at_s"], 1), follower["left_at_s"]
    return settled if left_s is None else f"{settled}, left {left_s:.1f}"


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def status_page(station: Station, now: Instant, width: int = WIDTH) -> str:
    """Return phase and time, and each vehicle's errors (slot minus vehicle, m), delays, margin in use and state."""
    return "\n".join([*wrapped(_where(station, now), width), *table(_groups(station), width)])


def _where(station: Station, now: Instant) -> str:
    flight, scenario = station.flight, station.scenario
    mission_s = flight.mission_time_s(now)
    since = "" if math.isnan(mission_s) else f", t = {mission_s:.1f} of {scenario.duration_s:g} s"
    failure = f"; {station.phase_machine.failure}" if station.phase_machine.failure else ""
    return f"{scenario.name}: {flight.phase.value}{since}, {now / NANOSECONDS:.1f} s after the start{failure}"


def _groups(station: Station) -> list[ColumnGroup]:
    """Return the table's columns; errors and states are kept longest."""
    vehicles, tick = station.vehicles, station.last_tick
    errors = [UNKNOWN if tick is None else tick.error_of(each.index) for each in vehicles.values()]
    error_cells = [(str(identity), *_cells(own, 2)) for identity, own in zip(vehicles, errors, strict=True)]
    used = [station.cycle.findings.margin_used[each.index] for each in vehicles.values()]
    up_down = [_cells([1e3 * delay_s for delay_s in each.round_trips.up_down_s], 0) for each in vehicles.values()]
    several = [ColumnGroup(("links ms",), [(_links(each),) for each in vehicles.values()], keep=2)]
    return [
        ColumnGroup(("vehicle", "x", "y", "z"), error_cells, keep=5),
        ColumnGroup(("one-way ms",), [_cells([v.clock.one_way_s * 1e3], 0) for v in vehicles.values()], keep=2),
        *(several if any(each.links for each in vehicles.values()) else ()),
        ColumnGroup(("up", "down"), up_down, keep=1),
        ColumnGroup(
            ("loss",), [(f"{station.cycle.findings.losses[each].whole_loss:.1%}",) for each in vehicles], keep=0
        ),
        ColumnGroup(("margin used",), [(f"{each:.0%}" if math.isfinite(each) else "–",) for each in used], keep=3),
        ColumnGroup(("state",), [(_state(station, vehicle),) for vehicle in vehicles.values()], keep=4),
    ]


def _links(vehicle: Vehicle) -> str:
    """Return the one-way delay of each of a vehicle's links, ms, with a star on the one in use."""
    links = vehicle.links
    if links is None:
        return ""
    delays_ms = [_cells([1e3 * link.clock.one_way_s], 0)[0] for link in links.each]
    each = zip(links.each, delays_ms, strict=True)
    return " ".join(f"{delay}*" if link is links.in_use else delay for link, delay in each)


def _state(station: Station, vehicle: Vehicle) -> str:
    """Return a vehicle's state: its link if that isn't connected, else its start-up, its lead, or its membership."""
    tick, link = station.last_tick, vehicle.connection.state
    if link is not LinkState.CONNECTED:
        return f"link {link.value}"
    if not vehicle.start_up.finished:
        return vehicle.start_up.doing
    leads = tick is not None and tick.leader == vehicle.index
    return "leads" if leads and vehicle.member is Member.FLYING else SHORT[vehicle.member]


def _cells(values: Array | Sequence[float], digits: int) -> tuple[str, ...]:
    return tuple(f"{value:.{digits}f}" if math.isfinite(value) else "–" for value in values)
