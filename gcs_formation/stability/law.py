"""Delay margins of whichever law a scenario flies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from airlink.identity import VehicleId
from formation_scenario.model import Scenario
from gcs_formation.arrays import Array
from gcs_formation.stability.consensus import ground_consensus_loops
from gcs_formation.stability.graphs import as_adjacency
from gcs_formation.stability.loops import Loop, LoopMargins, delay_margin
from gcs_formation.stability.pid_loops import follower_loops, leader_loops, scenario_margins


@dataclass(frozen=True, slots=True)
class LawMargins:
    """Margin of each loop by its name, s: at zero error, and the least over all gains that the law can schedule."""

    small_signal: Mapping[str, float]
    worst: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class ConsensusMargins:
    """Delay margins of the consensus law along and across the formation's heading, s."""

    along_s: float
    across_s: float

    def least(self) -> float:
        """The law's margin."""
        return min(self.along_s, self.across_s)


def law_margins(scenario: Scenario) -> LawMargins:
    """Return the margins of the loops that the scenario's law closes: `consensus`, or x, y and z."""
    if scenario.law.type == "consensus":
        margin = {"consensus": consensus_margins(scenario).least()}
        return LawMargins(margin, margin)
    least = scenario_margins(scenario).least
    return LawMargins(_axes(least.small_signal), _axes(least.worst))


def scenario_delay_margin(scenario: Scenario) -> float:
    """Return the delay margin, s, of the loop that has the least, at the small-signal gains."""
    loops = {loop for axes in law_loops(scenario).values() for of_axis in axes.values() for loop in of_axis}
    return min((delay_margin(loop.open_loop()) for loop in loops), default=math.inf)


def law_loops(scenario: Scenario, *, succession: bool = False) -> Mapping[VehicleId, Mapping[str, tuple[Loop, ...]]]:
    """Return, for each vehicle that the law commands, the loops it is part of, by the name of their margin.

    The consensus law closes its loops around all vehicles at once, the leader among them; the others around the
    leader too once another leads, with `succession`.
    """
    if scenario.law.type != "consensus":
        return follower_loops(scenario) | (leader_loops(scenario) if succession else {})
    loops = tuple(dict.fromkeys([*_axis_loops(scenario, "tau_v_s"), *_axis_loops(scenario, "tau_psi_s")]))
    return {vehicle.vehicle_id: {"consensus": loops} for vehicle in scenario.vehicles}


def scenario_adjacency(scenario: Scenario) -> Array:
    """Return the weights of the consensus graph, (N, N) in the order of the scenario's vehicles."""
    return as_adjacency(scenario.law.consensus.graph, len(scenario.vehicles))


def consensus_margins(scenario: Scenario) -> ConsensusMargins:
    """Delay margins of protocol (3) closed through the ground station, on each axis.

    The autopilot's lag is the undelayed damping, 1/tau_v along and 1/tau_psi across; the part of k3 beyond
    it is delayed. Where the vehicles' time constants differ, this is the least margin over them: a lower bound on
    an undirected graph, since every root belongs to a weighted mean of their dampings.
    """
    along, across = (
        min((delay_margin(loop.open_loop()) for loop in _axis_loops(scenario, lag)), default=math.inf)
        for lag in ("tau_v_s", "tau_psi_s")
    )
    return ConsensusMargins(along, across)


def _axis_loops(scenario: Scenario, lag: str) -> list[Loop]:
    """Return the consensus law's loops on the axis that has the autopilot's time constant `lag`."""
    keys, weights = scenario.law.consensus, scenario_adjacency(scenario)
    dampings = sorted({1.0 / float(getattr(vehicle.model, lag)) for vehicle in scenario.vehicles})
    return [loop for c in dampings for loop in ground_consensus_loops(weights, keys.k1, keys.k2, c, keys.k3 - c)]


def _axes(margins: LoopMargins) -> dict[str, float]:
    return {"x": margins.x_s, "y": margins.y_s, "z": margins.z_s}
