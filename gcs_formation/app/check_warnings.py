"""What a user should know before flying, as `check` warns of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from flight_model.energy import GRAVITY_MPS2
from formation_scenario import Scenario
from formation_scenario.expectation import SETTLED_M, UNJUDGED_GAP_S
from formation_scenario.feasibility import refused_orders, slots_without_room, unfinished_change
from formation_scenario.feature_folders import brought
from formation_scenario.gains import figures
from formation_scenario.planned_progress import planned_end_s, planned_times_s
from formation_scenario.slot_assignment import vehicles_by_index
from formation_scenario.start_limits import starts_without_room
from gcs_formation.app import (
    check_law,
    check_links,
    check_path,
    check_room,
    check_traces,
)
from gcs_formation.app.loop_delays import configured_loop_delay_s, longest_hold
from gcs_formation.from_scenario import autopilot_for
from gcs_formation.stability import (
    LawMargins,
)
from gcs_formation.stability.mismatch import NEAR, TAUS_OFF

if TYPE_CHECKING:
    pass
from gcs_formation.app.check_law import has_designed_gains

MAX_HZ = 1000.0
"""Largest allowed law.rate_hz."""
STEEP_DEG = 65.0
"""Steepest bank that raises no doubt: the highest FW_R_LIM that PX4 takes; ArduPlane's ROLL_LIMIT_DEG is 45."""
ROOM_M = 2 * SETTLED_M
"""Distance beyond the required separation that two slots need: each vehicle counts as settled within `SETTLED_M`."""
SAME_S = 1e-3
"""Differences of the planned end below which a path isn't said to end early, s: a derived `duration_s` is rounded."""


def warnings(scenario: Scenario, margins: LawMargins, time_constants_off: Mapping[str, float]) -> Iterator[str]:
    """Yield what a user should know before flying.

    `time_constants_off`: the share by which every time constant may be off its model's, by loop.
    """
    yield from _unstable_loops(scenario, margins, time_constants_off)
    for channel, each in figures(scenario).items() if has_designed_gains(scenario) else ():
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
            stable = f"at {delay_s:.3f} s of delay it is stable with time constants up to {share:.0%} off their model's"
            yield f"loop {loop}: {stable}; {TAUS_OFF:.0%} should be"


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
        broken = f"; windows of expect that reach {UNJUDGED_GAP_S:g} s beyond are broken" if scenario.expect else ""
        yield f"duration_s: found {whole_s:g}; the path ends at {planned_s:.4g} s{broken}"
    for i, entry in enumerate(scenario.expect):
        if entry.to_s > whole_s + UNJUDGED_GAP_S and until_s >= whole_s:
            yield f"expect.{i}.to_s: found {entry.to_s:g}; {over}, so this is broken"
    times_s = {f"{key}.{{}}.at_s": each_s for key, each_s in planned_times_s(scenario).items()}
    times_s |= {"expect.{}.from_s": [entry.from_s for entry in scenario.expect]}
    for key, each_s in times_s.items():
        yield from (f"{key.format(i)}: found {at_s:g}; {over}" for i, at_s in enumerate(each_s) if at_s >= end_s)
    if text := unfinished_change(scenario, end_s):
        yield text
