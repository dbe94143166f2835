"""summary.json: the figures of a finished run, and whether it met its expectations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from airlink.endpoint import VehicleId
from airlink.frame import ParserCounts
from flight_model.arrays import Array, Mask
from formation_scenario import Scenario
from formation_scenario.fields import distinct_texts
from gcs_formation.record import figures_of_merit as figures
from gcs_formation.record.expectations import LinkFigures, RunOutcome, Verdict, is_out, judge
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.planned_path import planned_path
from gcs_formation.record.timeseries import PHASES

SCHEMA = 1
LATE_S = 0.010
"""A tick that begins more than this after it was due is late."""


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
    def held(self) -> bool:
        """Whether all judged expectations held, no safety limit was broken, and everything planned was carried out."""
        return not self.breaches and all(verdict.held is not False for verdict in self.verdicts)

    def to_dict(self) -> dict[str, Any]:
        """Return what summary.json holds."""
        return dict(self.figures)


def summarise(outcome: RunOutcome) -> Summary:
    """Return the summary of a run, scored from the leader's start along its path."""
    from importlib.metadata import version  # noqa: PLC0415 - short commands don't need it

    scenario, flight = outcome.scenario, outcome.flight
    window = flight.window(0.0, scenario.duration_s)
    time_s = flight.mission_time_s[window]
    safety, breaches = _safety(outcome)
    parts: dict[str, Any] = {
        "schema": SCHEMA,
        "version": version("gcs-formation"),
        "name": scenario.name,
        "seed": scenario.seed,
        "clock": outcome.clock,
        "duration_s": float(time_s[-1]) if time_s.size else 0.0,
        "begun_s": _begun_s(flight),
        "wall_s": outcome.wall_s,
        "real_time_factor": outcome.simulated_s / outcome.wall_s if outcome.wall_s > 0 else None,
        "truth": flight.truth,
        "followers": {str(v): _follower(flight, v, window) for v in flight.followers(scenario)},
        "links": {str(i): _link(link, flight.vehicles[i]["jitter_s"]) for i, link in outcome.links.items()},
        "received": _received(outcome.received, outcome.frames_refused),
        "control": _control(outcome.ticks_s, scenario.law.rate_hz),
        "path": {"leader": planned_path(scenario)},
        "safety": safety,
        "assembled": outcome.assembled,
        "undone": list(outcome.undone),
        "unsafe": [*_lost(scenario, flight, outcome.links), *_flying_on(outcome), *outcome.unsafe],
        "failure": outcome.failure,
        "stability": {
            "delay_margin_s": outcome.delay_margin_s,
            "worst_loop_delay_s": outcome.worst_loop_delay_s,
            "margin_used": figures.if_finite(outcome.margin_used),
        },
    }
    verdicts, measured = (
        tuple(judge(scenario, flight, parts, outcome.links, outcome.cut_short, wanted))
        for wanted in (scenario.expect, outcome.measure)
    )
    parts["expect"] = [verdict.to_dict() for verdict in verdicts]
    unsafe = (f"safety broken: {text}" for text in parts["unsafe"])
    return Summary(parts, verdicts, (*breaches, *unsafe, *outcome.undone), measured=measured)


def _lost(scenario: Scenario, flight: RecordedFlight, links: Mapping[VehicleId, LinkFigures]) -> Iterator[str]:
    """Yield in words which vehicles were lost in the air: silent to the end, by no fault or outage of the scenario."""
    for planned in scenario.vehicles:
        identity, link = planned.vehicle_id, links[planned.vehicle_id]
        if not math.isfinite(link.heard_to_s) or math.isfinite(link.due_to_s):
            continue
        flew = flight.airborne(identity)[flight.mission_time_s <= link.heard_to_s][-1:].any()
        if flew and not is_out(scenario, planned, float(flight.mission_time_s[-1])):
            yield f"vehicle {identity} was lost in the air: not heard from {link.heard_to_s:.1f} s to the end"


def _flying_on(outcome: RunOutcome) -> Iterator[str]:
    """Yield in words who flies on after the run, but not by a fault or an outage of the scenario at its end."""
    scenario, end_s = outcome.scenario, float(outcome.flight.mission_time_s[-1])
    for planned in scenario.vehicles:
        text = outcome.flying_on.get(planned.vehicle_id)
        faults = (each for each in scenario.faults if planned in scenario.selected(each.vehicles))
        hindered = any(each.at_s <= end_s < (each.until_s or math.inf) for each in faults)
        if text is not None and not hindered and not is_out(scenario, planned, end_s, either=True):
            yield text


def _begun_s(flight: RecordedFlight) -> float | None:
    """Return the time from the run's start to the path's beginning, s; None if it didn't begin."""
    since_s = next(iter(flight.vehicles.values()))["t_s"] - flight.mission_time_s
    known = since_s[np.isfinite(since_s)]
    return float(known[0]) if known.size else None


def _follower(flight: RecordedFlight, vehicle: VehicleId, window: Mask) -> dict[str, Any]:
    settled_s = figures.settled_at_s(flight.mission_time_s[window], flight.error(vehicle, window))
    return figures.of_follower(flight, vehicle, window, settled_s)


def _link(link: LinkFigures, jitter_s: Array) -> dict[str, Any]:
    _, up_ms, down_ms = link.delays_s.T * 1e3
    mean_s, up_s, down_s, loss_up, loss = (None,) * 5
    if link.injected is not None:
        up_s, down_s, loss_up, loss = link.injected
        mean_s = (up_s + down_s) / 2
    ways_s = {"delay": mean_s, "up": up_s, "down": down_s}
    return {
        **{f"injected_{name}_ms": None if way_s is None else 1e3 * way_s for name, way_s in ways_s.items()},
        "measured_delay_ms": figures.percentiles(link.each_way_s * 1e3, 50, 99),
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
        "heard_to_s": figures.if_finite(min(link.due_to_s, link.heard_to_s)),
    }


def _received(counts: ParserCounts, refused: int) -> dict[str, Any]:
    return {
        "frames": counts.frames,
        "frames_refused": refused,
        "frames_bad": counts.bad,
        "garbage_bytes": counts.garbage_bytes,
    }


def _control(ticks_s: Array, rate_hz: float) -> dict[str, Any]:
    due_s, begun_s, compute_s = ticks_s
    period_ms = np.diff(begun_s) * 1e3
    return {
        "rate_hz": rate_hz,
        "ticks": int(begun_s.size),
        "late_ticks": int((begun_s - due_s > LATE_S).sum()),
        "period_ms": figures.percentiles(period_ms, 50, 99)
        | {"max": float(period_ms.max()) if period_ms.size else None},
        "compute_ms": figures.percentiles(compute_s * 1e3, 50, 99),
    }


def _safety(outcome: RunOutcome) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the figures of the whole flight, from the first take-off to the last acknowledgement at its end."""
    flight, limits = outcome.flight, outcome.scenario.safety
    whole = np.ones(flight.mission_time_s.shape, dtype=bool)
    if not whole.size:
        return {"min_separation_m": None, "min_clearance_m": None, "violations": 0, "avoidance_s": 0.0}, ()
    separation = figures.separation_m(flight, whole)
    clearance = figures.clearance_m(flight, whole)
    breaches: list[str] = []
    for name, values, allowed in (
        ("separation", separation, limits.separation_m),
        ("clearance", clearance, limits.clearance_m),
    ):
        if (values < allowed).any():
            worst = int(np.nanargmin(values))
            found, least = distinct_texts(float(values[worst]), allowed)
            breaches.append(f"safety broken: {name} was {found} m {_when(flight, worst)}; allowed: {least} m or more")
    violations = _episodes(separation < limits.separation_m) + _episodes(clearance < limits.clearance_m)
    measured = {"min_separation_m": figures.least(separation), "min_clearance_m": figures.least(clearance)}
    gave_way_s = figures.gave_way_s(flight, whole, outcome.scenario.law.rate_hz)
    return measured | {"violations": violations, "avoidance_s": gave_way_s}, tuple(breaches)


def _when(flight: RecordedFlight, tick: int) -> str:
    """Return in words when a tick was, by mission time if there is one, and in which phase if not on the path."""
    rows = next(iter(flight.vehicles.values()))
    mission_s, phase = float(rows["mission_time_s"][tick]), PHASES[int(rows["phase"][tick])]
    if np.isnan(mission_s):
        return f"{rows['t_s'][tick]:.1f} s after the start ({phase})"
    return f"at {mission_s:.1f} s" + ("" if phase == "flying" else f" ({phase})")


def _episodes(broken: Mask) -> int:
    """Return how many times a limit began to be broken."""
    return int(broken[0]) + int((broken[1:] & ~broken[:-1]).sum())
