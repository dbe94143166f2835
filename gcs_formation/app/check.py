"""`gcs-formation check`: what a scenario resolves to, its graph and its margins, without starting anything."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from formation_scenario import Scenario, dump_scenario
from formation_scenario.links import LinkStep
from gcs_formation.stability import (
    LawMargins,
    consensus_margins,
    law_margins,
    loop_delay_s,
    scenario_adjacency,
    scenario_margins,
)

NEAR = 0.8
"""Share of the margin from which a configured delay is warned of."""


def check_report(scenario: Scenario) -> dict[str, Any]:
    """Return what `check --json` prints: margins in seconds at the small-signal gains and over the fuzzy range."""
    margins = law_margins(scenario)
    return {
        "valid": True,
        "delay_margin_s": _finite(margins.small_signal),
        "delay_margin_worst_s": _finite(margins.worst),
        "loop_delay_s": configured_loop_delay_s(scenario),
        "warnings": list(warnings(scenario, margins)),
    }


def check_text(scenario: Scenario) -> str:
    """Return the same for a person: the resolved scenario, the graph, a line for every loop, the warnings."""
    law_text = _consensus_text if scenario.law.type == "consensus" else _followers_text
    lines = [dump_scenario(scenario).rstrip(), "", *law_text(scenario)]
    lines.append(f"# loop delay as configured: {configured_loop_delay_s(scenario):.3f} s (sampling and hold included)")
    lines.extend(f"# warning: {warning}" for warning in warnings(scenario, law_margins(scenario)))
    return "\n".join(lines)


def configured_loop_delay_s(scenario: Scenario) -> float:
    """Return the longest loop delay that the scenario's links make, at any time of the run.

    In the consensus law everyone's loop waits for the latest state of all.
    """
    rates = (scenario.telemetry.rate_hz, scenario.law.rate_hz)
    if scenario.law.type == "consensus":
        steps = [step for vehicle in scenario.vehicles for step in scenario.link_steps(vehicle)]
        ways = [(max(up for up, _ in map(_ways_s, steps)), max(down for _, down in map(_ways_s, steps)))]
    else:
        ways = [_ways_s(step) for vehicle in scenario.followers for step in scenario.link_steps(vehicle)]
    return max((loop_delay_s(up, down, 0.0, *rates) for up, down in ways), default=loop_delay_s(0, 0, 0, *rates))


def warnings(scenario: Scenario, margins: LawMargins) -> Iterator[str]:
    """Yield what a user should know before flying. With prediction a margin is one against its mismatch only."""
    delay_s = configured_loop_delay_s(scenario)
    for loop, margin_s in margins.small_signal.items():
        if margin_s <= 0:
            yield f"loop {loop} is unstable without any delay"
        elif delay_s > NEAR * margin_s and not scenario.law.delay_compensation:
            yield f"loop {loop}: {delay_s:.3f} s of delay is {delay_s / margin_s:.0%} of its margin {margin_s:.3f} s"


def _followers_text(scenario: Scenario) -> Iterator[str]:
    followers = ", ".join(str(vehicle.vehicle_id) for vehicle in scenario.followers) or "nobody"
    leader = f"vehicle {scenario.leader.vehicle_id}" if scenario.leader else "the virtual leader"
    yield f"# communication graph: star; {leader} is heard by {followers}"
    yield "# delay margins without prediction, s (small signal / worst over the fuzzy range):"
    for vehicle, each in scenario_margins(scenario).followers.items():
        axes = ", ".join(
            f"{axis} {getattr(each.small_signal, f'{axis}_s'):.3f} / {getattr(each.worst, f'{axis}_s'):.3f}"
            for axis in "xyz"
        )
        yield f"#   vehicle {vehicle}: {axes}"


def _consensus_text(scenario: Scenario) -> Iterator[str]:
    graph = scenario.law.consensus.graph
    yield f"# communication graph: {graph if isinstance(graph, str) else 'by its weights'}"
    for vehicle, row in zip(scenario.vehicles, scenario_adjacency(scenario), strict=True):
        heard = [f"{scenario.vehicles[q].vehicle_id} ({row[q]:g})" for q in np.flatnonzero(row)]
        yield f"#   vehicle {vehicle.vehicle_id} hears {', '.join(heard) or 'nobody'}"
    margins = consensus_margins(scenario)
    yield "# delay margin of the consensus without prediction, s:"
    yield f"#   {margins.least():.3f}: along {margins.along_s:.3f}, across {margins.across_s:.3f}"


def _ways_s(step: LinkStep) -> tuple[float, float]:
    return step.uplink.delay_ms / 1e3, step.downlink.delay_ms / 1e3


def _finite(margins: Mapping[str, float]) -> dict[str, float | None]:
    return {loop: float(value) if np.isfinite(value) else None for loop, value in margins.items()}
