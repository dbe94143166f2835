"""`gcs-formation check`: the resolved scenario, its graph, its delay margins, and its plan. Starts nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from flight_model.frequency_response import MISMATCH
from formation_scenario import Scenario, ScenarioError, dump_scenario
from formation_scenario.expectation import CHANNEL_UNITS
from formation_scenario.feature_folders import feature_names
from formation_scenario.gains import AUTO, figures
from gcs_formation.app import (
    check_budget,
    check_links,
    check_parameters,
    check_path,
)
from gcs_formation.app.check_law import has_designed_gains
from gcs_formation.app.check_warnings import warnings
from gcs_formation.app.loop_delays import configured_loop_delay_s
from gcs_formation.app.rehearsal.rehearsal import rehearsal_report, rehearsal_text, rehearsal_warnings
from gcs_formation.control.laws import law_kind
from gcs_formation.stability import (
    consensus_margins,
    follower_margins,
    law_loops,
    law_margins,
    law_usages,
)
from gcs_formation.stability.mismatch import STEP_S, TAUS_OFF, mismatch_margin_with_taus_off, tau_margin
from gcs_formation.stability.stated import stated_margins

if TYPE_CHECKING:
    from formation_scenario.repair import Repair
    from gcs_formation.app.rehearsal.rehearsal import Rehearsal

NO_MARGIN = "# delay margin: – (this law states none; docs/own-law.md)"

MAX_REPAIR_M = 500e3
"""Length of paths that are checked while what would do is searched without `--repair`: some 2 s."""


def check_report(scenario: Scenario, flown: Rehearsal | None = None) -> dict[str, Any]:
    """Return what `check --json` prints: margins in seconds at the small-signal gains and over the fuzzy range.

    `flown`: what was flown ahead; None if nothing was.
    """
    margins = law_margins(scenario)
    time_constants_off, mismatch_off_s = tau_margins(scenario)
    return {
        "valid": True,
        "delay_margin_s": _finite(margins.small_signal) or dict.fromkeys("xyz"),
        "delay_margin_worst_s": _finite(margins.worst) or dict.fromkeys("xyz"),
        "mismatch_margin_s": _finite(mismatch_margins_s(scenario)),
        "lag_margin": _finite(time_constants_off),
        "mismatch_margin_lags_off_s": _finite(mismatch_off_s),
        **(
            {"design": {n: _finite(vars(each)) for n, each in figures(scenario).items()}}
            if has_designed_gains(scenario)
            else {}
        ),
        "loop_delay_s": configured_loop_delay_s(scenario),
        "path": check_path.path_figures(scenario),
        "assembly": {
            "least_run_in_s": None if flown is None else flown.min_run_in_s,
            **check_links.holding_pattern(scenario)._asdict(),
        },
        "budget": check_budget.budget_report(scenario),
        "features": list(feature_names()),
        **({"parameters": files} if (files := check_parameters.parameter_report(scenario)) else {}),
        **({} if flown is None else {"rehearsal": rehearsal_report(flown)}),
        "warnings": [*warnings(scenario, margins, time_constants_off), *_foretold(scenario, flown)],
    }


def refusal_report(error: ScenarioError) -> dict[str, Any]:
    """Return what `check --json` prints for a scenario that can't be flown: each problem with its place."""
    return {"valid": False, "problems": [asdict(problem) for problem in error.problems]}


def repair_report(found: Repair) -> dict[str, Any]:
    """Return what `check --repair --json` prints: whether a scenario that flies was found, and by which changes."""
    return {
        "valid": not found.problems,
        "problems": [asdict(problem) for problem in found.problems],
        "repaired": not found.left,
        "changes": [{"key": each.key, "text": each.text} for each in found.changes],
        "left": [asdict(problem) for problem in found.left],
    }


def check_text(scenario: Scenario, flown: Rehearsal | None = None) -> str:
    """Return the same as text: the resolved scenario, the graph, a line for each loop, the warnings."""
    law_text = _consensus_text if law_kind(scenario).mutual else _followers_text
    own = () if law_kind(scenario).has_margins else _stated_text(scenario)
    lines = [dump_scenario(scenario).rstrip(), "", *law_text(scenario), *own]
    lines.append(f"# loop delay as configured: {configured_loop_delay_s(scenario):.3f} s (sampling and hold included)")
    stood = ", ".join(f"{loop} {_seconds(margin_s)}" for loop, margin_s in mismatch_margins_s(scenario).items())
    time_constants_off, mismatch_off_s = tau_margins(scenario)
    if stood:
        lines.append(f"# mismatch of delay that the predicted loops tolerate there, s: {stood}")
    if time_constants_off:
        lines.append(f"# with every time constant up to {TAUS_OFF:.0%} off: {_listed(mismatch_off_s, '.3f')}")
        lines.append(
            f"# by how much every time constant may be off its model's there: {_listed(time_constants_off, '.0%')}"
        )
    lines.extend(_design_text(scenario))
    lines.extend(f"# {line}" for line in (*(() if flown is None else rehearsal_text(flown)), _pattern_text(scenario)))
    lines.extend(f"# {line}" for line in check_budget.budget_text(scenario))
    lines.extend(f"# {line}" for line in check_parameters.parameter_text(scenario))
    lines.extend(f"# {line}" for line in (*check_path.path_text(scenario), *common_limits(scenario)))
    lines.append(f"# features: {', '.join(feature_names()) or 'none'}")
    warned = [*warnings(scenario, law_margins(scenario), time_constants_off), *_foretold(scenario, flown)]
    lines.extend(f"# warning: {warning}" for warning in warned)
    return "\n".join(lines)


def _pattern_text(scenario: Scenario) -> str:
    found = check_links.holding_pattern(scenario)
    return f"a lap, if the start is missed, takes {found.lap_s:.0f} s (turns of {found.lap_radius_m:.0f} m)"


def _foretold(scenario: Scenario, flown: Rehearsal | None) -> Iterator[str]:
    """Yield what a user should know of what was flown ahead."""
    return (
        iter(()) if flown is None else rehearsal_warnings(scenario, flown, check_links.holding_pattern(scenario).lap_s)
    )


def common_limits(scenario: Scenario) -> Iterator[str]:
    """Yield the limits that all vehicles of a mixed formation can fly within, and which vehicle sets each of them."""
    if all(vehicle.model == scenario.vehicles[0].model for vehicle in scenario.vehicles):
        return
    limits = {"speed_min_mps": max, "speed_max_mps": min, "climb_max_mps": min, "turn_rate_max_rps": min}
    slowest, fastest, climbs, turns = (
        f"{getattr(whose.model, name):g} {'rad/s' if name.endswith('rps') else 'm/s'} (vehicle {whose.vehicle_id})"
        for name, pick in limits.items()
        for whose in [pick(scenario.vehicles, key=lambda vehicle: getattr(vehicle.model, name))]
    )
    yield f"what all vehicles can fly: {slowest} to {fastest}, climbs of {climbs}, turns of {turns}"


def mismatch_margins_s(scenario: Scenario) -> dict[str, float]:
    """Return the mismatch of the longest configured delay, s, that each predicted loop tolerates."""
    if not scenario.law.delay_compensation:
        return {}
    delay_s, found = configured_loop_delay_s(scenario), dict[str, float]()
    for loop, usage in (each for axes in law_usages(scenario).values() for each in axes.items()):
        found[loop] = min(usage.margin_s(delay_s), found.get(loop, np.inf))
    return dict(sorted(found.items()))


def tau_margins(scenario: Scenario) -> tuple[dict[str, float], dict[str, float]]:
    """Return how far each predicted loop tolerates another vehicle than its model, at the longest configured delay.

    First: the share by which every time constant may be off. Second: the tolerated mismatch of the delay, s, with every
    time constant up to `TAUS_OFF` off. A loop that is unstable without delay tolerates neither. Both are empty without
    prediction.
    """
    off, mismatch_s = dict[str, float](), dict[str, float]()
    delay_s = round(configured_loop_delay_s(scenario) / STEP_S) * STEP_S
    predicted = law_loops(scenario).values() if scenario.law.delay_compensation else ()
    unstable = set[str]()
    for axis, loops in {each for axes in predicted for each in axes.items()}:
        for loop in loops:
            unstable |= {axis} if loop.whole_margin_s() <= 0.0 else set()
            off[axis] = min(tau_margin(loop, delay_s), off.get(axis, np.inf))
            mismatch_s[axis] = min(mismatch_margin_with_taus_off(loop, delay_s), mismatch_s.get(axis, np.inf))
    off |= {axis: 0.0 for axis in unstable if axis in off}
    mismatch_s |= {axis: min(0.0, mismatch_s[axis]) for axis in unstable if axis in mismatch_s}
    return dict(sorted(off.items())), dict(sorted(mismatch_s.items()))


def _followers_text(scenario: Scenario) -> Iterator[str]:
    followers = ", ".join(str(vehicle.vehicle_id) for vehicle in scenario.followers) or "none"
    leader = f"vehicle {scenario.leader.vehicle_id}" if scenario.leader else "the virtual leader"
    yield f"# communication graph: star; {leader} is received by {followers}"
    if not law_kind(scenario).has_margins:
        return
    yield "# delay margins without prediction, s (small signal / worst over the fuzzy range):"
    for vehicle, each in follower_margins(scenario).items():
        axes = ", ".join(f"{axis} {_seconds(each.small_signal[axis])} / {_seconds(each.worst[axis])}" for axis in "xyz")
        yield f"#   vehicle {vehicle}: {axes}"


def _stated_text(scenario: Scenario) -> Iterator[str]:
    """Yield the margins that a law from outside states, or that it states none."""
    stated = {vehicle: each.delay_s for vehicle, each in stated_margins(scenario).items() if each.delay_s}
    if not stated:
        yield NO_MARGIN
        return
    yield f"# delay margins without prediction, s, as law {scenario.law.type} states them:"
    for vehicle, margins_s in stated.items():
        yield f"#   vehicle {vehicle}: {', '.join(f'{loop} {_seconds(each)}' for loop, each in margins_s.items())}"


def _consensus_text(scenario: Scenario) -> Iterator[str]:
    graph = scenario.law.consensus.graph
    yield f"# communication graph: {graph if isinstance(graph, str) else 'by its weights'}"
    for vehicle, row in zip(scenario.vehicles, scenario.adjacency, strict=True):
        sources = [f"{scenario.vehicles[q].vehicle_id} ({row[q]:g})" for q in np.flatnonzero(row)]
        yield f"#   vehicle {vehicle.vehicle_id} receives from {', '.join(sources) or 'none'}"
    if not law_kind(scenario).has_margins:
        return
    along_s, across_s = consensus_margins(scenario)
    yield "# delay margin of the consensus without prediction, s:"
    yield f"#   {_seconds(min(along_s, across_s))}: along {_seconds(along_s)}, across {_seconds(across_s)}"


def _design_text(scenario: Scenario) -> Iterator[str]:
    """Yield what the law's gains achieve with the vehicles' own responses, without delay compensation."""
    if not has_designed_gains(scenario):
        return
    whose = "by design" if scenario.law.gains == AUTO else "as given"
    yield f"# gains {whose}, around the vehicles' responses at {scenario.path.begin_mps:g} m/s:"
    for name, each in figures(scenario).items():
        held = f"sensitivity {each.peak:.2f}, delay margin {each.delay_margin_s:.2f} s"
        off = f"sensitivity {each.mismatch_peak:.2f}" if math.isfinite(each.mismatch_peak) else "unstable"
        yield (
            f"#   {name}: bandwidth {each.bandwidth_radps:.2f} rad/s, "
            f"{held if math.isfinite(each.peak) else 'unstable'}; with time scale and gain {MISMATCH:.0%} off: "
            f"{off}; setpoint steps {each.step_sigma:.2g} {CHANNEL_UNITS[name]} (standard deviation, a tick)"
        )


def _seconds(margin_s: float) -> str:
    """Return a margin as it is printed; rounding never gives -0."""
    return f"{round(margin_s, 3) + 0.0:.3f}"


def _listed(margins: Mapping[str, float], form: str) -> str:
    return ", ".join(f"{loop} {margin:{form}}" for loop, margin in margins.items())


def _finite(margins: Mapping[str, float]) -> dict[str, float | None]:
    return {loop: float(value) + 0.0 if np.isfinite(value) else None for loop, value in margins.items()}
