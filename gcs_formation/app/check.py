"""`gcs-formation check`: what a scenario resolves to, its graph and its margins, without starting anything."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from formation_scenario import Scenario, dump_scenario
from gcs_formation.stability import FollowerMargins, loop_delay_s, scenario_margins

NEAR = 0.8
"""Share of the margin from which a configured delay is warned of."""


def check_report(scenario: Scenario) -> dict[str, Any]:
    """Return what `check --json` prints: margins in seconds at the small-signal gains and over the fuzzy range."""
    least = scenario_margins(scenario).least
    return {
        "valid": True,
        "delay_margin_s": _axes(least, "small_signal"),
        "delay_margin_worst_s": _axes(least, "worst"),
        "loop_delay_s": configured_loop_delay_s(scenario),
        "warnings": list(warnings(scenario, least)),
    }


def check_text(scenario: Scenario) -> str:
    """Return the same for a person: the resolved scenario, the graph, a line for every loop, the warnings."""
    margins = scenario_margins(scenario)
    lines = [dump_scenario(scenario).rstrip(), "", "# communication graph: " + graph_text(scenario)]
    lines.append(f"# loop delay as configured: {configured_loop_delay_s(scenario):.3f} s (sampling and hold included)")
    lines.append("# delay margins without prediction, s (small signal / worst over the fuzzy range):")
    for vehicle, each in margins.followers.items():
        axes = ", ".join(
            f"{axis} {getattr(each.small_signal, f'{axis}_s'):.3f} / {getattr(each.worst, f'{axis}_s'):.3f}"
            for axis in "xyz"
        )
        lines.append(f"#   vehicle {vehicle}: {axes}")
    lines.extend(f"# warning: {warning}" for warning in warnings(scenario, margins.least))
    return "\n".join(lines)


def graph_text(scenario: Scenario) -> str:
    """Return who hears whom, through the ground station."""
    followers = ", ".join(str(vehicle.vehicle_id) for vehicle in scenario.followers) or "nobody"
    leader = f"vehicle {scenario.leader.vehicle_id}" if scenario.leader else "the virtual leader"
    return f"star; {leader} is heard by {followers}"


def configured_loop_delay_s(scenario: Scenario) -> float:
    """Return the longest loop delay that the scenario's links make, at any time of the run."""
    rates = (scenario.telemetry.rate_hz, scenario.law.rate_hz)
    delays = [
        (step.uplink.delay_ms / 1e3, step.downlink.delay_ms / 1e3)
        for vehicle in scenario.followers
        for step in scenario.link_steps(vehicle)
    ]
    return max((loop_delay_s(up, down, 0.0, *rates) for up, down in delays), default=loop_delay_s(0, 0, 0, *rates))


def warnings(scenario: Scenario, least: FollowerMargins) -> Iterator[str]:
    """Yield what a user should know before flying."""
    delay_s = configured_loop_delay_s(scenario)
    for axis in "xyz":
        margin_s = getattr(least.small_signal, f"{axis}_s")
        if margin_s <= 0:
            yield f"loop {axis} is unstable without any delay"
        elif delay_s > NEAR * margin_s and not scenario.law.delay_compensation:
            yield f"loop {axis}: {delay_s:.3f} s of delay is {delay_s / margin_s:.0%} of its margin {margin_s:.3f} s"


def _axes(margins: FollowerMargins, which: str) -> dict[str, float | None]:
    chosen = getattr(margins, which)
    values = {axis: getattr(chosen, f"{axis}_s") for axis in "xyz"}
    return {axis: float(value) if np.isfinite(value) else None for axis, value in values.items()}
