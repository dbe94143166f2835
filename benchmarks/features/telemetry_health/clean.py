"""False alarms of the checks of telemetry: short flights without faults, each drawn by its seed.

`python -m benchmarks.features.telemetry_health.clean --flights 1000 --record FILE` flies them and prints every
event `health`. It may be interrupted: what is in the file isn't flown again. Wind, turbulence and gusts, time constants
and limits ±30 % off the models, noise of telemetry, delay, jitter, loss, hills, multirotors.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.in_order import in_order
from formation_scenario import ScenarioError
from gcs_formation import run

DURATION_S: Final = 45.0
TAUS: Final = {
    "plane": {"tau_v_s": 4.0, "tau_psi_s": 1.5, "tau_ha_s": 1.0, "tau_hb_s": 3.0},
    "copter": {"tau_v_s": 0.6, "tau_ha_s": 0.6, "tau_hb_s": 0.6},
}
"""Time constants of the models, from which the true ones differ by up to `OFF`."""
OFF: Final = 0.3


class Clean(NamedTuple):
    """One flight without faults."""

    seed: int
    flown_s: float
    """Time in the air of all its vehicles together, s; 0: what was drawn can't be flown, and was refused."""
    alarms: tuple[str, ...]


def scenario(seed: int) -> dict[str, Any]:
    """Return a seed's flight: every third of multirotors."""
    rng = np.random.default_rng(seed)
    family = "copter" if seed % 3 == 2 else "plane"
    speed_mps = float(rng.uniform(20.0, 23.0)) if family == "plane" else float(rng.uniform(3.0, 6.0))
    keys: dict[str, Any] = {
        "name": f"clean-{seed}",
        "seed": seed,
        "duration_s": DURATION_S,
        "start": {"in_air": True, "run_in_s": 15.0, "timeout_s": 4.0},
        "vehicles": [_vehicle(rng, number, family) for number in (1, 2, 3)],
        "formation": {"shape": ("diamond", "echelon", "line")[int(rng.integers(3))], "spacing_m": 30},
        "telemetry": {"rate_hz": float(rng.choice([5.0, 10.0]))},
        "path": {"speed_mps": speed_mps, "waypoints_m": _waypoints(rng, 30.0 * speed_mps)},
        "links": {"default": _link(rng)},
        "finish": {"loiter_s": 1.0},
    }
    max_mps = 6.0 if family == "plane" else 3.0
    keys["wind"] = {"velocity_mps": [*rng.uniform(-max_mps, max_mps, 2).tolist(), 0.0]}
    if rng.random() < 0.6:
        keys["disturbances"] = [{"at_s": 5.0, "kind": "dryden", "wind_6m_mps": float(rng.uniform(3.0, 10.0))}]
        keys["disturbances"].append({"at_s": 20.0, "velocity_mps": rng.uniform(-3.0, 3.0, 3).tolist()})
    if family == "plane" and rng.random() < 0.3:
        hill = {"north_m": 10.0 * speed_mps, "east_m": 0.0, "height_m": 40.0, "radius_m": 500.0}
        keys["terrain"] = {"hills": [hill], "clearance_m": 50.0}
    return keys


def _vehicle(rng: np.random.Generator, number: int, family: str) -> dict[str, Any]:
    keys: dict[str, Any] = {"id": number, "role": "follower" if number > 1 else "leader"}
    off = {name: value * float(rng.uniform(1.0 - OFF, 1.0 + OFF)) for name, value in TAUS[family].items()}
    if family == "copter":
        return keys | {"autopilot": "arducopter", "model": "arducopter"}
    if rng.random() < 0.5:
        keys["navigation"] = {
            "source": "noisy",
            "position_sigma_m": float(rng.uniform(0.1, 1.5)),
            "velocity_sigma_mps": float(rng.uniform(0.05, 0.3)),
            "airspeed_sigma_mps": float(rng.uniform(0.1, 0.5)),
            "heading_sigma_deg": float(rng.uniform(0.2, 2.0)),
        }
    return keys | {"true_model": off}


def _waypoints(rng: np.random.Generator, leg_m: float) -> list[list[float]]:
    points, course = [[0.0, 0.0, 100.0]], 0.0
    for _ in range(4):
        north, east, height = points[-1]
        course += float(rng.uniform(-0.6, 0.6))
        climb_m = float(rng.uniform(-0.03, 0.03)) * leg_m
        points.append([north + leg_m * np.cos(course), east + leg_m * np.sin(course), height + climb_m])
    return [[float(each) for each in point] for point in points]


def _link(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "delay_ms": float(rng.uniform(0.0, 400.0)),
        "jitter_ms": float(rng.uniform(0.0, 40.0)),
        "loss": float(rng.uniform(0.0, 0.1)),
        "reorder": bool(rng.random() < 0.5),
    }


def fly(seed: int) -> Clean:
    """Fly a seed's flight."""
    with tempfile.TemporaryDirectory() as directory:
        try:
            run(scenario(seed), clock="virtual", out=directory, overwrite=True)
        except ScenarioError:
            return Clean(seed, 0.0, ())
        events = [json.loads(line) for line in (Path(directory) / "events.jsonl").read_text().splitlines()]
    health = [each for each in events if each["kind"] == "health"]
    reports = tuple(f"{each['t_s']:.1f} s: {each['vehicle']}: {each['text']}" for each in health)
    return Clean(seed, 3.0 * DURATION_S, reports)


def recorded(path: Path) -> list[Clean]:
    """Return the flights of a file."""
    lines = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return [Clean(seed, flown_s, tuple(alarms)) for seed, flown_s, alarms in lines]


def record(given: argparse.Namespace, path: Path) -> None:
    """Fly what a file doesn't have, and add each flight to it."""
    known = {each.seed for each in recorded(path)}
    wanted = [each for each in range(given.first, given.first + given.flights) if each not in known]
    with path.open("a") as file:
        for each in in_order(fly, wanted, given.workers):
            file.write(json.dumps(each) + "\n")
            file.flush()


def main() -> None:
    """Fly, and print the alarms."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--flights", type=int, default=1000)
    options.add_argument("--first", type=int, default=0, help="the first flight's seed")
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--record", type=Path, metavar="FILE", help="where flights are kept, one a line")
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        path = given.record or Path(directory) / "flights.jsonl"
        record(given, path)
        flights = [each for each in recorded(path) if each.flown_s > 0.0]
    for each in flights:
        for text in each.alarms:
            print(f"seed {each.seed}: {text}")
    alarmed, hours = sum(bool(each.alarms) for each in flights), sum(each.flown_s for each in flights) / 3600.0
    print(f"{alarmed} of {len(flights)} flights without faults had alarms, in {hours:.1f} hours of vehicles' flight")


if __name__ == "__main__":
    main()
