"""Checks that a scenario can be flown: path, slots, their separation, every change, and orders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flight_model.path import FlightPath, Route
from flight_model.path_offsets import Rise
from formation_scenario.fence_limits import check_fence
from formation_scenario.fields import distinct_texts
from formation_scenario.formation_changes import ahead, plan_change, take_over
from formation_scenario.ground_limits import check_terrain
from formation_scenario.model import Scenario
from formation_scenario.orders import Order, not_standing, read_order, why_not_set_out
from formation_scenario.path_limits import TOLERANCE, excesses
from formation_scenario.sampled_path import SAME_POSITION_M, SampledPath
from formation_scenario.slot_assignment import (
    Arrangement,
    SlotStep,
    assigned,
    first_arrangement,
    names_by_index,
    slot_schedule,
    vehicles_by_index,
)
from formation_scenario.slot_motion import Transition
from formation_scenario.source import KeyPath, dotted
from formation_scenario.start_limits import check_start
from formation_scenario.step_limits import check_steps
from formation_scenario.transition_plan import NotFlyableError
from formation_scenario.violations import Violation


def check(scenario: Scenario) -> list[Violation]:
    """Return all that can't be flown, of every kind at once: each position on the path, each formation, each change."""
    over_ground = check_terrain(scenario)
    unknown = any(each.kind == "ground" for each in over_ground)
    path, steps = scenario.written_path if unknown else scenario.leader_path, slot_schedule(scenario)
    standing = [*over_ground, *_standing(scenario, path, steps, _keys(scenario), 0.0)]
    changes = [each for each in _transitions(scenario, path, steps) if not _within(each.at_m, standing)]
    # Without an offset vehicles start in their slots, of which all has been said.
    starts = check_start(scenario) if any(scenario.start.offset_m) or not standing else ()
    return [*standing, *starts, *check_steps(scenario), *changes]


def _within(at_m: float, violations: Sequence[Violation]) -> bool:
    """Return whether a position on the path is one of violations, so that a change there can't be judged yet."""
    return any(abs(each.at_m - at_m) < SAME_POSITION_M for each in violations)


def check_ahead(scenario: Scenario, step: SlotStep, path: FlightPath, from_m: float) -> list[str]:
    """Return, in words, what of a formation can't be flown on the path from `from_m` on."""
    problems = _standing(scenario, path, (step,), [("formation",)], min(max(from_m, 0.0), path.length_m))
    return [f"{each.found}; allowed: {each.allowed}" for each in problems]


def slots_without_room(scenario: Scenario, room_m: float) -> Iterator[str]:
    """Yield slots whose separation exceeds the limit by less than `room_m`, the margin for errors, with their key."""
    min_m = scenario.safety.separation_m + room_m
    for path, found in _near(scenario, slot_schedule(scenario), _keys(scenario), min_m):
        yield f"{dotted(path)}: {found}"


class _Flown(NamedTuple):
    """The formation between two orders."""

    scenario: Scenario
    arrangement: Arrangement
    facing_rad: float | None = None
    """Heading to which a hovering formation was ordered."""

    def after(self, order: Order) -> _Flown:
        """Return the formation after an order; when it sets out it faces along its path again."""
        return _Flown(
            self.scenario if order.speed_mps is None else self.scenario.at_speed(order.speed_mps),
            self.arrangement if order.change is None else self.arrangement.changed(order.change, self.scenario),
            order.heading_rad if order.heading_rad is not None or order.speed_mps else self.facing_rad,
        )


def refused_orders(scenario: Scenario, why_not_land: str | None = None) -> Iterator[tuple[int, str]]:
    """Yield the planned orders that will be refused, each with its index and the reason, as `check_ahead` gives it.

    The leader is assumed to be on its path in time, and the formation to have changed as planned.

    Args:
        scenario: the scenario.
        why_not_land: why its vehicles can't land, None if they may be able to.
    """
    path, flown, at_m, since_s = scenario.leader_path, _Flown(scenario, first_arrangement(scenario)), 0.0, 0.0
    changes = [(change.at_s, None, Order("", change)) for change in scenario.formation.changes]
    orders = [(order.at_s, index, read_order(order.order)) for index, order in scenario.timed_orders]
    for at_s, index, order in sorted([*changes, *orders], key=lambda entry: entry[0]):
        at_m, since_s = flown.scenario.speeds.later_m(at_m, at_s - since_s), at_s
        lands_not = why_not_land if order.end == "land" else None
        if (order.end is not None and lands_not is None) or at_m > path.length_m:
            return
        reason = lands_not or _why_refused(flown, order, path, at_s, at_m)
        if index is not None and reason:
            yield index, reason
        else:
            flown = flown.after(order)


def _why_refused(flown: _Flown, order: Order, path: FlightPath, at_s: float, at_m: float) -> str | None:
    """Return why an order will be refused at a time and a position on the path; None if it won't."""
    if order.heading_rad is not None:
        speed_mps, _ = flown.scenario.speeds.at(at_m)
        return not_standing(speed_mps) if speed_mps > 0.0 else None
    if order.speed_mps and flown.facing_rad is not None:
        reason = why_not_set_out(flown.facing_rad, path.at(at_m).course_rad)
        if reason:
            return reason
    after = flown.after(order)
    try:
        positions_m = assigned(flown.scenario, after.arrangement, np.zeros((len(vehicles_by_index(flown.scenario)), 3)))
        reasons = check_ahead(after.scenario, SlotStep(at_s, after.arrangement, positions_m), path, at_m)
    except ValueError as error:  # a custom shape without slots
        reasons = [str(error)]
    return reasons[0] if reasons else None


def _standing(
    scenario: Scenario, path: FlightPath, steps: tuple[SlotStep, ...], keys: Sequence[KeyPath], from_m: float
) -> list[Violation]:
    """Return what can't be flown from `from_m` on while the slots don't change."""
    min_m = scenario.safety.separation_m
    near, allowed = _near(scenario, steps, keys, min_m * (1.0 - TOLERANCE)), f"{min_m:g} m or more"
    return [
        *excesses(scenario, SampledPath.along(path, from_m), steps),
        *(Violation(key, found, f"{allowed} (safety.separation_m)", "separation") for key, found in near),
        *_ahead_of_leader(scenario, steps, keys),
        *check_fence(scenario, path, steps, from_m),
    ]


def _transitions(scenario: Scenario, path: FlightPath, steps: tuple[SlotStep, ...]) -> list[Violation]:
    """Return the first change that can't be flown; those after it would start from an unknown formation."""
    for key, at_m, transition in _planned(scenario, path, steps):
        if isinstance(transition, NotFlyableError):
            missed_m = scenario.speeds.later_m(at_m, transition.elapsed_s)
            point = path.at(missed_m)
            where = f"north {point.north_m:.0f}, east {point.east_m:.0f}, height {point.height_m:.0f}"
            found = f"path at {missed_m:.0f} m ({where}): {transition.found}"
            return [Violation(key, found, transition.allowed, "change", at_m=missed_m)]
    return []


def unfinished_change(scenario: Scenario, end_s: float) -> str | None:
    """Return the last change if it is still in progress at the flight's end, `end_s`, and since when; else None."""
    warning = None
    for key, _, transition in _planned(scenario, scenario.leader_path, slot_schedule(scenario)):
        if isinstance(transition, Transition) and transition.at_s < end_s:
            takes = (
                f"it takes {transition.duration_s:.3g} s from {transition.at_s:g} s on, "
                f"and the flight is over at {end_s:.4g} s"
            )
            warning = None if transition.over(end_s) else f"{dotted(key)}: {takes}"
    return warning


def _planned(
    scenario: Scenario, path: FlightPath, steps: tuple[SlotStep, ...]
) -> Iterator[tuple[KeyPath, float, Transition | NotFlyableError]]:
    """Yield the changes that begin on the path, where on it, m, and how they're flown, up to one that can't be.

    A change that begins during another one starts from there.
    """
    transition, leader = Transition.standing(steps[0].positions_m), 0
    for key, step in zip(_keys(scenario)[1:], steps[1:], strict=True):
        at_m = scenario.speeds.later_m(0.0, step.at_s)
        if at_m > path.length_m or step.at_s > scenario.duration_s:
            return
        slots = transition.at(step.at_s)
        flown: Route = path
        speed, _ = scenario.speeds.at(at_m)
        now = scenario.at_speed(speed)
        if step.arrangement.leader != leader:
            leader = step.arrangement.leader
            forward_m, right_m, up_m = slots.position_m[leader].tolist()
            at_m, slots = at_m + forward_m, slots.seen_from(leader)
            flown = take_over(now, path, at_m, right_m, Rise(up_m), slots.reach_m)
        try:
            transition = plan_change(now, slots, step.arrangement, step.at_s, ahead(flown, speed, at_m))
        except NotFlyableError as error:
            yield key, at_m, error
            return
        yield key, at_m, transition


def _near(
    scenario: Scenario, steps: tuple[SlotStep, ...], keys: Sequence[KeyPath], min_m: float
) -> Iterator[tuple[KeyPath, str]]:
    """Yield the two nearest slots of each step if they are nearer than `min_m`, with the key that positions them."""
    everyone = names_by_index(scenario)
    for path, step in zip(keys, steps, strict=True):
        positions = step.positions_m
        distances = np.linalg.norm(positions[:, None] - positions[None, :], axis=-1)
        distances[np.tril_indices(len(positions))] = np.inf
        one, other = np.unravel_index(int(np.argmin(distances)), distances.shape)
        nearest = float(distances[one, other])
        if nearest < min_m:
            leader = step.arrangement.leader
            pair = " and ".join("the leader" if each == leader else everyone[each] for each in (one, other))
            key = "slots_m" if step.shape == "custom" else "spacing_m"
            yield (*path, key), f"found slots of {pair} {distinct_texts(nearest, min_m)[0]} m apart in {step.shape}"


def _ahead_of_leader(scenario: Scenario, steps: tuple[SlotStep, ...], keys: Sequence[KeyPath]) -> Iterator[Violation]:
    if scenario.formation.frame != "follower_heading":
        return
    for path, step in zip(keys, steps, strict=True):
        before = np.flatnonzero(step.positions_m[:, 0] > TOLERANCE)
        if before.size:
            forward = step.positions_m[before[0], 0]
            found = (
                f"found shape {step.shape} with {names_by_index(scenario)[before[0]]}'s slot {forward:.3g} m ahead of "
                "the leader, unstable in follower_heading"
            )
            yield Violation((*path, "shape"), found, "slots behind, or frame: leader_heading or north", "frame")


def _keys(scenario: Scenario) -> list[KeyPath]:
    """Return the key of each step of the slot schedule."""
    changes = scenario.formation.changes
    order = sorted(range(len(changes)), key=lambda index: changes[index].at_s)
    return [("formation",), *(("formation", "changes", index) for index in order)]
