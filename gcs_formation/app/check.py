"""`gcs-formation check`: the resolved scenario, its graph, its delay margins, and its plan. Starts nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from flight_model.energy import GRAVITY_MPS2
from flight_model.frequency_response import MISMATCH
from formation_scenario import Scenario, ScenarioError, dump_scenario
from formation_scenario.expectation import CHANNEL_UNITS, GAP_S, SETTLED_M
from formation_scenario.feasibility import refused_orders, slots_without_room, unfinished_change
from formation_scenario.feature_folders import brought, feature_names
from formation_scenario.gains import AUTO, by_design, figures
from formation_scenario.planned_progress import planned_end_s, planned_times_s
from formation_scenario.slot_assignment import vehicles_by_index
from formation_scenario.start_limits import starts_without_room
from gcs_formation.app import (
    check_budget,
    check_law,
    check_links,
    check_parameters,
    check_path,
    check_room,
    check_traces,
)
from gcs_formation.app.loop_delays import configured_loop_delay_s, longest_hold
from gcs_formation.app.rehearsal.rehearsal import rehearsal_report, rehearsal_text, rehearsal_warnings
from gcs_formation.control.laws import law_kind
from gcs_formation.from_scenario import autopilot_for
from gcs_formation.stability import (
    LawMargins,
    consensus_margins,
    follower_margins,
    law_loops,
    law_margins,
    law_usages,
)
from gcs_formation.stability.mismatch import NEAR, STEP_S, TAUS_OFF, mismatch_margin_with_taus_off, tau_margin
from gcs_formation.stability.stated import stated_margins

if TYPE_CHECKING:
    from formation_scenario.repair import Repair
    from gcs_formation.app.rehearsal.rehearsal import Rehearsal

MAX_HZ = 1000.0
"""Largest allowed law.rate_hz."""
STEEP_DEG = 65.0
"""Steepest bank that raises no doubt: the highest FW_R_LIM that PX4 takes; ArduPlane's ROLL_LIMIT_DEG is 45."""
NO_MARGIN = "# delay margin: – (this law states none; docs/own-law.md)"
ROOM_M = 2 * SETTLED_M
"""Distance beyond the required separation that two slots need: each vehicle counts as settled within `SETTLED_M`."""

MAX_REPAIR_M = 500e3
"""Length of paths that are checked while what would do is searched without `--repair`: some 2 s."""
SAME_S = 1e-3
"""Differences of the planned end below which a path isn't said to end early, s: a derived `duration_s` is rounded."""


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
            {"design": {n: _finite(vars(each)) for n, each in figures(scenario).items()}} if _designed(scenario) else {}
        ),
        "loop_delay_s": configured_loop_delay_s(scenario),
        "path": check_path.path_figures(scenario),
        "assembly": {
            "least_run_in_s": None if flown is None else flown.least_run_in_s,
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
    lines.extend(f"# {line}" for line in (*(() if flown is None else rehearsal_text(flown)), _lap_text(scenario)))
    lines.extend(f"# {line}" for line in check_budget.budget_text(scenario))
    lines.extend(f"# {line}" for line in check_parameters.parameter_text(scenario))
    lines.extend(f"# {line}" for line in (*check_path.path_text(scenario), *common_limits(scenario)))
    lines.append(f"# features: {', '.join(feature_names()) or 'none'}")
    warned = [*warnings(scenario, law_margins(scenario), time_constants_off), *_foretold(scenario, flown)]
    lines.extend(f"# warning: {warning}" for warning in warned)
    return "\n".join(lines)


def _lap_text(scenario: Scenario) -> str:
    found = check_links.holding_pattern(scenario)
    return f"a lap, if the start is missed, takes {found.lap_s:.0f} s (turns of {found.lap_radius_m:.0f} m)"


def _foretold(scenario: Scenario, flown: Rehearsal | None) -> Iterator[str]:
    """Yield what a user should know of what was flown ahead."""
    return (
        iter(()) if flown is None else rehearsal_warnings(scenario, flown, check_links.holding_pattern(scenario).lap_s)
    )


def _designed(scenario: Scenario) -> bool:
    """Return whether the law has PID channels whose gains' figures are known."""
    return law_kind(scenario).has_margins and by_design(scenario)


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


def warnings(scenario: Scenario, margins: LawMargins, time_constants_off: Mapping[str, float]) -> Iterator[str]:
    """Yield what a user should know before flying.

    `time_constants_off`: the share by which every time constant may be off its model's, by loop.
    """
    yield from _unstable_loops(scenario, margins, time_constants_off)
    for channel, each in figures(scenario).items() if _designed(scenario) else ():
        if not math.isfinite(each.peak):
            yield f"law.{channel}: unstable around the aircraft of the vehicles' models; law.gains: auto isn't"
    yield from check_links.split_errors(scenario)
    yield from check_links.narrow_links(scenario)
    yield from check_traces.recorded_delays(scenario)
    yield from check_path.not_flown(scenario)
    yield from check_path.short_legs(scenario)
    yield from check_path.widened_circles(scenario)
    yield from check_room.little_left(scenario)
    yield from of_features(scenario)
    asked = f"{scenario.safety.separation_m:g} m asked for (safety.separation_m)"
    near = [*slots_without_room(scenario, ROOM_M), starts_without_room(scenario, ROOM_M)]
    yield from (f"{found}, {asked}: no {ROOM_M:g} m left for errors" for found in near if found)
    for found in (
        check_law.ahead_of_virtual,
        check_law.of_different_instants,
        check_law.slow_answer,
        steep_turns,
        slots_of_no_shape,
        check_links.bursts_of_nothing,
        check_links.too_old,
        check_links.too_old_after_a_loss,
        check_links.refused_rate,
        check_links.no_time_for_a_pattern,
        check_links.cramped_pattern,
        check_links.nothing_comes,
    ):
        if text := found(scenario):
            yield text
    yield from never_reached(scenario)
    yield from doomed_orders(scenario)
    yield from check_path.far_from_legs(scenario)


def of_features(scenario: Scenario) -> Iterator[str]:
    """Yield what features have to say before a flight."""
    for module in brought("check_warnings"):
        for warning in module.WARNINGS:
            yield from warning(scenario)


def _unstable_loops(scenario: Scenario, margins: LawMargins, time_constants_off: Mapping[str, float]) -> Iterator[str]:
    """Yield loops that are unstable or close to it.

    With prediction the margin limits two things only: the mismatch of the predicted delay, and the hold of a setpoint
    until the next one, because nothing predicted is corrected meanwhile. A hold lasts half a tick on average, longer
    where setpoints are lost.
    """
    delay_s, lossy_s = configured_loop_delay_s(scenario), configured_loop_delay_s(scenario, lossy=True)
    hold, lost = longest_hold(scenario), " on average, losses included," if lossy_s > delay_s else ""
    dead_s = max(each.model.dead_time_s for each in scenario.vehicles)
    for loop, left_s in margins.small_signal.items():
        margin_s = left_s + dead_s if scenario.law.delay_compensation else left_s
        if margin_s <= 0 and left_s + dead_s > 0:
            yield f"loop {loop} is unstable by a dead time of {dead_s:g} s alone, without any delay of the link"
        elif margin_s <= 0:
            yield f"loop {loop} is unstable without any delay"
        elif lossy_s > NEAR * margin_s and not scenario.law.delay_compensation:
            used = f"{lossy_s / margin_s:.0%} of its margin {margin_s:.3f} s"
            yield f"loop {loop}: {lossy_s:.3f} s of delay{lost} is {used}"
        elif hold.mean_s > NEAR * margin_s:
            held = f"{hold}, {hold.mean_s / margin_s:.0%} of its margin {margin_s:.3f} s"
            enough_hz = math.ceil(100.0 * hold.ticks / (NEAR * margin_s)) / 100.0
            enough = f"law.rate_hz of {enough_hz:g} or more does" if enough_hz <= MAX_HZ else "lower gains do"
            yield f"loop {loop}: {held}; no prediction makes up for that, {enough}"
    for loop, share in time_constants_off.items():
        if share < TAUS_OFF and margins.small_signal.get(loop, math.inf) > 0.0:
            stands = f"at {delay_s:.3f} s of delay it is stable with time constants up to {share:.0%} off their model's"
            yield f"loop {loop}: {stands}; {TAUS_OFF:.0%} should be"


def steep_turns(scenario: Scenario) -> str | None:
    """Return a warning of a fixed wing's turn rate that takes too steep a bank, as degrees given as radians do.

    In a coordinated turn the bank is atan(speed * turn rate / g). None if none is too steep.
    """
    speed_mps = scenario.path.fastest_mps
    for vehicle in (each for each in scenario.vehicles if not each.model.hovers):
        turn_rps = vehicle.model.turn_rate_max_rps
        bank = math.degrees(math.atan(speed_mps * turn_rps / GRAVITY_MPS2))
        if bank > STEEP_DEG:
            max_rps = GRAVITY_MPS2 * math.tan(math.radians(STEEP_DEG)) / speed_mps
            found = f"vehicle {vehicle.vehicle_id}'s model.turn_rate_max_rps: found {turn_rps:g} rad/s"
            return f"{found}, a bank of {bank:.0f}° at {speed_mps:g} m/s; {STEEP_DEG:g}° are {max_rps:.2g} rad/s"
    return None


def slots_of_no_shape(scenario: Scenario) -> str | None:
    """Return a warning that `slots_m` is given but no planned shape uses it; an order still may. None otherwise."""
    formation = scenario.formation
    flown = dict.fromkeys([formation.shape, *(each.shape for each in formation.changes if each.shape)])
    if formation.slots_m is None or "custom" in flown:
        return None
    return f"formation.slots_m: found slots; shape {', '.join(flown)} has its own, only custom has these"


def doomed_orders(scenario: Scenario) -> Iterator[str]:
    """Yield the planned orders that will be refused, and why, as far as that is known before the flight."""
    flown = [] if not scenario.timed_orders else [each for each in vehicles_by_index(scenario) if each is not None]
    unable = next((each for each in flown if each.landing is None and not autopilot_for(each, scenario).land()), None)
    why_not = None if unable is None else f"vehicle {unable.vehicle_id} can't land by itself; allowed: rtl, loiter"
    named = dict(scenario.timed_orders)
    for index, reason in refused_orders(scenario, why_not):
        yield f"orders.{index}: '{named[index].order}' will be refused: {reason}"


def never_reached(scenario: Scenario, until_s: float = math.inf) -> Iterator[str]:
    """Yield what is planned for after the end of the flight: the rest of `duration_s`, windows, events, a change.

    `until_s`: the mission time at which `--until` ends the flight; windows that this cuts short are left out.
    """
    planned_s, whole_s = planned_end_s(scenario), scenario.duration_s
    end_s = min(planned_s, until_s)
    over = f"the flight is over at {end_s:.4g} s"
    if planned_s < min(whole_s, until_s) - SAME_S:
        broken = f"; windows of expect that reach {GAP_S:g} s beyond are broken" if scenario.expect else ""
        yield f"duration_s: found {whole_s:g}; the path ends at {planned_s:.4g} s{broken}"
    for i, entry in enumerate(scenario.expect):
        if entry.to_s > whole_s + GAP_S and until_s >= whole_s:
            yield f"expect.{i}.to_s: found {entry.to_s:g}; {over}, so this is broken"
    times_s = {f"{key}.{{}}.at_s": each_s for key, each_s in planned_times_s(scenario).items()}
    times_s |= {"expect.{}.from_s": [entry.from_s for entry in scenario.expect]}
    for key, each_s in times_s.items():
        yield from (f"{key.format(i)}: found {at_s:g}; {over}" for i, at_s in enumerate(each_s) if at_s >= end_s)
    if text := unfinished_change(scenario, end_s):
        yield text


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
    if not _designed(scenario):
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
