"""The inputs of a run's summary, and the verdicts on its scenario's `expect`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from airlink.endpoint import VehicleId
from airlink.frame import ParserCounts
from flight_model.arrays import Array
from formation_scenario import Scenario, Vehicle
from formation_scenario.expectation import (
    FOLLOWER_METRICS,
    LINK_METRICS,
    WINDOWED,
    Expectation,
    bounds_text,
    keeps,
    stays_broken,
)
from gcs_formation.record import figures_of_merit as figures
from gcs_formation.record.flight import RecordedFlight

WORDS = {True: "held", False: "broken", None: "not judged"}
FAILINGS = {"unsafe": "left unsafe", "undone": "not done as planned"}
"""Lists of summary.json that make the exit status 1 if they aren't empty, in words."""
SECTIONS = ("safety", "control", "stability")
UNANSWERED_S = 10.0
"""A longer time without answers at a window's end is a time without measured delays."""
LEADERLESS_S = 5.0
"""Time without a leader that isn't a loss: it takes 3.1 s until another takes over."""
ABSENT_S = 1.0
"""Shorter absences of a follower from the formation aren't mentioned."""


@dataclass(frozen=True)
class LinkFigures:
    """Counts and delays (s) of one vehicle's link."""

    delays_s: Array
    """(P, 3) delays of each answered request: half the round trip, up, down; NaN while the split is unknown."""
    delay_times_s: Array
    """Mission times of the requests, NaN before the path began."""
    measured_loss: float
    frames_in: int
    frames_out: int
    frames_bad: int
    frames_implausible: int = 0
    frames_duplicate: int = 0
    frames_late: int = 0
    injected: tuple[float, float, float, float] | None = None
    """Realised mean delays up and down, s, and shares of the datagrams lost up and down.

    None if the link's impairments are unknown, as in `fly` behind something else.
    """
    due_to_s: float = math.inf
    """Mission time at which a planned fault silenced the vehicle for the rest of the flight; infinite if none did."""
    heard_to_s: float = math.inf
    """Mission time of its last frame if it was silent at the flight's end; infinite if it wasn't."""

    def answered_to_s(self, end_s: float) -> float:
        """Return the mission time of the last answered request before `end_s`; infinite if that isn't long before."""
        last_s = float(np.max(self.delay_times_s, where=self.delay_times_s <= end_s, initial=-math.inf))
        return last_s if end_s - last_s > UNANSWERED_S else math.inf

    @property
    def each_way_s(self) -> Array:
        """(P,) the one-way delays, at least 0: the mean wait for the autopilot's loop may exceed the measured delay."""
        return np.maximum(self.delays_s[:, 0], 0.0)


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
    failure: str | None = None
    """Why the run failed after the flight."""
    measure: tuple[Expectation, ...] = ()
    """Further figures to compute, regardless of their bounds."""


@dataclass(frozen=True)
class Verdict:
    """The result of one expectation for one vehicle, or for the run (None)."""

    expectation: Expectation
    vehicle: VehicleId | None
    value: float | None
    """Infinite for the separation of a single vehicle, which is null in summary.json."""
    reached: bool = True
    """Whether the window was flown to its end, and by this follower."""
    judged: bool = True
    """False if `--until` or an order cut the window, or if the vehicle led throughout it."""
    reason: str = ""
    """Why the window wasn't reached or isn't judged, in words."""
    lost: bool = False
    """Whether this follower was lost, or its link silent, before the window's or the flight's end."""

    @property
    def held(self) -> bool | None:
        """Whether the bound was kept over a window flown to its end; None if that isn't judged."""
        if not self.judged:
            return None
        if self.value is None or not self.reached:
            return False
        return keeps(self.value, self.expectation.below, self.expectation.above)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of summary.json."""
        wanted = self.expectation
        entry: dict[str, Any] = {"metric": wanted.metric}
        if self.vehicle is not None:
            entry["follower"] = self.vehicle.system if self.vehicle.network == 1 else str(self.vehicle)
        known = self.value is not None and math.isfinite(self.value)
        entry |= {"value": self.value if known else None, "from_s": wanted.from_s, "to_s": wanted.to_s}
        entry |= {name: bound for name in ("below", "above") if (bound := getattr(wanted, name)) is not None}
        entry |= {"held": self.held, "judged": self.judged, "reached": self.reached}
        return entry | ({"reason": self.reason} if self.reason else {})

    def __str__(self) -> str:
        wanted = self.expectation
        who = f"vehicle {self.vehicle}: " if self.vehicle else ""
        found = "no value" if self.value is None else f"{self.value:.4g}"
        state = WORDS[self.held] + (f": {self.reason}" if self.reason else "")
        window = f"from {wanted.from_s:g} s to {wanted.to_s:g} s"
        expected = bounds_text(wanted.below, wanted.above)
        return f"{who}{wanted.metric} {window}: found {found}; expected: {expected}: {state}"


def judge(
    scenario: Scenario,
    flight: RecordedFlight,
    parts: Mapping[str, Any],
    links: Mapping[VehicleId, LinkFigures],
    cut_short: bool,
    wanted: Sequence[Expectation] | None = None,
) -> Iterator[Verdict]:
    """Yield a verdict for each expectation, by default the scenario's; for followers or links, one for each of them.

    An expectation whose window wasn't flown to its end, or in which the follower was lost, is broken: it wasn't shown.
    It isn't judged if that was intended: if the run was `cut_short` before its path or time was over, or if the
    follower crashed by the scenario's faults, unless no follower is left or a bound on its largest error had already
    been broken.
    """
    for each in scenario.expect if wanted is None else wanted:
        flown_s = float(parts["duration_s"])
        reached = flown_s + 1.5 / scenario.law.rate_hz >= each.to_s
        why = "" if reached else f"flown to {flown_s:.1f} s of {each.to_s:g} s"
        judged = reached or not cut_short
        down_s, missing = flight.down_from_s(each.from_s, each.to_s), unflown(flight, each.from_s, each.to_s, flown_s)
        if missing:
            reached, judged, why = False, True, missing
        if each.metric in FOLLOWER_METRICS:
            plain = Verdict(each, None, None, reached, judged, why)
            yield from _of_followers(plain, scenario, flight, parts, down=down_s is not None)
        elif each.metric in LINK_METRICS:
            for planned in scenario.selected(each.followers):
                value = _link_value(each, planned.vehicle_id, flight, parts, links)
                verdict = Verdict(each, planned.vehicle_id, value, reached, judged, why)
                end_s = min(each.to_s, flown_s)
                out = is_out(scenario, planned, end_s, either=True)
                yield _link_verdict(verdict, links[planned.vehicle_id], end_s, out=out)
        else:
            yield Verdict(each, None, _run_value(each, flight, parts), reached, judged, why)


def is_out(scenario: Scenario, vehicle: Vehicle, at_s: float, *, either: bool = False) -> bool:
    """Return whether by the scenario nothing comes down a vehicle's link, or passes `either` way, at a mission time."""
    step = [each for each in scenario.link_steps(vehicle) if each.at_s <= at_s][-1]
    ways = (step.downlink, step.uplink) if either else (step.downlink,)
    return any(way.outage or way.loss == 1.0 or step.at_s + way.delay_ms / 1e3 > at_s for way in ways)


def _of_followers(
    plain: Verdict, scenario: Scenario, flight: RecordedFlight, parts: Mapping[str, Any], *, down: bool
) -> Iterator[Verdict]:
    """Yield a verdict for each follower that the expectation chooses.

    Args:
        plain: the expectation with what holds for all of them: whether its window was flown to its end, and is judged.
        scenario: the scenario that was flown.
        flight: the flight.
        parts: the summary so far.
        down: whether no vehicle flies any more at the window's end.
    """
    wanted = plain.expectation
    chosen = {planned.vehicle_id for planned in scenario.selected(wanted.followers)}
    rate_hz = scenario.law.rate_hz
    lost = {vehicle: _lost_at_s(wanted, flight, vehicle, rate_hz) for vehicle in flight.followers(scenario)}
    for vehicle, lost_s in lost.items():
        if vehicle not in chosen:
            continue
        verdict = replace(plain, vehicle=vehicle, value=_follower_value(wanted, flight, vehicle, parts))
        if _leads_throughout(wanted, flight, vehicle):
            verdict = replace(verdict, judged=False, reason="led all the time")
        elif lost_s is not None:
            crash_s = math.inf if down else crash_planned_s(scenario, vehicle)
            crashed = crash_s <= lost_s
            broken = crashed and plain.judged and _broken_before(crash_s, wanted, flight, vehicle, parts)
            said = plain.reason if down else f"lost at {lost_s:.1f} s"
            verdict = replace(verdict, reached=False, judged=True, reason=said, lost=True)
            if crashed:
                verdict = _crashed(verdict, crash_s, broken=broken, last=None not in lost.values())
        elif not plain.reason:
            verdict = replace(verdict, reason=_absence(wanted, flight, vehicle, rate_hz))
        yield verdict


def _crashed(verdict: Verdict, crash_s: float, *, broken: bool, last: bool) -> Verdict:
    """Return the verdict of a follower that crashed by the scenario's faults.

    `broken`: a bound had already been broken for good; `last`: no follower is left.
    """
    reason = f"crashed at {crash_s:.1f} s"
    if last:
        return replace(verdict, judged=True, reason=f"{reason}, and nobody else follows")
    return replace(verdict, judged=broken, reason=f"before it {reason}" if broken else reason)


def _link_verdict(verdict: Verdict, link: LinkFigures, end_s: float, *, out: bool) -> Verdict:
    """Return the verdict on a link, changed if its vehicle fell silent for good before `end_s`.

    If the scenario silenced it, the link isn't judged, unless it had broken a bound before. If it fell silent by
    itself, a metric over a window is broken, as nothing was measured; one of the whole flight stands, because it counts
    the silence. A vehicle that doesn't hear is silent as to delays: it answers no request.

    Args:
        verdict: by the figures alone.
        link: when the vehicle was silenced by a fault, and when it was last heard and last answered.
        end_s: the end of the window, or of the flight if that came first.
        out: whether the scenario has an outage of the link then.
    """
    windowed, fault = verdict.expectation.metric in WINDOWED, link.due_to_s < end_s
    needs_answers = verdict.expectation.metric.startswith("measured_delay")
    silent_s = min(link.due_to_s, link.heard_to_s, link.answered_to_s(end_s) if needs_answers else math.inf)
    if verdict.held is None or silent_s >= end_s:
        return verdict
    state = "silenced" if min(link.due_to_s, link.heard_to_s) < end_s else "cut off"
    if fault or (out and windowed):
        at_s, whose = (link.due_to_s, "faults") if fault else (silent_s, "links")
        reason = f"{state} at {at_s:.1f} s by the scenario's {whose}"
        known = verdict.value is not None and verdict.held is False
        said = f"before it was {reason}" if known else reason
        return replace(verdict, reached=False, judged=known, reason=said, lost=True)
    why = "not heard" if state == "silenced" else "no answer"
    reached, said = verdict.reached and not windowed, f"{why} from {silent_s:.1f} s on"
    return replace(verdict, reached=reached, reason=said, lost=windowed)


def _absence(wanted: Expectation, flight: RecordedFlight, vehicle: VehicleId, rate_hz: float) -> str:
    """Return in words how long a follower was absent from the formation within a window before returning, else ""."""
    window = flight.window(wanted.from_s, wanted.to_s)
    away_s = flight.absent(vehicle, window) / rate_hz
    return f"out of the formation for {away_s:.1f} s of {window.sum() / rate_hz:.1f} s" if away_s >= ABSENT_S else ""


def unflown(flight: RecordedFlight, from_s: float, to_s: float, flown_s: float) -> str:
    """Return in words for which part of a window of mission time there is no flight on record, "" if there is none.

    `flown_s`: when the flight ended, which may be before the window's end.
    """
    down_s, gap_s = flight.down_from_s(from_s, to_s), flight.gap(from_s, min(to_s, flown_s))
    if down_s is not None:
        return f"nobody flew from {down_s:.1f} s on"
    return "" if gap_s is None else f"not recorded from {gap_s[0]:.1f} s to {gap_s[1]:.1f} s"


def _leads_throughout(wanted: Expectation, flight: RecordedFlight, vehicle: VehicleId) -> bool:
    leads = flight.vehicles[vehicle]["leads"][flight.window(wanted.from_s, wanted.to_s)] > 0
    return bool(leads.size and leads.all())


def _lost_at_s(wanted: Expectation, flight: RecordedFlight, vehicle: VehicleId, rate_hz: float) -> float | None:
    """Return since when a follower was down or leaderless until the end of the window; None if it wasn't.

    A follower in flight is leaderless from `LEADERLESS_S` on: until then another may take over. If another vehicle has
    succeeded the leader meanwhile, the time begins with the follower's own loss.
    """
    within = flight.window(wanted.from_s, wanted.to_s)
    missed = flight.missed(vehicle, within)
    flies = flight.airborne(vehicle)[within][-1:].any()
    if missed <= 1 or (flies and flight.missed(vehicle, flight.window(0.0, wanted.to_s)) <= LEADERLESS_S * rate_hz):
        return None
    window = flight.window(0.0, wanted.to_s)
    missed = flight.missed(vehicle, window)
    led = ~flight.leaderless(window)[-missed:]
    return float(flight.mission_time_s[window][-missed:][led.argmax()])


def crash_planned_s(scenario: Scenario, vehicle: VehicleId) -> float:
    """Return the mission time at which the scenario's faults crash a vehicle; infinity if they don't."""
    crashes = (fault for fault in scenario.faults if fault.kind == "crash")
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
    end_s: float, wanted: Expectation, flight: RecordedFlight, vehicle: VehicleId, parts: Mapping[str, Any]
) -> bool:
    """Return whether a follower broke a bound for good before a mission time."""
    value = _follower_value(wanted.model_copy(update={"to_s": end_s}), flight, vehicle, parts)
    return stays_broken(wanted.metric, value, wanted.below)


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
    values_s = link.each_way_s[(link.delay_times_s >= wanted.from_s) & (link.delay_times_s <= wanted.to_s)]
    if name == "jitter_ms" and values_s.size:
        values_s = flight.vehicles[vehicle]["jitter_s"][flight.window(wanted.from_s, wanted.to_s)]
    return figures.percentiles(values_s * 1e3, int(percentile))[f"p{percentile}"]


def _run_value(wanted: Expectation, flight: RecordedFlight, parts: Mapping[str, Any]) -> float | None:
    window = flight.window(wanted.from_s, wanted.to_s)
    if wanted.metric == "min_separation_m":
        return float(figures.separation_m(flight, window).min()) if window.any() else None
    if wanted.metric == "min_clearance_m":
        return figures.least(figures.clearance_m(flight, window)) if window.any() else None
    return figure_of_run(parts, wanted.metric)


def figure_of_run(summary: Mapping[str, Any], metric: str) -> float | None:
    """Return a figure of the whole run from summary.json or one of its sections; None if it isn't there."""
    sections = [summary, *(summary[section] for section in SECTIONS)]
    return next((figure_of(each, metric) for each in sections if metric.partition(".")[0] in each), None)


def figure_of(part: Mapping[str, Any], metric: str) -> Any:  # noqa: ANN401 - a value of JSON
    """Return a figure from a part of summary.json by its dotted name; None if a part on the way is None."""
    value: Any = part
    for name in metric.split("."):
        value = value[name] if value is not None else None
    return value
