"""Flights of the leader's guidance: how far from its path it is in bends, on legs, in turbulence and after a gust."""

from __future__ import annotations

import math
from functools import partial
from random import Random

import numpy as np

import gcs_formation
from benchmarks import PAPER, both_directions
from benchmarks.headlines import Case, Figure, Flight, draws
from gcs_formation.record.path_distance import path_distances
from gcs_formation.report import load_run

LONE_S, MISSION_S, TURBULENT_S = 110.0, 150.0, 150.0
TURN_RPS = 0.25
"""Limit of `configs/paper.yaml`."""
STEP_MPS, JUDGED_S = 5.0, 40.0
WITHIN_M = 1.0
ACROSS_MAX = {"across": Figure("path_across_m.max", 2)}
ACROSS_RMS = {"across": Figure("path_across_m.rms", 2)}


def in_bends(random: Random) -> Flight:
    """Draw a flight of the leader alone through bends at nine tenths of its turn rate, over 0 or 300 ms."""
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.tight(random, LONE_S, 0.9 * TURN_RPS),
        "vehicles": [{"id": 1, "role": "leader"}],
        "links": both_directions(random.choice([0.0, 300.0])),
        "disturbances": [],
    }
    return Flight(keys, 5.0, LONE_S)


def on_legs(random: Random) -> Flight:
    """Draw a mission of legs with three followers, over 300 ms."""
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.mission(random, MISSION_S),
        "path__kind": "legs",
        "links": both_directions(300.0),
        "start__offset_m": [0, 0, 0],
        "disturbances": [],
    }
    return Flight(keys, 20.0, MISSION_S)


def in_turbulence(random: Random, delay_ms: float) -> Flight:
    """Draw a flight in the turbulence of a wind of 7 m/s."""
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.path(random, TURBULENT_S, level=True),
        "links": both_directions(delay_ms),
        "disturbances": [{"at_s": 0, "kind": "dryden", "wind_6m_mps": 7}],
    }
    return Flight(keys, 0.0, TURBULENT_S)


def after_gust(random: Random) -> Flight:
    """Draw a flight with a step of wind of 5 m/s on all, over 300 ms."""
    at_s, bearing_rad = draws.instant(random, 45.0, 60.0), random.uniform(-math.pi, math.pi)
    velocity_mps = [round(STEP_MPS * math.cos(bearing_rad), 3), round(STEP_MPS * math.sin(bearing_rad), 3), 0.0]
    keys = {
        "seed": draws.seed(random),
        "path__waypoints_m": draws.path(random, at_s + JUDGED_S, level=True),
        "links": both_directions(300.0),
        "disturbances": [{"at_s": at_s, "velocity_mps": velocity_mps}],
    }
    return Flight(keys, at_s, at_s + JUDGED_S)


def back_after_s(summary: gcs_formation.Summary, flight: Flight) -> float:
    """Return how long after the gust the leader was last farther than `WITHIN_M` from its path."""
    run = load_run(summary.run_dir)
    across_m = path_distances(run.scenario, run.flown.vehicles, ())["leader"].across_m
    away_s = run.time_s[(run.time_s >= flight.from_s) & (np.abs(across_m) > WITHIN_M)]
    return float(away_s[-1] - flight.from_s) if away_s.size else 0.0


CASES = (
    Case("guidance.bends", PAPER, in_bends, ACROSS_MAX),
    Case("guidance.legs", PAPER, on_legs, ACROSS_MAX | {axis: Figure(f"error_{axis}_m.rms") for axis in "xy"}),
    Case("guidance.turbulence", PAPER, partial(in_turbulence, delay_ms=0.0), ACROSS_RMS),
    Case("guidance.turbulence-delayed", PAPER, partial(in_turbulence, delay_ms=300.0), ACROSS_RMS),
    Case(
        "guidance.gust",
        PAPER,
        after_gust,
        ACROSS_MAX | {axis: Figure(f"error_{axis}_m.max") for axis in "xy"} | {"back": Figure(back_after_s, 1)},
    ),
)
