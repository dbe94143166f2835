"""The inputs of a run's summary, and the verdicts on its scenario's `expect`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from airlink.endpoint import VehicleId
from airlink.stream_parser import ParserCounts
from flight_model.arrays import Array, Mask
from formation_scenario import Scenario
from formation_scenario.expectation import (
    FOLLOWER_METRICS,
    LATE_PERIODS,
    LIMIT_METRICS,
    LINK_METRICS,
    METRICS,
    PATH_METRICS,
    UNJUDGED_GAP_S,
    Expectation,
    stays_broken,
)
from gcs_formation.errors import RunAbortedError
from gcs_formation.record import figures_of_merit as figures
from gcs_formation.record import path_distance
from gcs_formation.record.coverage import Coverage, coverage
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.link_verdicts import LinkFigures, as_answered, is_out, link_verdict
from gcs_formation.record.outside_metric import measured
from gcs_formation.record.safety import value_within
from gcs_formation.record.verdict import ROUNDING_S, Verdict, weighed

FAILINGS = {"unsafe": "left unsafe", "undone": "not done as planned"}
"""Lists of summary.json that make the exit status 1 if they aren't empty, in words."""
SECTIONS = ("safety", "control", "stability")
LEADERLESS_S = 5.0
"""Time without a leader that isn't a loss: it takes 3.1 s until another takes over."""
ABSENT_S = 1.0
"""Shorter absences of a follower from the formation aren't mentioned."""


@dataclass(frozen=True)
class RunOutcome:
    """Everything that a summary is made from."""

    scenario: Scenario
    clock: str
    flight: RecordedFlight
    links: Mapping[VehicleId, LinkFigures]
    ticks_s: Array
    """(3, K) when ticks were due and when they began, on the run's clock, and how long they took, in real time."""
    delay_margin_s: float | None
    worst_loop_delay_s: float | None
    margin_used: float
    """Largest share of the delay margin that a loop used."""
    received: ParserCounts
    """Counts of everything received, also from other senders."""
    frames_refused: int
    """Valid frames that weren't accepted as a vehicle's."""
    simulated_s: float
    wall_s: float
    cut_short: bool
    """Whether the run was ended (`--until`, an order, Ctrl-C) before its path or time was over."""
    assembled: bool | None = None
    """Whether every follower was in its slot when the path began; None if it didn't begin, or if that is unknown."""
    undone: tuple[str, ...] = ()
    """What the scenario planned and the flight didn't carry out, in words."""
    unsafe: tuple[str, ...] = ()
    """What the run left unsafe at its end, in words."""
    flying_on: Mapping[VehicleId, str] = field(default_factory=dict)
    """Vehicles that were left without setpoints and fly on, in words."""
    not_landed: Mapping[VehicleId, str | None] | None = None
    """Of each vehicle None if it has landed, otherwise why not; None if none was to land at the end."""
    features: tuple[str, ...] | None = None
    """Names of the features that the station flew with; None if that is unknown."""
    failure: str | None = None
    """Why the run failed after the flight."""
    measure: tuple[Expectation, ...] = ()
    """Further figures to compute, regardless of their bounds."""


def judge(
    scenario: Scenario,
    flight: RecordedFlight,
    parts: Mapping[str, Any],
    links: Mapping[VehicleId, LinkFigures],
    cut_short: bool,
    wanted: Sequence[Expectation] | None = None,
) -> Iterator[Verdict]:
    """Yield a verdict for each expectation, by default the scenario's; for followers or links, one for each of them.

    An expectation whose window the flight's own end cut short by more than `UNJUDGED_GAP_S`, or in which the follower
    was lost, is broken: it wasn't shown. Otherwise it isn't judged if too little of its window was (`coverage`):
    because the run was `cut_short` before its path or time was over, because ticks are missing, because the follower
    led or was absent, or crashed by the scenario's faults (unless no follower is left). What broke the bound in the
    part that was judged is broken all the same.
    """
    for each in scenario.expect if wanted is None else wanted:
        plain = _of_window(each, scenario, flight, cut_short=cut_short)
        if each.metric in FOLLOWER_METRICS:
            yield from _of_followers(plain, scenario, flight, parts)
        elif each.metric in LINK_METRICS:
            for planned in scenario.selected(each.followers):
                link, end_s = links[planned.vehicle_id], min(each.to_s, float(parts["duration_s"]))
                value = _link_value(each, planned.vehicle_id, flight, parts, links)
                verdict = weighed(replace(plain, vehicle=planned.vehicle_id, value=value))
                out = is_out(scenario, planned, end_s, either=True)
                yield as_answered(link_verdict(verdict, link, end_s, out=out), link)
        else:
            own = each.metric not in METRICS
            yield (
                _of_extension(plain, scenario, flight)
                if own
                else weighed(replace(plain, value=_run_value(each, flight, parts)))
            )


def _of_extension(plain: Verdict, scenario: Scenario, flight: RecordedFlight) -> Verdict:
    """Return the verdict on a metric from outside; one that raises an error isn't judged, and fails the flight."""
    try:
        return weighed(replace(plain, value=measured(plain.expectation, scenario, flight)))
    except RunAbortedError as error:
        return replace(plain, judged=False, reason=str(error), failed=True)


def _of_window(wanted: Expectation, scenario: Scenario, flight: RecordedFlight, *, cut_short: bool) -> Verdict:
    """Return what holds for all whom an expectation concerns: which part of its window was flown, and is recorded."""
    found, period_s = covered(flight, wanted.from_s, wanted.to_s, scenario), 1.0 / scenario.law.rate_hz
    down_s = flight.down_from_s(wanted.from_s, wanted.to_s)
    if down_s is not None:
        return Verdict(wanted, None, None, reached=False, reason=none_flew(down_s), share=found.share)
    end_s = max(0.0, flight.scored_end_s(scenario.duration_s, period_s))
    short = wanted.to_s - end_s > UNJUDGED_GAP_S + ROUNDING_S
    reason = f"flown to {end_s:.1f} s of {wanted.to_s:g} s" if short else str(found)
    reached = not short or (cut_short and found.enough)
    return Verdict(wanted, None, None, reached, True, reason, share=found.share, cut=short and cut_short)


def covered(flight: RecordedFlight, from_s: float, to_s: float, scenario: Scenario) -> Coverage:
    """Return which part of a window of mission time is on record."""
    return coverage(flight.mission_time_s[flight.window(from_s, to_s)], from_s, to_s, 1.0 / scenario.law.rate_hz)


def none_flew(down_s: float) -> str:
    """Return in words since when no vehicle flew."""
    return f"none flew from {down_s:.1f} s on"


def _of_followers(
    plain: Verdict, scenario: Scenario, flight: RecordedFlight, parts: Mapping[str, Any]
) -> Iterator[Verdict]:
    """Yield a verdict for each follower that the expectation chooses.

    Args:
        plain: the expectation with what holds for all of them.
        scenario: the scenario that was flown.
        flight: the flight.
        parts: the summary so far.
    """
    wanted, period_s = plain.expectation, 1.0 / scenario.law.rate_hz
    down = flight.down_from_s(wanted.from_s, wanted.to_s) is not None
    chosen = {planned.vehicle_id for planned in scenario.selected(wanted.followers)}
    lost = {vehicle: _lost_at_s(wanted, flight, vehicle, period_s) for vehicle in flight.followers(scenario)}
    for vehicle, lost_s in lost.items():
        if vehicle not in chosen:
            continue
        verdict = _followed(replace(plain, vehicle=vehicle), flight, period_s)
        verdict = replace(verdict, value=_follower_value(wanted, flight, vehicle, parts))
        if lost_s is None:
            yield weighed(_steadied(verdict, parts))
            continue
        crash_s = math.inf if down else crash_planned_s(scenario, vehicle)
        broken = crash_s <= lost_s and _broken_before(crash_s, wanted, flight, vehicle, parts, verdict.share)
        reason = plain.reason if down else f"lost at {lost_s:.1f} s"
        verdict = replace(verdict, reached=False, judged=True, reason=reason, lost=True)
        last = None not in lost.values()
        yield _crashed(verdict, crash_s, broken=broken, last=last) if crash_s <= lost_s else verdict


def _followed(verdict: Verdict, flight: RecordedFlight, period_s: float) -> Verdict:
    """Return a verdict with the part of its window in which a vehicle followed, and why it isn't all of it."""
    wanted, vehicle = verdict.expectation, verdict.vehicle
    assert vehicle is not None, "a follower's"
    window = flight.window(wanted.from_s, wanted.to_s)
    leads, known = window & flight.leads(vehicle), window & flight.known(vehicle)
    own = coverage(flight.mission_time_s[leads | known], wanted.from_s, wanted.to_s, period_s)
    follows = float(known.sum()) / max(1.0, float((leads | known).sum()))  # leading isn't a gap, however short
    share, away = min(verdict.share, own.share * follows), _absence(flight, vehicle, window, period_s)
    led = "led all the time" if leads.sum() == window.sum() else f"led for {leads.sum() * period_s:.1f} s"
    reason = "; ".join(filter(None, (verdict.reason, led if leads.any() else "", away)))
    return replace(verdict, share=share, reason=reason or ("" if share >= verdict.share else str(own)))


def _steadied(verdict: Verdict, parts: Mapping[str, Any]) -> Verdict:
    """Return a verdict that isn't judged if late ticks hide the little of steady flight that there was."""
    wanted = verdict.expectation
    settled_s = parts["followers"][str(verdict.vehicle)]["settled_at_s"]
    if verdict.value is not None or settled_s is None or not wanted.metric.endswith("steady_max"):
        return verdict
    steady_s, end_s = settled_s + figures.STEADY_AFTER_S, min(wanted.to_s, float(parts["duration_s"]))
    hidden = wanted.from_s <= steady_s <= end_s
    return replace(verdict, judged=False, reason=f"no tick from {steady_s:.1f} s on") if hidden else verdict


def _crashed(verdict: Verdict, crash_s: float, *, broken: bool, last: bool) -> Verdict:
    """Return the verdict of a follower that crashed by the scenario's faults.

    `broken`: a bound had already been broken for good; `last`: no follower is left.
    """
    reason = f"crashed at {crash_s:.1f} s"
    if last:
        return replace(verdict, judged=True, reason=f"{reason}, and no other follows")
    return replace(verdict, judged=broken, reason=f"before it {reason}" if broken else reason)


def _absence(flight: RecordedFlight, vehicle: VehicleId, window: Mask, period_s: float) -> str:
    """Return in words how long a follower was absent from the formation within a window, "" if it hardly was."""
    away_s = flight.absent(vehicle, window) * period_s
    return f"out of the formation for {away_s:.1f} s of {window.sum() * period_s:.1f} s" if away_s >= ABSENT_S else ""


def _lost_at_s(wanted: Expectation, flight: RecordedFlight, vehicle: VehicleId, period_s: float) -> float | None:
    """Return since when a follower was down or leaderless until the end of the window; None if it wasn't.

    A follower in flight is leaderless from `LEADERLESS_S` on: until then another may take over. If another vehicle has
    succeeded the leader meanwhile, the time begins with the follower's own loss. At a single tick it isn't lost, unless
    it still is at the next one, also after the window: the ticks between may be late.
    """
    within = flight.window(wanted.from_s, wanted.to_s)
    if not flight.missed(vehicle, within) or (flight.missed(vehicle, within) == 1 and flight.is_back(vehicle, within)):
        return None
    window = flight.window(0.0, wanted.to_s)
    missed = flight.missed(vehicle, window)
    times_s = flight.mission_time_s[window]
    late = wanted.to_s - times_s[-1] > LATE_PERIODS * period_s and not flight.ends_with(window)
    lasted_s = (wanted.to_s if late else times_s[-1] + period_s) - times_s[-missed]
    if flight.airborne(vehicle)[within][-1:].any() and lasted_s <= LEADERLESS_S + ROUNDING_S:
        return None
    led = ~flight.leaderless(window)[-missed:]
    return float(times_s[-missed:][led.argmax()])


def crash_planned_s(scenario: Scenario, vehicle: VehicleId) -> float:
    """Return the mission time at which the scenario's faults crash a vehicle; infinity if they don't."""
    crashes = (fault for fault in scenario.faults if scenario.crashes(fault))
    hits = ((each.at_s, scenario.selected(each.vehicles)) for each in crashes)
    return min((at_s for at_s, hit in hits if vehicle in {each.vehicle_id for each in hit}), default=math.inf)


def _follower_value(
    wanted: Expectation, flight: RecordedFlight, vehicle: VehicleId, parts: Mapping[str, Any]
) -> float | None:
    """Return a follower's figure over the window; its settling time, also for `steady_max`, is of the whole run."""
    settled_s = parts["followers"][str(vehicle)]["settled_at_s"]
    window = flight.window(wanted.from_s, wanted.to_s)
    return figure_of(figures.of_follower(flight, vehicle, window, settled_s), wanted.metric)


def _broken_before(
    end_s: float,
    wanted: Expectation,
    flight: RecordedFlight,
    vehicle: VehicleId,
    parts: Mapping[str, Any],
    share: float,
) -> bool:
    """Return whether a follower broke a bound for good before a mission time, after a share of the window."""
    value = _follower_value(wanted.model_copy(update={"to_s": end_s}), flight, vehicle, parts)
    return stays_broken(wanted.metric, value, wanted.below, wanted.above, share)


def _link_value(
    wanted: Expectation,
    vehicle: VehicleId,
    flight: RecordedFlight,
    parts: Mapping[str, Any],
    links: Mapping[VehicleId, LinkFigures],
) -> float | None:
    """Return a figure of a link; None if nothing was received over it, or within the window for windowed figures."""
    name, _, percentile = wanted.metric.partition(".p")
    link = links[vehicle]
    if not percentile:
        return parts["links"][str(vehicle)][name] if link.frames_in else None
    values_s = link.one_way_s[(link.delay_times_s >= wanted.from_s) & (link.delay_times_s <= wanted.to_s)]
    if name == "jitter_ms" and values_s.size:
        values_s = flight.vehicles[vehicle]["jitter_s"][flight.window(wanted.from_s, wanted.to_s)]
    return figures.percentiles(values_s * 1e3, int(percentile))[f"p{percentile}"]


def _run_value(wanted: Expectation, flight: RecordedFlight, parts: Mapping[str, Any]) -> float | None:
    if wanted.metric in LIMIT_METRICS:
        return value_within(flight, wanted.metric, wanted.from_s, wanted.to_s)
    if wanted.metric in PATH_METRICS and flight.off_path is not None:
        who, name = PATH_METRICS[wanted.metric]
        within = flight.window(wanted.from_s, wanted.to_s)
        return figure_of(path_distance.figures(flight.off_path[who], within), name)
    return figure_of_run(parts, wanted.metric)


def figure_of_run(summary: Mapping[str, Any], metric: str) -> float | None:
    """Return a figure of the whole run from summary.json or one of its sections; None if it isn't there."""
    if metric in PATH_METRICS:
        who, name = PATH_METRICS[metric]
        return figure_of(summary["path"], f"{who}.{name}") if "path" in summary else None
    sections = [summary, *(summary[section] for section in SECTIONS)]
    return next((figure_of(each, metric) for each in sections if metric.partition(".")[0] in each), None)


def figure_of(part: Mapping[str, Any], metric: str) -> Any:  # noqa: ANN401 - a value of JSON
    """Return a figure from a part of summary.json by its dotted name; None if a part on the way is None."""
    value: Any = part
    for name in metric.split("."):
        value = value[name] if value is not None else None
    return value
