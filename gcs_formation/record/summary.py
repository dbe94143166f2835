"""summary.json: the figures of a finished run, and whether it met its expectations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from airlink.endpoint import VehicleId
from airlink.stream_parser import ParserCounts
from flight_model.arrays import Array, Mask
from formation_scenario import Scenario
from formation_scenario.used_extensions import used_extensions
from gcs_formation.record import figures_of_merit as figures
from gcs_formation.record import path_distance
from gcs_formation.record.expectations import RunOutcome, judge
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.lateness import late_ticks, lateness
from gcs_formation.record.link_verdicts import LinkFigures, is_out
from gcs_formation.record.planned_path import planned_path
from gcs_formation.record.safety import safety
from gcs_formation.record.verdict import Verdict

SCHEMA = 1


@dataclass(frozen=True)
class Summary:
    """The figures of a finished run."""

    figures: Mapping[str, Any]
    verdicts: tuple[Verdict, ...]
    breaches: tuple[str, ...]
    """Broken safety limits, and what the scenario planned and wasn't carried out, in words."""
    measured: tuple[Verdict, ...] = field(default=(), kw_only=True)
    """Further figures requested by the run's options; their bounds are arbitrary."""

    @property
    def held(self) -> bool | None:
        """Whether all judged expectations held, no safety limit was broken, and everything planned was carried out.

        None if nothing was broken and no expectation was judged.
        """
        found = [verdict.held for verdict in self.verdicts]
        return False if self.breaches or False in found else True in found or None

    def to_dict(self) -> dict[str, Any]:
        """Return what summary.json holds."""
        return dict(self.figures)


def summarise(outcome: RunOutcome) -> Summary:
    """Return the summary of a run, scored from the leader's start along its path."""
    from airlink.installed import installed_version  # noqa: PLC0415 - short commands don't need it

    scenario, flight = outcome.scenario, outcome.flight
    limits, off_path = flight.limits, flight.off_path
    assert limits is not None, "a flight as `judged` returns it"
    assert off_path is not None
    window, period_s = flight.window(0.0, scenario.duration_s), 1.0 / scenario.law.rate_hz
    flown_s = max(0.0, flight.scored_end_s(scenario.duration_s, period_s))
    safe = safety(scenario, flight, limits)
    parts: dict[str, Any] = {
        "schema": SCHEMA,
        "version": installed_version(),
        "name": scenario.name,
        "seed": scenario.seed,
        "clock": outcome.clock,
        "duration_s": flown_s,
        "begun_s": _begun_s(flight),
        "wall_s": outcome.wall_s,
        "real_time_factor": outcome.simulated_s / outcome.wall_s if outcome.wall_s > 0 else None,
        "truth": flight.truth,
        "followers": {str(v): _follower(flight, v, window, period_s, flown_s) for v in flight.followers(scenario)},
        "links": {str(i): _link(link, flight.vehicles[i]["jitter_s"]) for i, link in outcome.links.items()},
        "received": _received(outcome.received, outcome.frames_refused),
        "control": _control(outcome.ticks_s, scenario.law.rate_hz),
        "path": _path(scenario, off_path, window),
        "safety": safe.figures,
        "assembled": outcome.assembled,
        "undone": list(outcome.undone),
        "unsafe": [*_lost(scenario, flight, outcome.links), *_flying_on(outcome), *safe.off_path, *outcome.unsafe],
        "failure": None,
        "features": None if outcome.features is None else list(outcome.features),
        "stability": {
            "delay_margin_s": outcome.delay_margin_s,
            "worst_loop_delay_s": outcome.worst_loop_delay_s,
            "margin_used": figures.if_finite(outcome.margin_used),
        },
    }
    parts["undone"] += _never_assembled(outcome, parts["followers"])
    if outcome.not_landed is not None:
        ended = {str(each): {"landed": why is None, "why": why} for each, why in outcome.not_landed.items()}
        parts["finish"] = {"then": "land", "vehicles": ended}
        parts["undone"] += [f"vehicle {each} hasn't landed: {why}" for each, why in outcome.not_landed.items() if why]
    verdicts, measured = (
        tuple(judge(scenario, flight, parts, outcome.links, outcome.cut_short, wanted))
        for wanted in (scenario.expect, outcome.measure)
    )
    failed = (verdict.reason for verdict in (*verdicts, *measured) if verdict.failed)
    parts["failure"] = outcome.failure or next(failed, None)
    parts["expect"] = [verdict.to_dict() for verdict in verdicts]
    if used_extensions(scenario):
        parts["extensions"] = [each.to_dict() for each in used_extensions(scenario)]
    unsafe = (f"safety broken: {text}" for text in parts["unsafe"])
    return Summary(parts, verdicts, (*safe.breaches, *unsafe, *parts["undone"]), measured=measured)


def _path(scenario: Scenario, off_path: Mapping[str, path_distance.Distances], window: Mask) -> dict[str, Any]:
    """Return how far the leader and the formation's centre were from the path, and the path from its legs."""
    flown = {who: path_distance.figures(each, window) for who, each in off_path.items()}
    return {who: each | (planned_path(scenario) if who == "leader" else {}) for who, each in flown.items()}


def _never_assembled(outcome: RunOutcome, followers: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield in words that the path began without an assembled formation, and who never came to stay in its slot."""
    missing = [name for name, each in followers.items() if each["settled_at_s"] is None]
    if outcome.assembled is False and missing:
        who = f"follower{'s' * (len(missing) > 1)} {', '.join(missing)}"
        began = f"the path began after start.timeout_s, {outcome.scenario.start.timeout_s:g} s"
        slots = "their slots" if len(missing) > 1 else "its slot"
        yield f"never assembled: {began}, and {who} never settled in {slots}"


def _lost(scenario: Scenario, flight: RecordedFlight, links: Mapping[VehicleId, LinkFigures]) -> Iterator[str]:
    """Yield in words which vehicles were lost in the air: silent to the end, by no fault or outage of the scenario."""
    for planned in scenario.vehicles:
        identity, link = planned.vehicle_id, links[planned.vehicle_id]
        if not math.isfinite(link.heard_to_s) or math.isfinite(link.due_to_s):
            continue
        flew = flight.airborne(identity)[flight.mission_time_s <= link.heard_to_s][-1:].any()
        if flew and not is_out(scenario, planned, flight.ended_s):
            yield f"vehicle {identity} was lost in the air: not heard from {link.heard_to_s:.1f} s to the end"


def _flying_on(outcome: RunOutcome) -> Iterator[str]:
    """Yield in words who flies on after the run, but not by a fault or an outage of the scenario at its end."""
    scenario, end_s = outcome.scenario, outcome.flight.ended_s
    for planned in scenario.vehicles:
        text = outcome.flying_on.get(planned.vehicle_id)
        faults = (each for each in scenario.faults if planned in scenario.selected(each.vehicles))
        hindered = any(each.at_s <= end_s < each.end_s for each in faults)
        if text is not None and not hindered and not is_out(scenario, planned, end_s, either=True):
            yield text


def _begun_s(flight: RecordedFlight) -> float | None:
    """Return the time from the run's start to the path's beginning, s; None if it didn't begin."""
    since_s = next(iter(flight.vehicles.values()))["t_s"] - flight.mission_time_s
    known = since_s[np.isfinite(since_s)]
    return float(known[0]) if known.size else None


def _follower(
    flight: RecordedFlight, vehicle: VehicleId, window: Mask, period_s: float, flown_s: float
) -> dict[str, Any]:
    time_s, error_m = flight.mission_time_s[window], flight.error(vehicle, window)
    settled_s = figures.settled_at_s(time_s, error_m, period_s, (0.0, flown_s))
    return figures.of_follower(flight, vehicle, window, settled_s)


def _link(link: LinkFigures, jitter_s: Array) -> dict[str, Any]:
    _, up_ms, down_ms = link.delays_s.T * 1e3
    mean_s, up_s, down_s, loss_up, loss = (None,) * 5
    if link.injected is not None:
        up_s, down_s, loss_up, loss = link.injected
        mean_s = (up_s + down_s) / 2
    delays_s = {"delay": mean_s, "up": up_s, "down": down_s}
    return {
        **{f"injected_{name}_ms": None if delay_s is None else 1e3 * delay_s for name, delay_s in delays_s.items()},
        "measured_delay_ms": figures.percentiles(link.one_way_s * 1e3, 50, 99),
        "measured_up_ms": figures.percentiles(up_ms, 50)["p50"],
        "measured_down_ms": figures.percentiles(down_ms, 50)["p50"],
        "jitter_ms": figures.percentiles(jitter_s * 1e3, 50, 99),
        "injected_loss": loss,
        "injected_loss_up": loss_up,
        "measured_loss": link.measured_loss,
        "frames_in": link.frames_in,
        "frames_out": link.frames_out,
        "frames_bad": link.frames_bad,
        "frames_implausible": link.frames_implausible,
        "frames_duplicate": link.frames_duplicate,
        "frames_late": link.frames_late,
        "authenticated": link.authenticated,
        "frames_refused": sum(link.refused.values()),
        "frames_unverified": link.frames_unverified,
        "refused": dict(link.refused),
        "heard_to_s": figures.if_finite(min(link.due_to_s, link.heard_to_s)),
        **({} if link.radio is None else {"radio": dict(link.radio)}),
        **({"each": [one.to_dict() for one in link.each]} if link.each else {}),
    }


def _received(counts: ParserCounts, refused: int) -> dict[str, Any]:
    return {
        "frames": counts.frames,
        "frames_refused": refused,
        "frames_bad": counts.bad,
        "garbage_bytes": counts.garbage_bytes,
        "unread_bytes": counts.unread_bytes,
    }


def _control(ticks_s: Array, rate_hz: float) -> dict[str, Any]:
    _, begun_s, compute_s = ticks_s
    period_ms = np.diff(begun_s) * 1e3
    return {
        "rate_hz": rate_hz,
        "ticks": int(begun_s.size),
        "late_ticks": late_ticks(ticks_s),
        "lateness": lateness(ticks_s, rate_hz),
        "period_ms": figures.percentiles(period_ms, 50, 99)
        | {"max": float(period_ms.max()) if period_ms.size else None},
        "compute_ms": figures.percentiles(compute_s * 1e3, 50, 99),
    }
