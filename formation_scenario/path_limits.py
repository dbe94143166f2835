"""Limits of vehicles for a path and its slots: the worst violation of each, as problems."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.legs.heights import Steep
from flight_model.legs.path import LegsPath
from flight_model.stops.timetable import Timetable
from formation_scenario.fields import distinct_texts
from formation_scenario.model import Scenario
from formation_scenario.sampled_path import SAME_POSITION_M, WAYPOINTS, SampledPath
from formation_scenario.slot_assignment import SlotStep, vehicles_by_index
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.turn_limits import climb_limits
from formation_scenario.vehicles import Vehicle, VehicleModel
from formation_scenario.violations import Kind, Violation
from formation_scenario.wind_triangle import over_ground_mps, wind_mps

TOLERANCE = 1e-6
SAME_M = 0.1
EQUAL = 1e-9
"""Relative difference below which two shares count as equal, so that rounding doesn't decide which is named."""
BACK = 4.0
"""Multiple of the turn rate from which on a bend counts as a reversal."""
ROUND_M = 100.0
"""Distance from a reversal within which what slots would need is no matter of its own."""
MIN_OVER_GROUND_MPS = 1.0
"""Least ground speed along a path: with less, a gust decides whether a flight reaches its end."""
SETPOINT = "setpoint"
_KINDS: Mapping[str, Kind] = {
    "turn": "slot turn",
    "speed": "slot speed",
    "accel": "slot acceleration",
    SETPOINT: "slot setpoint",
}


class _Demand(NamedTuple):
    """Demand on one limit: figures (K, N) in a unit, and each vehicle's bound (N,), which they may not exceed."""

    limit: str
    unit: str
    figure: Array
    bound: Array
    step: SlotStep | None
    is_lower_bound: bool = False
    """Whether the bound is the lowest figure allowed."""

    @property
    def share(self) -> Array:
        """(K, N) the share of the limit that is needed, excessive above 1."""
        return self.bound / np.maximum(self.figure, TOLERANCE) if self.is_lower_bound else self.figure / self.bound


def excesses(scenario: Scenario, sampled: SampledPath, steps: tuple[SlotStep, ...]) -> list[Violation]:
    """Return violations of vehicles' limits: the path's speed, also in the wind, and each position's worst."""
    found = [*_crowded(scenario), *_sudden(scenario), *climbs(scenario, sampled)]
    for flown, part in _by_speed(scenario, sampled):
        speed = list(_speed(flown))
        found += [*speed, *_into_wind(flown, part), *_bends(flown, part, steps, too_fast=bool(speed))]
    return found


def _by_speed(scenario: Scenario, sampled: SampledPath) -> Iterator[tuple[Scenario, SampledPath]]:
    """Yield the scenario at each planned speed, with the samples at which that is flown; a change counts for both."""
    speeds = scenario.speeds
    if not speeds.changes:
        yield scenario, sampled
        return
    for speed_mps in speeds.speeds_mps:
        flown = speeds.near(sampled.at_m, speed_mps)
        if flown.any():
            yield scenario.at_speed(speed_mps), sampled.only(flown)


def climbs(scenario: Scenario, sampled: SampledPath) -> Iterator[Violation]:
    """Yield the legs that are too steep, and the steepest point of each other stretch that some vehicle can't climb."""
    written = scenario.written_path
    steep = written.steep if isinstance(written, LegsPath) else dict[int, Steep]()
    yield from _steep_legs(scenario, steep)
    weakest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.climb_max_mps)
    max_mps = weakest.model.climb_max_mps
    climb_mps = over_ground_mps(scenario, sampled.points.course_rad, scenario.speeds.at_each(sampled.at_m))
    climb_mps = climb_mps * sampled.points.slope
    leg = np.searchsorted(written.waypoints_at_m, sampled.at_m)
    over = (np.abs(climb_mps) > max_mps * (1.0 + TOLERANCE)) & ~np.isin(leg, list(steep))
    for stretch in sampled.stretches(over):
        index = stretch.start + int(np.argmax(np.abs(climb_mps[stretch])))
        figure, maximum = distinct_texts(abs(float(climb_mps[index])), max_mps)
        found = f"{'climbs' if climb_mps[index] > 0 else 'descends'} {figure} m/s"
        allowed = f"up to {maximum} m/s, vehicle {weakest.vehicle_id}'s climb_max_mps"
        yield sampled.violation(index, found, allowed, "climb", abs(float(climb_mps[index])) / max_mps - 1.0)


def _crowded(scenario: Scenario) -> Iterator[Violation]:
    """Yield circles without room on the leg before their waypoint."""
    written = scenario.written_path
    for waypoint, short_m in written.crowded_m.items() if isinstance(written, LegsPath) else ():
        found = f"found no room for circles on the leg to it, beside its turns, {short_m:.0f} m are missing"
        allowed = "a longer leg, a smaller radius_m, or none in path.circles"
        at_m = float(written.waypoints_at_m[waypoint])
        yield Violation((*WAYPOINTS, waypoint), found, allowed, "circles", short_m / 10.0, at_m, waypoint)


def _sudden(scenario: Scenario) -> Iterator[Violation]:
    """Yield a first leg too short to brake on from the speed at which the path is begun, of vehicles that hover."""
    planned = scenario.speeds
    if isinstance(planned, Timetable) and planned.lacks_m > SAME_M:
        begin_mps, (passage, flown_mps) = planned.begin_mps, next(iter(planned.flown))
        what = "a stop" if passage.stops else f"a corner at {flown_mps:.3g} m/s"
        found = f"found {passage.begin_m:.0f} m to brake on from {begin_mps:g} m/s before {what}"
        allowed = f"{passage.begin_m + planned.lacks_m:.0f} m or more, or a slower path.speed_mps"
        yield Violation((*WAYPOINTS, passage.waypoint), found, allowed, "path speed", 0.1, passage.begin_m)


def _steep_legs(scenario: Scenario, steep: Mapping[int, Steep]) -> Iterator[Violation]:
    """Yield the legs that are too steep for some vehicle, and the length that each would need."""
    weakest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.climb_max_mps)
    for waypoint, each in steep.items():
        speed_mps = scenario.path.legs_mps[waypoint - 1]
        limits = climb_limits(scenario, speed_mps, math.hypot(*scenario.drift_mps))
        (north_m, east_m, from_m), to = scenario.path.waypoints_m[waypoint - 1 : waypoint + 1]
        rise_m, leg_m = to[2] - from_m, math.hypot(to[0] - north_m, to[1] - east_m)
        straight_m, rounding_m = abs(rise_m) / limits.slope, limits.shortest_rounding_m
        found = f"found a leg of {leg_m:.0f} m that {'climbs' if rise_m > 0 else 'descends'} {abs(rise_m):.1f} m"
        maximum = f"{weakest.model.climb_max_mps:g} m/s, vehicle {weakest.vehicle_id}'s climb_max_mps"
        needed = f"{straight_m + rounding_m:.0f} m or more for that height"
        if straight_m > leg_m:
            found, allowed = f"{found}, {abs(rise_m) / leg_m * speed_mps:.3g} m/s", f"up to {maximum}: {needed}"
        else:  # steep enough only for want of room to change the slope
            allowed = f"{needed}: {straight_m:.0f} m at {maximum}, and {rounding_m:.0f} m to round its ends"
        allowed += ", or path.climb: circle"
        before_m, at_m = scenario.written_path.waypoints_at_m[waypoint - 1 : waypoint + 1].tolist()
        if leg_m >= straight_m + rounding_m > at_m - before_m:
            found += f", of which the turns at its ends leave {at_m - before_m:.0f} m"
        excess = abs(each.slope) / limits.slope - 1.0
        yield Violation((*WAYPOINTS, waypoint), found, allowed, "climb", excess, at_m, waypoint)


def _speed(scenario: Scenario) -> Iterator[Violation]:
    """Yield the path's speed if some vehicle can't fly it, the leader first."""
    speed = scenario.path.begin_mps
    for vehicle in (each for each in vehicles_by_index(scenario) if each is not None):
        slowest, fastest = scenario.speeds_mps(vehicle)
        if not slowest <= speed <= fastest:
            who = "leader" if vehicle is scenario.leader else "vehicle"
            density_altitude = (
                ", in air of the density at origin.alt_m" if slowest > vehicle.model.speed_min_mps else ""
            )
            found, lowest = distinct_texts(speed, slowest, 4)
            found, maximum = distinct_texts(speed, fastest, 4) if speed > fastest else (found, f"{fastest:.4g}")
            allowed = f"{lowest} to {maximum} m/s, {who} {vehicle.vehicle_id}'s limits{density_altitude}"
            excess = max(slowest / speed, speed / fastest) - 1.0 if speed > 0.0 else 1.0
            yield Violation(("path", "speed_mps"), f"found {found} m/s", allowed, "path speed", excess)
            return


def _into_wind(scenario: Scenario, sampled: SampledPath) -> Iterator[Violation]:
    """Yield the position where the wind leaves a leading fixed wing too little ground speed along the path."""
    if scenario.hovers:
        return
    speed, course_rad = scenario.path.begin_mps, sampled.points.course_rad
    flown = f"at {speed:g} m/s of airspeed in a wind of {scenario.wind.speed_mps:.3g} m/s"
    across_mps, over_mps = np.abs(wind_mps(scenario, course_rad)[1]), over_ground_mps(scenario, course_rad, speed)
    if across_mps.max() >= speed:
        index = int(np.argmax(across_mps >= across_mps.max() * (1.0 - EQUAL)))
        found = f"the wind blows {across_mps[index]:.3g} m/s across it"
        yield sampled.violation(index, f"{found}, {flown}", f"less than {speed:g} m/s (path.speed_mps)", "wind")
    elif over_mps.min() < MIN_OVER_GROUND_MPS * (1.0 - TOLERANCE):
        index = int(np.argmax(over_mps <= over_mps.min() + EQUAL))
        found = f"{over_mps[index]:.2g} m/s over the ground is left"
        yield sampled.violation(index, f"{found}, {flown}", f"{MIN_OVER_GROUND_MPS:g} m/s or more", "wind")


def _bends(
    scenario: Scenario, sampled: SampledPath, steps: tuple[SlotStep, ...], *, too_fast: bool
) -> Iterator[Violation]:
    """Yield the worst demand of each stretch on each limit: the leader's turn, and what a bend asks of slots.

    A slot's turn isn't mentioned where the leader's is, a setpoint where the speed is, nor a slot's speed where the
    path's is beyond its limits everywhere (`too_fast`).
    """
    everyone = vehicles_by_index(scenario)
    leading = _leaders(scenario, sampled, everyone, steps)
    turns = list(_worst(scenario, sampled, everyone, [leading]))
    yield from turns
    back_m = sampled.at_m[(leading.share > BACK).any(axis=1)]
    gentle = sampled.only(np.abs(sampled.at_m - _nearest(back_m, sampled.at_m)) > ROUND_M)
    if gentle.at_m.size:
        of_steps = (list(_followers(scenario, gentle, everyone, step)) for step in steps)
        # Of hundreds of steps only those that are too tight somewhere are kept.
        following = [demand for demands in of_steps if _over(demands).any() for demand in demands]
        limits = {limit: [each for each in following if each.limit == limit] for limit in _KINDS}
        speeds = [] if too_fast else list(_worst(scenario, gentle, everyone, limits["speed"]))
        setpoints = [] if too_fast else list(_worst(scenario, gentle, everyone, limits[SETPOINT]))
        yield from _elsewhere(_worst(scenario, gentle, everyone, limits["turn"]), turns)
        yield from _worst(scenario, gentle, everyone, limits["accel"])
        yield from speeds
        yield from _elsewhere(setpoints, speeds)


def _nearest(known_m: Array, to_m: Array) -> Array:
    """Return the nearest of rising distances to each of others; infinite if there are none."""
    ends_m = np.concatenate(([-np.inf], known_m, [np.inf]))
    after = np.searchsorted(ends_m, to_m)
    before_m, after_m = ends_m[np.maximum(after - 1, 0)], ends_m[np.minimum(after, ends_m.size - 1)]
    return np.where(to_m - before_m < after_m - to_m, before_m, after_m)


def _elsewhere(violations: Iterable[Violation], others: Sequence[Violation]) -> Iterator[Violation]:
    """Yield the violations that are at other positions than some others."""
    yield from (each for each in violations if all(abs(each.at_m - other.at_m) > SAME_POSITION_M for other in others))


def _worst(
    scenario: Scenario, sampled: SampledPath, everyone: Sequence[Vehicle | None], demands: Sequence[_Demand]
) -> Iterator[Violation]:
    """Yield the worst of demands on one limit on each stretch where one is excessive."""
    for stretch in sampled.stretches(_over(demands)) if demands else ():
        worst = max(demands, key=lambda demand: float(demand.share[stretch].max()))
        share = worst.share[stretch]
        row, vehicle_index = np.argwhere(share >= share.max() * (1.0 - EQUAL))[0]
        who, index = everyone[int(vehicle_index)], stretch.start + int(row)
        assert who is not None
        figure, bound, excess = (
            float(worst.figure[index, vehicle_index]),
            float(worst.bound[vehicle_index]),
            float(share.max()) - 1.0,
        )
        if worst.step is None and excess > BACK - 1.0:
            yield _reversal(sampled, index, who, scenario.path.begin_mps)
            continue
        beyond = np.any([(each.share[stretch] > 1.0 + TOLERANCE).any(axis=0) for each in demands], axis=0)
        whose = f"vehicle {who.vehicle_id}'s slot in shape {worst.step.shape}" if worst.step else _leader_named(who)
        more = f", the worst of {int(beyond.sum())} slots there" if beyond.sum() > 1 else ""
        found = f"{whose} would need {distinct_texts(figure, bound)[0]} {worst.unit}{more}"
        allowed = _allowed(worst.limit, who.model, scenario.path.begin_mps)
        yield sampled.violation(index, found, allowed, _KINDS[worst.limit] if worst.step else "turn", excess)


def _leader_named(who: Vehicle) -> str:
    return f"leader {who.vehicle_id}"


def _reversal(sampled: SampledPath, index: int, who: Vehicle, speed_mps: float) -> Violation:
    """Return the violation of a bend that no aircraft flies: the path turns back, or round a point."""
    radius_m, min_m = 1.0 / abs(float(sampled.points.curvature_1pm[index])), speed_mps / who.model.turn_rate_max_rps
    found = f"turns back, or sharply, in a radius of {radius_m:.2g} m"
    allowed = f"{min_m:.0f} m or more, {_leader_named(who)}'s turn_rate_max_rps of {who.model.turn_rate_max_rps:g}"
    return sampled.violation(index, found, f"{allowed} rad/s at {speed_mps:g} m/s", "turn", min_m / radius_m - 1.0)


def _over(demands: Iterable[_Demand]) -> Mask:
    """Return at which samples (K,) any demand is excessive."""
    over: Mask = np.any([(each.share > 1.0 + TOLERANCE).any(axis=1) for each in demands], axis=0)
    return over


def _leaders(
    scenario: Scenario, sampled: SampledPath, everyone: Sequence[Vehicle | None], steps: tuple[SlotStep, ...]
) -> _Demand:
    """Return the turn rates of leaders; `climbs` checks their climbs, which slots at rest share."""
    leads = {step.arrangement.leader for step in steps}
    models = [
        None if who is None or vehicle_index not in leads else who.model for vehicle_index, who in enumerate(everyone)
    ]
    maximum = np.array([np.inf if each is None else each.turn_rate_max_rps for each in models])
    turn = np.abs(scenario.path.begin_mps * sampled.points.curvature_1pm)[:, None] * np.ones(len(everyone))
    return _Demand("turn", "rad/s of turn", turn, maximum, None)


def _followers(
    scenario: Scenario, sampled: SampledPath, everyone: Sequence[Vehicle | None], step: SlotStep
) -> Iterator[_Demand]:
    """Yield a formation's demand on each limit."""
    flight = LeaderFlight.along(sampled.points, scenario.path.begin_mps)
    needs = slot_needs(flight, SlotMotion.at_rest(step.positions_m), scenario.formation.frame)
    speed, turn, accel = needs.speed_mps, np.abs(needs.turn_rate_rps), np.abs(needs.accel_mps2)
    leader, at_mps = step.arrangement.leader, scenario.path.begin_mps
    models = [
        None if who is None or vehicle_index == leader else who.model for vehicle_index, who in enumerate(everyone)
    ]
    slowest, fastest = np.array([(0.0, np.inf) if each is None else each.soon_mps(at_mps) for each in models]).T
    turn_max = np.array([np.inf if each is None or each.hovers else each.turn_rate_max_rps for each in models])
    accel_max = np.array([np.inf if each is None else each.accel_max_mps2 for each in models])
    yield _Demand("speed", "m/s", speed, fastest, step)
    yield _Demand("speed", "m/s", speed, slowest, step, is_lower_bound=True)
    yield _Demand("turn", "rad/s of turn", turn, turn_max, step)
    yield _Demand("accel", "m/s² of acceleration", accel, accel_max, step)
    # By (7) an acceleration takes a setpoint that leads the speed by the time constant, and setpoints are limited as
    # speeds are.
    taus_s = np.array([0.0 if each is None else each.tau_v_s for each in models])
    commanded = speed + taus_s * (accel if scenario.hovers else needs.accel_mps2)
    yield _Demand(SETPOINT, "m/s of speed setpoint", commanded, fastest, step)
    yield _Demand(SETPOINT, "m/s of speed setpoint", commanded, slowest, step, is_lower_bound=True)


def _allowed(limit: str, model: VehicleModel, speed_mps: float) -> str:
    slowest, fastest = model.soon_mps(speed_mps)
    soon = "" if fastest == model.speed_max_mps else f", as it soon flies of {_speeds(model)} (prompt_share)"
    return {
        SETPOINT: f"{slowest:.3g} to {fastest:.3g} m/s, speed plus tau_v_s ({model.tau_v_s:g} s) times acceleration",
        "speed": f"{slowest:.3g} to {fastest:.3g} m/s{soon}" if soon else _speeds(model),
        "turn": f"up to {model.turn_rate_max_rps:g} rad/s",
        "accel": f"up to {model.accel_max_mps2:g} m/s²",
    }[limit]


def _speeds(model: VehicleModel) -> str:
    return f"{model.speed_min_mps:g} to {model.speed_max_mps:g} m/s"
