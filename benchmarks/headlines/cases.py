"""Which flights each page's headlines are the worst of."""

from __future__ import annotations

import math
from functools import partial
from random import Random
from typing import Any

import gcs_formation
from benchmarks import PAPER, both_directions, events_of
from benchmarks.headlines import Case, Figure, Flight, draws, guidance
from gcs_formation.report import load_run
from gcs_formation.report.gusts import gusts

CONFIGS = PAPER.parent
AFTER_S = 30.0
"""How long errors are judged for after a step."""
LARGEST = {axis: Figure(f"error_{axis}_m.max") for axis in "xy"}
IN_AXES = {axis: Figure(f"error_{axis}_m.max") for axis in "xyz"}
RMS = {axis: Figure(f"error_{axis}_m.rms") for axis in "xyz"}
SEPARATION = Figure("min_separation_m", 1, min)
FOLLOWERS = [2, 3, 4]


def stepped(random: Random, whom: str | list[int] = "all", after_s: float = AFTER_S, **keys: Any) -> Flight:
    """Draw the flight of configs/paper.yaml on another path, with a step of wind in a bend."""
    at_s = draws.instant(random, 45.0, 60.0)
    drawn = {"seed": draws.seed(random), "path__waypoints_m": draws.path(random, at_s + after_s)}
    return Flight(drawn | {"disturbances": draws.step(random, at_s, whom)} | keys, at_s, at_s + after_s)


def delayed(random: Random, delay_ms: float, **keys: Any) -> Flight:
    """Draw a flight with a step over links of one delay."""
    return stepped(random, links=both_directions(delay_ms), **keys)


def off_model(random: Random) -> Flight:
    """Draw a flight with a step and 300 ms, of vehicles whose time constants are up to 30 % off the model's."""
    vehicles = [
        {"id": 1 + i, "role": "follower" if i else "leader", "true_model": draws.time_constants(random, 0.3)}
        for i in range(4)
    ]
    return delayed(random, 300.0, vehicles=vehicles, after_s=20.0)


def lossy(random: Random) -> Flight:
    """Draw a flight over links that delay, jitter and lose."""
    links = {"default": {"delay_ms": 300, "jitter_ms": 20, "loss": 0.02}}
    return stepped(random, links=links)


def measuring(random: Random) -> Flight:
    """Draw a flight whose followers have links and clocks of their own."""
    changes = [
        {"at_s": 0, "vehicles": [number], "jitter_ms": random.choice([0, 20]), "reorder": True}
        | {direction: {"delay_ms": round(random.uniform(0, 600), 1)} for direction in ("uplink", "downlink")}
        for number in FOLLOWERS
    ]
    clocks = [{"id": number, "clock": {"drift_ppm": random.choice([0, 50, -50, 15000])}} for number in FOLLOWERS]
    keys = {
        "seed": draws.seed(random),
        "vehicles": [{"id": 1, "role": "leader"}, *clocks],
        "path__waypoints_m": draws.path(random, 90.0),
        "links": {"changes": changes},
        "disturbances": [],
    }
    return Flight(keys, 30.0, 90.0)


def off_measure(summary: gcs_formation.Summary, _: Flight) -> float:
    """Return the largest error of a follower's measured delay, as a share of max(2 ms, 2 %)."""
    links = summary.to_dict()["links"]
    errors = [
        abs(each["measured_delay_ms"]["p50"] - each["injected_delay_ms"]) / max(2.0, 0.02 * each["injected_delay_ms"])
        for number in FOLLOWERS
        for each in [links[str(number)]]
    ]
    return float(max(errors))


def beyond_margin(random: Random, links: dict[str, Any], **keys: Any) -> Flight:
    """Draw a flight whose links use more than a margin, judged once that has lasted."""
    drawn = {"seed": draws.seed(random), "path__waypoints_m": draws.path(random, 130.0), "disturbances": []}
    return Flight(drawn | {"links": {"default": links}} | keys, 90.0, 130.0)


def share_of_limit(summary: gcs_formation.Summary, _: Flight) -> float:
    """Return the largest error after a gust as a share of the one that the law is held to."""
    return float(max(each.found_m / each.allowed_m for each in gusts(load_run(summary.run_dir))))


def noisy(random: Random, delay_ms: float) -> Flight:
    """Draw the flight of configs/noise.yaml on another path, with a step."""
    flight = delayed(random, delay_ms)
    return Flight(flight.keys, 35.0, flight.to_s)


def over_hills(random: Random) -> Flight:
    """Draw the flight of configs/hills.yaml over other hills, with a step."""
    flight = delayed(random, 300.0)
    waypoints_m = [
        [north, east, 70.0 if number == 0 else 20.0] for number, (north, east, _) in enumerate(path_of(flight))
    ]
    keys = {"path__waypoints_m": waypoints_m, "terrain__hills": draws.hills(random, waypoints_m)}
    return Flight({**flight.keys, **keys}, flight.from_s, flight.to_s)


def path_of(flight: Flight) -> list[list[float]]:
    """Return the waypoints of a drawn flight."""
    waypoints_m: list[list[float]] = flight.keys["path__waypoints_m"]
    return waypoints_m


def changing(random: Random) -> Flight:
    """Draw a flight that changes its shape twice, over 300 ms."""
    shapes = random.sample(["line", "circle", "square", "arrow", "echelon", "plus"], 2)
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.path(random, 110.0),
        "formation__changes": [{"at_s": 20 + 45 * i, "shape": shape} for i, shape in enumerate(shapes)],
        "start__offset_m": [0, 0, 0],
        "links": both_directions(300.0),
        "disturbances": [],
    }
    return Flight(keys, 10.0, 110.0)


def losing_leader(random: Random) -> Flight:
    """Draw a flight whose leader crashes."""
    at_s = draws.instant(random, 30.0, 50.0)
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.path(random, at_s + 40.0),
        "faults": [{"at_s": at_s, "vehicles": [1], "kind": "crash"}],
        "disturbances": [],
    }
    return Flight(keys, at_s, at_s + 40.0)


def succeeded_after_s(summary: gcs_formation.Summary, _: Flight) -> float:
    """Return how long after the leader's crash another led; infinite if none did."""
    (crash,) = events_of(summary, "fault")
    times_s = [each["t_s"] - crash["t_s"] for each in events_of(summary, "leader") if each["t_s"] > crash["t_s"]]
    return float(min(times_s, default=math.inf))


def by_inertia(random: Random) -> Flight:
    """Draw a flight by inertial navigation that GNSS aids, each vehicle with biases of its own."""
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.path(random, 130.0),
        "vehicles__navigation": {"source": "ins", "aiding": "gnss", "biases": "random"},
        "disturbances": [],
    }
    return Flight(keys, 50.0, 130.0)


def turbulent(random: Random) -> Flight:
    """Draw a flight in slots 12 m apart, in turbulence of a wind of 15 m/s."""
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.path(random, 60.0),
        "formation__shape": random.choice(["follower", "line", "square"]),
        "formation__spacing_m": 12,
        "start__offset_m": [0, 0, 0],
        "disturbances": [{"at_s": 0, "kind": "dryden", "wind_6m_mps": 15}],
    }
    return Flight(keys, 0.0, 60.0)


STEP_300 = partial(delayed, delay_ms=300.0)
UNCOMPENSATED: dict[str, Any] = {"law__delay_compensation": False}
JITTER = {"delay_ms": 300, "jitter_ms": 40}
HILLS = CONFIGS / "hills.yaml"
CASES = (
    Case("latency.step", PAPER, STEP_300, LARGEST),
    Case("latency.step-uncompensated", PAPER, partial(delayed, delay_ms=300.0, **UNCOMPENSATED), LARGEST),
    Case("latency.step-uncompensated-500", PAPER, partial(delayed, delay_ms=500.0, **UNCOMPENSATED), LARGEST),
    Case("latency.lossy", PAPER, lossy, LARGEST),
    Case("latency.lags", PAPER, off_model, IN_AXES),
    Case("latency.measured", PAPER, measuring, {"share": Figure(off_measure, 2)}),
    Case(
        "margins.uncompensated-warn", PAPER, partial(beyond_margin, links={"delay_ms": 500}, **UNCOMPENSATED), LARGEST
    ),
    Case(
        "margins.uncompensated-degrade",
        PAPER,
        partial(beyond_margin, links={"delay_ms": 500}, law__on_delay="degrade", **UNCOMPENSATED),
        LARGEST,
    ),
    Case("margins.jitter-warn", PAPER, partial(beyond_margin, links=JITTER), LARGEST),
    Case("margins.jitter-degrade", PAPER, partial(beyond_margin, links=JITTER, law__on_delay="degrade"), LARGEST),
    Case(
        "gusts.followers",
        PAPER,
        partial(delayed, delay_ms=300.0, whom=FOLLOWERS, after_s=10.0),
        LARGEST | {"share": Figure(share_of_limit, 2)},
    ),
    Case("noise.near", CONFIGS / "noise.yaml", partial(noisy, delay_ms=0.0), RMS),
    Case("noise.delayed", CONFIGS / "noise.yaml", partial(noisy, delay_ms=300.0), RMS),
    Case("terrain.hills", HILLS, over_hills, IN_AXES | {"clearance": Figure("min_clearance_m", 1, min)}),
    Case(
        "formations.changes",
        PAPER,
        changing,
        {axis: figure._replace(digits=2) for axis, figure in IN_AXES.items()} | {"separation": SEPARATION},
    ),
    Case("succession.crash", PAPER, losing_leader, {"after": Figure(succeeded_after_s, 1), "separation": SEPARATION}),
    Case("navigation.gnss", PAPER, by_inertia, {axis: figure._replace(digits=2) for axis, figure in RMS.items()}),
    Case("separation.turbulence", PAPER, turbulent, {"separation": SEPARATION}),
    *guidance.CASES,
)
