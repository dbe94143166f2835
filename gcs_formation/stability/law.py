"""Delay margins of whichever law a scenario flies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from formation_scenario.model import Scenario
from gcs_formation.arrays import Array
from gcs_formation.stability.consensus import ground_consensus_delay_margin
from gcs_formation.stability.graphs import as_adjacency
from gcs_formation.stability.loops import LoopMargins
from gcs_formation.stability.report import scenario_margins


@dataclass(frozen=True, slots=True)
class LawMargins:
    """Margin of each loop by its name, s: at no error, and the least that the law's own adaptation can make of it."""

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
    return min(law_margins(scenario).small_signal.values())


def scenario_adjacency(scenario: Scenario) -> Array:
    """Return the weights of the consensus graph, (N, N) in the order of the scenario's vehicles."""
    return as_adjacency(scenario.law.consensus.graph, len(scenario.vehicles))


def consensus_margins(scenario: Scenario) -> ConsensusMargins:
    """Delay margins of protocol (3) closed through the ground station, on each axis.

    The autopilot's lag is the undelayed damping, 1/tau_v along and 1/tau_psi across; what k3 asks for beyond it is
    late. Where vehicles' time constants differ, the least over them: a lower bound on an undirected graph, as every
    root belongs to a mean of their dampings.
    """
    models = [vehicle.model for vehicle in scenario.vehicles]
    return ConsensusMargins(
        _axis_margin(scenario, {model.tau_v_s for model in models}),
        _axis_margin(scenario, {model.tau_psi_s for model in models}),
    )


def _axis_margin(scenario: Scenario, lags_s: Iterable[float]) -> float:
    keys, weights = scenario.law.consensus, scenario_adjacency(scenario)
    splits = [(1.0 / lag_s, keys.k3 - 1.0 / lag_s) for lag_s in lags_s]
    return min(
        min(ground_consensus_delay_margin(weights, keys.k1, keys.k2, *split), _group_margin(*split)) for split in splits
    )


def _group_margin(onboard: float, delayed: float) -> float:
    """Return the margin of the speed that all have in common, s + c + d exp(-s tau): infinite unless d > c."""
    if delayed <= onboard:
        return math.inf
    w = math.sqrt(delayed**2 - onboard**2)
    return (math.pi - math.atan2(w, onboard)) / w


def _axes(margins: LoopMargins) -> dict[str, float]:
    return {"x": margins.x_s, "y": margins.y_s, "z": margins.z_s}
