"""The figures of a survey, and a file of each link's delays by time, which scenarios play."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from flight_model.arrays import Array
from gcs_formation.errors import RecordError
from gcs_formation.link_survey.measured_link import MeasuredLink
from gcs_formation.link_survey.survey import LinkSurvey

SPREAD: Final = ("mean", "jitter", "p50", "p95", "p99", "max")
FEWEST: Final = 20
"""Answers from which on a delay's distribution is given."""
SKEWED: Final = 1.0
"""Skewness from which on delays are taken as Pareto-distributed: normal and uniform ones have none."""
FLAT: Final = 2.3
"""Kurtosis below which they are taken as uniform: of these it is 1.8, of normal ones 3."""
TRACE: Final = ("t_s", "rtt_ms", "up_ms", "down_ms")
"""Columns of a trace; rows of lost requests have a time alone."""
SPLIT: Final = "taken as equal: round trips don't tell"


def figures(survey: LinkSurvey, now: Instant) -> dict[str, Any]:
    """Return everything that a survey found, by vehicle, as JSON."""
    systems = [system for _, system in survey.links]
    vehicles = dict[str, Any]()
    for (socket, system), link in sorted(survey.links.items()):
        name = str(system) if systems.count(system) == 1 else f"{system}@{link.endpoint}"
        vehicles[name] = _vehicle(survey, (socket, system), link, now)
    return {
        "schema": 1,
        "duration_s": round(now / NANOSECONDS, 3),
        "endpoints": [str(each) for each in survey.endpoints()],
        "vehicles": vehicles,
    }


def _vehicle(survey: LinkSurvey, key: tuple[int, int], link: MeasuredLink, now: Instant) -> dict[str, Any]:
    _, trips_s, up_s, down_s = link.delays_s(min(now, survey.until))
    lost = _losses(link, trips_s)
    probed = None if survey.load is None else survey.load.carried_kbps(key, lost["loss"]["round_trip"])
    return {
        "endpoint": link.endpoint,
        "answering_period_ms": 1e3 * link.answering_s,
        "requests": link.requests,
        "answers": link.answers,
        "delay_ms": {"round_trip": _spread(trips_s), "up": _spread(up_s), "down": _spread(down_s), "split": SPLIT},
        **lost,
        "rate_kbps": {"up": _rates(link.bytes_up, link), "down": _rates(link.bytes_down, link)},
        "capacity_kbps": None if probed is None else {"each_way": probed[0], "full_above": probed[1]},
        "radio": survey.radios[key[0]].figures(),
        "clock": _clock(link),
        "restarts": link.restarts,
    }


def _spread(delays_s: Array) -> dict[str, Any]:
    """Return mean, standard deviation and percentiles of delays, ms."""
    known = 1e3 * np.maximum(0.0, delays_s[~np.isnan(delays_s)])
    if known.size < FEWEST:
        return dict.fromkeys((*SPREAD, "like", "correlation"))
    p50, p95, p99 = np.percentile(known, (50, 95, 99))
    found = (np.mean(known), np.std(known), p50, p95, p99, np.max(known))
    figures = {name: round(float(each), 3) for name, each in zip(SPREAD, found, strict=True)}
    return figures | {"like": _like(known), "correlation": _figure(_correlation(delays_s), 3)}


def _correlation(delays_s: Array) -> float:
    """Return the correlation of successive delays: 0 of jitter, near 1 in a queue; NaN if they don't vary."""
    both = ~np.isnan(delays_s[:-1]) & ~np.isnan(delays_s[1:])
    before_s, then_s = delays_s[:-1][both], delays_s[1:][both]
    if before_s.size < FEWEST or np.std(before_s) == 0.0 or np.std(then_s) == 0.0:
        return math.nan
    return float(np.corrcoef(before_s, then_s)[0, 1])


def _like(delays_ms: Array) -> str:
    """Return the distribution of the scenario's keys that delays are most like, by skewness and kurtosis."""
    off = delays_ms - np.mean(delays_ms)
    scale = float(np.std(off)) or 1.0
    skewness, kurtosis = float(np.mean((off / scale) ** 3)), float(np.mean((off / scale) ** 4))
    if skewness > SKEWED:
        return "pareto"
    return "uniform" if 0.0 < kurtosis < FLAT else "normal"


def _losses(link: MeasuredLink, trips_s: Array) -> dict[str, Any]:
    """Return the loss of each direction, and how many were lost in a row.

    Down it is counted by sequence numbers, which a filtering router breaks; up it is what is missing of round trips.
    """
    sequence = link.sequence
    gone, came = float(sequence.lost + sequence.missed), float(sequence.received)
    down = gone / (gone + came) if came else math.nan
    unanswered = np.isnan(trips_s)
    both = float(np.mean(unanswered)) if unanswered.size else math.nan
    up = max(0.0, 1.0 - (1.0 - both) / (1.0 - down)) if down < 1.0 else math.nan
    loss = {"up": up, "down": down, "round_trip": both}
    bursts = {"down": _bursts(link.bursts), "round_trip": _bursts(_runs(unanswered))}
    return {"loss": {name: _figure(each, 5) for name, each in loss.items()}, "bursts": bursts}


def _runs(lost: np.ndarray[Any, Any]) -> list[int]:
    """Return the lengths of the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], lost, [False])).astype(int)))
    return [int(each) for each in edges[1::2] - edges[::2]]


def _bursts(lengths: list[int]) -> dict[str, float | int]:
    mean = sum(lengths) / len(lengths) if lengths else 0.0
    return {"count": len(lengths), "mean": round(mean, 3), "longest": max(lengths, default=0)}


def _rates(octets: Mapping[int, int], link: MeasuredLink) -> dict[str, float]:
    """Return what went over the link, kbit/s: over the time in which it was received, and in the busiest second."""
    total = sum(octets.values())
    return {
        "mean": round(8e-3 * total / max(1.0, link.received_s()), 2),
        "peak": round(8e-3 * max(octets.values(), default=0), 2),
    }


def _clock(link: MeasuredLink) -> dict[str, float | None]:
    clock = link.clock
    return {
        "offset_s": _figure(clock.offset_s, 6),
        "offset_deviation_ms": _figure(1e3 * clock.offset_deviation_s, 4),
        "drift_ppm": _figure(1e6 * clock.drift, 3),
        "drift_deviation_ppm": _figure(1e6 * clock.drift_deviation, 3),
    }


def _figure(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None


def trace(link: MeasuredLink, loss: Mapping[str, float | None], until: Instant) -> str:
    """Return the delays of a link by time, as CSV; an empty cell is a loss.

    In which direction a request or its answer was lost isn't known: runs of losses are shared by both as these lose.
    """
    sent_s, trips_s, up_s, down_s = link.delays_s(until)
    lost_up = _lost_up(np.isnan(trips_s), loss)
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(TRACE)
    began_s, last = (float(sent_s[0]) if sent_s.size else 0.0), ("", "")
    for at_s, up, *delays_s in zip(sent_s.tolist(), lost_up, trips_s, up_s, down_s, strict=True):
        trip, *up_down = ("" if math.isnan(each) else f"{max(0.0, 1e3 * each):.3f}" for each in delays_s)
        if trip:
            last = (up_down[0], up_down[1])
        else:  # the other direction, of which nothing is known then, is taken to be as before
            up_down = ["", last[1]] if up else [last[0], ""]
        rows.writerow([f"{at_s - began_s:.4f}", trip, *up_down])
    return text.getvalue()


def _lost_up(lost: np.ndarray[Any, Any], loss: Mapping[str, float | None]) -> list[bool]:
    """Return which of the losses count as lost up: runs of them, as many as is that direction's share."""
    up, down = loss["up"] or 0.0, loss["down"] or 0.0
    share, owed, before, found = up / (up + down) if up + down else 0.5, 0.0, False, list[bool]()
    counts_up = False
    for each in lost.tolist():
        if each and not before:
            counts_up = owed + share >= 0.5
        if each:
            owed += share - counts_up
        found.append(each and counts_up)
        before = each
    return found


def write(text: str, path: Path) -> None:
    """Write a file.

    Raises:
        RecordError: it can't be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write {path}: {error.strerror}; allowed: a writable directory") from error
