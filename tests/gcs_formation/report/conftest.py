"""Run directories of synthetic flights: plausible columns in real files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pytest

from flight_model.spline import SplinePath
from formation_scenario import Scenario, dump_scenario, load_scenario
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.surroundings import StepDisturbance
from gcs_formation.record.figures_of_merit import (
    axis_figures,
    effort,
    in_slot_share,
    left_at_s,
    separation_m,
    settled_at_s,
)
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.parquet import write_parquet
from gcs_formation.record.timeseries import DISTURBANCE, ERROR, GAINS, LAW_ERROR, MIXED, STATE, TRUTH
from gcs_formation.report import RunData, load_run
from gcs_formation.report.page import write_report

CONFIGS = Path(__file__).parents[3] / "configs"
ASSEMBLY_S = 10.0

MakeRun = Callable[..., Path]
EVENTFUL = (
    "name=<three> & $more",
    "formation.changes=[{at_s: 60, shape: square}]",
    "disturbances=[{at_s: 80, until_s: 85, velocity_mps: [0.6, 0.6, 0]}]",
    "faults=[{at_s: 90, vehicles: [3], kind: crash}]",
    "links.changes=[{at_s: 40, vehicles: [2], delay_ms: 300}, {at_s: 70, vehicles: [3], uplink: {delay_ms: 200}}]",
)


@pytest.fixture(scope="session")
def make_run(tmp_path_factory: pytest.TempPathFactory) -> MakeRun:
    """Write the run directory of a scenario, a new one each time, and return it."""

    def make(scenario: Scenario | None = None, **options: Any) -> Path:
        directory = tmp_path_factory.mktemp("run")
        write_run(directory, scenario or load_scenario(CONFIGS / "quickstart.yaml"), **options)
        return directory

    return make


class Reported(NamedTuple):
    """The report of a flight with events of every kind; it is shared because drawing takes seconds."""

    directory: Path
    run: RunData
    page: str
    settings_kept: bool
    """Whether Matplotlib's settings were restored."""


@pytest.fixture(scope="session")
def reported(make_run: MakeRun) -> Reported:
    """Return the report of an eventful flight."""
    directory = make_run(load_scenario(CONFIGS / "quickstart.yaml", EVENTFUL))
    before = dict(mpl.rcParams)
    page = write_report(directory)
    return Reported(directory, load_run(directory), page.read_text(encoding="utf-8"), dict(mpl.rcParams) == before)


def write_run(
    directory: Path,
    scenario: Scenario,
    *,
    flown_s: float | None = None,
    truth: bool = True,
    begun: bool = True,
    crash: bool = False,
    unseen: slice | None = None,
) -> None:
    """Write all files that `report` reads.

    `crash`: the last follower drops out halfway; `unseen`: ticks at which its state is unknown.
    """
    end_s = min(scenario.duration_s, flown_s or scenario.duration_s)
    mission_s = np.arange(-ASSEMBLY_S, end_s + 1e-9, 1.0 / scenario.law.rate_hz)
    columns = flown_columns(scenario, mission_s, truth=truth, crash=crash)
    if not begun:
        columns["mission_time_s"][:] = np.nan
    if unseen is not None:
        for name in (*STATE, *TRUTH, *ERROR, *LAW_ERROR, "delay_s", "age_s"):
            if name in columns:
                columns[name].reshape(mission_s.size, -1)[unseen, -1] = np.nan
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "run.yaml").write_text(dump_scenario(scenario), encoding="utf-8")
    write_parquet(directory / "timeseries.parquet", [columns])
    (directory / "events.jsonl").write_text("".join(json.dumps(e) + "\n" for e in some_events(scenario)))
    summary = summary_of(scenario, columns, truth=truth)
    (directory / "summary.json").write_text(json.dumps(summary, allow_nan=False))


def flown_columns(scenario: Scenario, mission_s: np.ndarray, *, truth: bool, crash: bool) -> dict[str, np.ndarray]:
    """Return the columns of a flight along the path with decaying errors; (T * V,) each."""
    random = np.random.default_rng(1)
    count, ticks = len(scenario.vehicles), mission_s.size
    path = SplinePath(scenario.path.waypoints_m)
    along = path.at(scenario.path.begin_mps * mission_s)
    table = slots_over_time(scenario, mission_s)
    columns: dict[str, list[np.ndarray]] = {}
    follower = 0
    for planned in scenario.vehicles:
        leads = planned.role == "leader"
        error = np.zeros((ticks, 3))
        slot = np.full((ticks, 3), np.nan)
        if not leads:
            error = errors_over_time(mission_s, follower, random)
            if crash and follower == len(scenario.followers) - 1:
                error[mission_s > mission_s[-1] / 2, 2] = 100.0
            slot = table[:, follower]
            follower += 1
        own = vehicle_columns(scenario, mission_s, along, np.nan_to_num(slot) - error, random, truth=truth)
        own |= {
            "network": np.full(ticks, planned.network),
            "vehicle": np.full(ticks, planned.id),
            "leads": np.full(ticks, float(leads)),
            "yielding": np.zeros(ticks),
            "airborne": np.ones(ticks),
            "slot_forward_m": slot[:, 0],
            "slot_right_m": slot[:, 1],
            "slot_up_m": slot[:, 2],
        }
        shown = np.full_like(error, np.nan) if leads and not truth else error
        for names in (ERROR, LAW_ERROR, MIXED):
            own |= dict(zip(names, shown.T, strict=True))
        own |= gain_columns(scenario, mission_s, leads)
        for name, values in own.items():
            columns.setdefault(name, []).append(values)
    assert all(len(parts) == count for parts in columns.values())
    return {name: np.stack(parts, axis=1).ravel() for name, parts in columns.items()}


def slots_over_time(scenario: Scenario, mission_s: np.ndarray) -> np.ndarray:
    steps = slot_schedule(scenario)
    index = np.searchsorted([step.at_s for step in steps], mission_s, side="right") - 1
    return np.stack([step.positions_m[1:] for step in steps])[np.maximum(index, 0)]


def errors_over_time(mission_s: np.ndarray, follower: int, random: np.random.Generator) -> np.ndarray:
    size = np.array([8.0, -6.0, 4.0]) * (1 + 0.1 * follower)
    decay = np.exp(-np.maximum(mission_s, 0.0) / 6.0)[:, None]
    wander = 0.05 * np.sin(mission_s[:, None] / (7.0 + np.arange(3)) + follower)
    return (
        size * decay * np.cos(np.maximum(mission_s, 0.0) / 4.0)[:, None]
        + wander
        + random.normal(0, 0.01, (mission_s.size, 3))
    )


def vehicle_columns(
    scenario: Scenario,
    mission_s: np.ndarray,
    along: Any,
    offset: np.ndarray,
    random: np.random.Generator,
    *,
    truth: bool,
) -> dict[str, np.ndarray]:
    cos, sin = np.cos(along.course_rad), np.sin(along.course_rad)
    north = along.north_m + cos * offset[:, 0] - sin * offset[:, 1]
    east = along.east_m + sin * offset[:, 0] + cos * offset[:, 1]
    height = along.height_m + offset[:, 2]
    ticks = mission_s.size
    speed = scenario.path.begin_mps + np.gradient(offset[:, 0], mission_s)
    own = {
        "t_s": mission_s + ASSEMBLY_S + 2.0,
        "mission_time_s": np.where(mission_s < -1e-9, np.nan, mission_s),
        "phase": (mission_s >= -1e-9).astype(np.int8),
        "north_m": north,
        "east_m": east,
        "height_m": height,
        "climb_mps": np.gradient(height, mission_s),
        "airspeed_mps": speed,
        "heading_rad": (along.course_rad + np.pi) % (2 * np.pi) - np.pi,
        "wind_north_mps": np.zeros(ticks),
        "wind_east_mps": np.zeros(ticks),
        "setpoint_speed_mps": speed + 0.1 * np.sin(mission_s),
        "setpoint_heading_rad": (along.course_rad + 0.02 * np.sin(mission_s)) % (2 * np.pi),
        "setpoint_height_m": height + 0.2,
        "age_s": 0.05 + 0.1 * random.random(ticks),
        "delay_s": np.maximum(0.0, 0.02 + 0.002 * random.standard_normal(ticks)),
        "up_s": np.full(ticks, np.nan),
        "down_s": np.full(ticks, np.nan),
        "injected_up_s": np.full(ticks, 0.02),
        "injected_down_s": np.full(ticks, 0.02),
        "injected_delay_s": np.full(ticks, 0.02),
        "jitter_s": np.full(ticks, 0.002),
        "margin_used": np.full(ticks, 0.3),
        "active": np.ones(ticks),
        "ground_height_m": np.zeros(ticks),
        "clearance_m": height,
    }
    if truth:
        own |= {
            "true_north_m": north,
            "true_east_m": east,
            "true_height_m": height,
            "true_airspeed_mps": speed,
            "true_heading_rad": np.unwrap(along.course_rad),
            **dict(zip(DISTURBANCE, disturbance_mps(scenario, mission_s).T, strict=True)),
        }
    return own


def disturbance_mps(scenario: Scenario, mission_s: np.ndarray) -> np.ndarray:
    """Return (T, 3) the sum of the scenario's steps, as if each acted on all vehicles."""
    steps = [
        np.outer(mission_s >= each.at_s, each.velocity_mps)
        for each in scenario.disturbances
        if isinstance(each, StepDisturbance)
    ]
    return np.sum([np.zeros((mission_s.size, 3)), *steps], axis=0)


def gain_columns(scenario: Scenario, mission_s: np.ndarray, leads: bool) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for name in GAINS:
        gain, channel = name.split("_")
        nominal = getattr(getattr(scenario.law, channel), gain)
        moved = nominal * (1.0 + 0.3 * np.exp(-np.maximum(mission_s, 0) / 10) * np.cos(mission_s / 3))
        found[name] = np.full(mission_s.size, np.nan) if leads else moved
    return found


def some_events(scenario: Scenario) -> list[dict[str, Any]]:
    last = str(scenario.vehicles[-1].vehicle_id)
    happened = [
        (0.5, "link", "connected", last),
        (12.0, "phase", "flying", None),
        (42.0, "link", "lost", last),
        (43.0, "statustext", "<b>EKF</b> & </script>", last),
        (100.0, "leader", "leads the formation", "3"),
    ]
    doubted = {"kind": "health", "text": "its height has jumped", "vehicle": last, "quantity": "height"}
    return [
        *(
            {"schema": 1, "t_s": at_s, "kind": kind, "text": text} | ({"vehicle": vehicle} if vehicle else {})
            for at_s, kind, text, vehicle in happened
        ),
        {"schema": 1, "t_s": 110.0, **doubted, "healthy": False},
    ]


def summary_of(scenario: Scenario, columns: dict[str, np.ndarray], *, truth: bool) -> dict[str, Any]:
    """Return a summary whose follower and safety figures are those of the columns."""
    grid = {name: values.reshape(-1, len(scenario.vehicles)) for name, values in columns.items()}
    ids = [vehicle.vehicle_id for vehicle in scenario.vehicles]
    flight = RecordedFlight({v: {n: g[:, i] for n, g in grid.items()} for i, v in enumerate(ids)})
    window = flight.window(0.0, scenario.duration_s)
    time_s = flight.mission_time_s[window]
    followers: dict[str, Any] = {}
    for planned in scenario.followers:
        error = flight.error(planned.vehicle_id)[window]
        seen = np.isfinite(error).all(axis=1)
        settled = settled_at_s(time_s[seen], error[seen])
        followers[str(planned.vehicle_id)] = {
            f"error_{axis}_m": axis_figures(time_s[seen], error[seen, i], settled) for i, axis in enumerate("xyz")
        } | {
            "settled_at_s": settled,
            "left_at_s": left_at_s(time_s[seen], error[seen], settled),
            "in_slot_share": in_slot_share(error[seen]),
            "followed_share": float(seen.mean()) if seen.size else None,
            "effort": effort(flight.vehicles[planned.vehicle_id], window),
        }
    least = separation_m(flight, window)
    near = float(least.min()) if least.size and np.isfinite(least.min()) else None
    link = {
        "injected_delay_ms": 0.0,
        "injected_up_ms": 0.0,
        "injected_down_ms": 0.0,
        "measured_delay_ms": {"p50": 20.1, "p99": 24.9},
        "measured_up_ms": None,
        "measured_down_ms": None,
        "injected_loss": 0.0,
        "injected_loss_up": 0.0,
        "measured_loss": 0.001,
        "frames_in": 5000,
        "frames_out": 2600,
        "frames_bad": 0,
    }
    worst = next(iter(followers.values()), {"error_x_m": {"max": None}})["error_x_m"]["max"]
    return {
        "schema": 1,
        "name": scenario.name,
        "seed": scenario.seed,
        "clock": "virtual",
        "duration_s": float(time_s[-1]) if time_s.size else 0.0,
        "wall_s": 1.3,
        "real_time_factor": 101.0,
        "truth": truth,
        "followers": followers,
        "links": {str(vehicle): dict(link) for vehicle in ids},
        "control": {
            "rate_hz": scenario.law.rate_hz,
            "ticks": len(time_s),
            "late_ticks": 0,
            "period_ms": {"p50": 100.0, "p99": 100.4, "max": 101.0},
            "compute_ms": {"p50": 0.2, "p99": 0.4},
        },
        "safety": {"min_separation_m": near, "min_clearance_m": 90.0, "violations": 0},
        "stability": {"delay_margin_s": 0.89, "worst_loop_delay_s": None},
        "expect": some_verdicts(worst),
    }


def some_verdicts(worst: float | None) -> list[dict[str, Any]]:
    """Return one expectation that held, one that broke, one that wasn't judged."""
    until = {"judged": False, "reached": False, "reason": "flown to 90.0 s of 120 s"}
    window: dict[str, Any] = {"from_s": 60.0, "to_s": 120.0}
    of = {"follower": 2, "below": 2.0, "judged": True, "reached": True}
    return [
        {"metric": "error_x_m.max", "value": worst, "held": True, **of, **window},
        {"metric": "error_y_m.max", "value": 3.0, "held": False, **of, **window},
        {"metric": "min_separation_m", "value": None, "above": 10.0, "held": None, **until, **window},
    ]
