"""What `check` says of links whose delay up isn't their delay down.

A round trip doesn't tell how it is split, so half of it is taken each way. A vehicle whose uplink takes d longer than
its downlink then has its clock mapped d/2 too early, and is kept where it should have been d/2 ago. What leader and
follower have in common cancels; the rest, (d_follower - d_leader)/2, is a distance along the path.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from formation_scenario import Scenario
from formation_scenario.links import Impairment, LinkStep
from formation_scenario.trace import read_trace_ms
from formation_scenario.vehicles import Vehicle

LEAST_M = 0.05
"""Smallest error that is worth a warning."""


def split_errors(scenario: Scenario) -> Iterator[str]:
    """Yield the largest constant error along the path that each follower is left with, where it is worth saying."""
    if scenario.telemetry.clock == "gnss":
        return
    times_s = sorted({step.at_s for vehicle in scenario.vehicles for step in scenario.link_steps(vehicle)})
    for vehicle in scenario.followers:
        at_s = max(times_s, key=lambda at_s: abs(behind_m(scenario, vehicle, at_s)))
        error_m = behind_m(scenario, vehicle, at_s)
        if abs(error_m) >= LEAST_M:
            yield (
                f"vehicle {vehicle.vehicle_id}: {_split(scenario, vehicle, at_s)}{_leaders(scenario, at_s)} leave a "
                f"constant error of {abs(error_m):.2f} m along the path ({'behind' if error_m > 0 else 'ahead of'} its "
                f"slot{f', from {at_s:g} s on' if at_s else ''}): round trips don't tell how a delay is split, "
                "telemetry.clock: gnss does"
            )


def behind_m(scenario: Scenario, vehicle: Vehicle, at_s: float) -> float:
    """Return how far behind its slot the splits of its link and the leader's leave a follower, m."""
    leader = scenario.leader
    return scenario.path.speed_mps * (_early_s(scenario, vehicle, at_s) - _early_s(scenario, leader, at_s))


def ways_s(step: LinkStep) -> tuple[float, float]:
    """Return the mean delays up and down, s."""
    return _mean_s(step.uplink), _mean_s(step.downlink)


def _early_s(scenario: Scenario, vehicle: Vehicle | None, at_s: float) -> float:
    """Return how much too early a vehicle's clock is mapped; a virtual leader has none."""
    if vehicle is None:
        return 0.0
    up_s, down_s = ways_s(_step(scenario, vehicle, at_s))
    return (up_s - down_s) / 2


def _step(scenario: Scenario, vehicle: Vehicle, at_s: float) -> LinkStep:
    return [step for step in scenario.link_steps(vehicle) if step.at_s <= at_s][-1]


def _split(scenario: Scenario, vehicle: Vehicle, at_s: float) -> str:
    up_s, down_s = ways_s(_step(scenario, vehicle, at_s))
    return f"{1e3 * up_s:g} ms up and {1e3 * down_s:g} ms down"


def _leaders(scenario: Scenario, at_s: float) -> str:
    return f", the leader's {_split(scenario, scenario.leader, at_s)}," if scenario.leader else ""


def _mean_s(way: Impairment) -> float:
    """Return the mean delay of one direction, s; recorded delays are added to the constant one."""
    recorded_ms = float(np.mean(read_trace_ms(Path(way.trace_file)))) if way.trace_file else 0.0
    return (way.delay_ms + recorded_ms) / 1e3
