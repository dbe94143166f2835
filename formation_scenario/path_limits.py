"""Limits of vehicles for a path and its slots: the worst violation of each, as problems."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.legs.heights import Steep
from flight_model.legs.path import LegsPath
from flight_model.path import FlightPath, PathPoints
from formation_scenario.fields import distinct_texts
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import SlotStep, columns
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.source import Finding, KeyPath
from formation_scenario.start_states_and_end_times import over_ground_mps, wind_mps
from formation_scenario.turn_limits import climb_limits
from formation_scenario.vehicles import Vehicle, VehicleModel

BETWEEN_SAMPLES_M = 5.0
TOLERANCE = 1e-6
EQUAL = 1e-9
"""Relative difference below which two shares count as equal, so that rounding doesn't decide which is named."""
SAME_PLACE_M = 250.0
"""Longest gap between two violations that count as one place, such as the two ends of a bend."""
MOST_PLACES = 10
"""Largest number of places that are reported individually."""
LEAST_OVER_GROUND_MPS = 1.0
"""Least ground speed along a path: with less, a gust decides whether a flight reaches its end."""
SETPOINT = "setpoint"
WAYPOINTS: KeyPath = ("path", "waypoints_m")


class SampledPath(NamedTuple):
    """Samples of a path: arc lengths (K,), points, and the index of the nearest waypoint to each."""

    places_m: Array
    points: PathPoints
    waypoints: Array

    @classmethod
    def along(cls, path: FlightPath, from_m: float = 0.0) -> SampledPath:
        """Sample a path from `from_m` to its end."""
        uniform = np.linspace(from_m, path.length_m, int((path.length_m - from_m) / BETWEEN_SAMPLES_M) + 2)
        places = np.array(sorted({*uniform.tolist(), *path.nodes_m[path.nodes_m >= from_m].tolist()}))
        middles = (path.waypoints_at_m[1:] + path.waypoints_at_m[:-1]) / 2.0
        return cls(places, path.at(places), np.searchsorted(middles, places).astype(np.float64))

    def only(self, which: Mask) -> SampledPath:
        """Return the samples in a mask (K,)."""
        return SampledPath(self.places_m[which], self.points.only(which), self.waypoints[which])

    def stretches(self, over: Mask) -> Iterator[slice]:
        """Yield the stretches of the path where `over` (K,) holds, with gaps of up to `SAME_PLACE_M`."""
        indices = np.flatnonzero(over)
        breaks = np.flatnonzero(np.diff(self.places_m[indices]) > SAME_PLACE_M) + 1
        for run in np.split(indices, breaks) if indices.size else []:
            yield slice(int(run[0]), int(run[-1]) + 1)

    def finding(self, index: int, found: str, allowed: str) -> Finding:
        """Return what was found at a sample, with the nearest waypoint as its key."""
        where = f"path at {self.places_m[index]:.0f} m ({place_of(self.points, index)})"
        return (*WAYPOINTS, int(self.waypoints[index])), f"{where}: {found}", allowed


class _Demand(NamedTuple):
    """Demand on one limit: figures (K, N) in a unit, and each vehicle's bound (N,), which they may not exceed."""

    limit: str
    unit: str
    figure: Array
    bound: Array
    step: SlotStep | None
    least: bool = False
    """Whether the bound is the lowest figure allowed."""

    @property
    def share(self) -> Array:
        """(K, N) the share of the limit that is needed, excessive above 1."""
        return self.bound / np.maximum(self.figure, TOLERANCE) if self.least else self.figure / self.bound

    def rank(self, stretch: slice) -> tuple[bool, float]:
        """Return by what the worst demand of a stretch is chosen: what a slot flies comes before its setpoint."""
        share = float(self.share[stretch].max())
        return share > 1.0 + TOLERANCE and self.limit != SETPOINT, share


def excesses(scenario: Scenario, sampled: SampledPath, steps: tuple[SlotStep, ...]) -> list[Finding]:
    """Return violations of vehicles' limits: the path's speed, also in the wind, or else up to `MOST_PLACES` places."""
    parts = list(_by_speed(scenario, sampled))
    speed = [found for flown, part in parts for found in list(_speed(flown)) or list(_into_wind(flown, part))]
    if speed:
        return speed
    places = [
        *_crowded(scenario),
        *climbs(scenario, sampled),
        *(found for flown, part in parts for found in _bends(flown, part, steps)),
    ]
    rest = len(places) - MOST_PLACES
    return [*places[:MOST_PLACES], *([(WAYPOINTS, f"found {rest} more places like these", "")] if rest > 0 else [])]


def _by_speed(scenario: Scenario, sampled: SampledPath) -> Iterator[tuple[Scenario, SampledPath]]:
    """Yield the scenario at each planned speed, with the samples at which that is flown; a change counts for both."""
    speeds = scenario.speeds
    if not speeds.changes:
        yield scenario, sampled
        return
    for speed_mps in speeds.speeds_mps:
        flown = speeds.near(sampled.places_m, speed_mps)
        if flown.any():
            yield scenario.at_speed(speed_mps), sampled.only(flown)


def climbs(scenario: Scenario, sampled: SampledPath) -> Iterator[Finding]:
    """Yield the steepest point of each stretch that climbs or descends faster than some vehicle can, or steep legs."""
    written = scenario.written_path
    if isinstance(written, LegsPath) and written.steep:
        yield from _steep_legs(scenario, written.steep)
        return
    weakest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.climb_max_mps)
    most_mps = weakest.model.climb_max_mps
    climb_mps = over_ground_mps(scenario, sampled.points.course_rad, scenario.speeds.at_each(sampled.places_m))
    climb_mps = climb_mps * sampled.points.slope
    for stretch in sampled.stretches(np.abs(climb_mps) > most_mps * (1.0 + TOLERANCE)):
        index = stretch.start + int(np.argmax(np.abs(climb_mps[stretch])))
        figure, most = distinct_texts(abs(float(climb_mps[index])), most_mps)
        found = f"{'climbs' if climb_mps[index] > 0 else 'descends'} {figure} m/s"
        allowed = f"up to {most} m/s, vehicle {weakest.vehicle_id}'s climb_max_mps"
        yield sampled.finding(index, found, allowed)


def _crowded(scenario: Scenario) -> Iterator[Finding]:
    """Yield circles without room on the leg before their waypoint."""
    written = scenario.written_path
    for waypoint, short_m in written.crowded_m.items() if isinstance(written, LegsPath) else ():
        found = f"found no room for circles on the leg to it, beside its turns, {short_m:.0f} m are missing"
        yield (*WAYPOINTS, waypoint), found, "a longer leg, a smaller radius_m, or none in path.circles"


def _steep_legs(scenario: Scenario, steep: Mapping[int, Steep]) -> Iterator[Finding]:
    """Yield the legs that are too steep for some vehicle, and the length that each would need."""
    weakest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.climb_max_mps)
    for waypoint, each in steep.items():
        speed_mps = scenario.path.legs_mps[waypoint - 1]
        limits = climb_limits(scenario, speed_mps, math.hypot(*scenario.drift_mps))
        (north_m, east_m, from_m), to = scenario.path.waypoints_m[waypoint - 1 : waypoint + 1]
        rise_m, leg_m = to[2] - from_m, math.hypot(to[0] - north_m, to[1] - east_m)
        needed_m = abs(rise_m) / limits.slope + limits.shortest_rounding_m
        found = f"found a leg of {leg_m:.0f} m that {'climbs' if rise_m > 0 else 'descends'} {abs(rise_m):.1f} m"
        flown = f"{abs(each.slope) * speed_mps:.3g} m/s of climb with its rounding"
        most = f"{weakest.model.climb_max_mps:g} m/s, vehicle {weakest.vehicle_id}'s climb_max_mps"
        allowed = f"up to {most}: {needed_m:.0f} m or more for that height, or path.climb: circle"
        yield (*WAYPOINTS, waypoint), f"{found}, {flown}", allowed


def _speed(scenario: Scenario) -> Iterator[Finding]:
    """Yield the path's speed if some vehicle can't fly it, the leader first."""
    speed = scenario.path.begin_mps
    for vehicle in (each for each in columns(scenario) if each is not None):
        slowest, fastest = scenario.speeds_mps(vehicle)
        if not slowest <= speed <= fastest:
            who = "leader" if vehicle is scenario.leader else "vehicle"
            thin = ", in air as thin as at origin.alt_m" if slowest > vehicle.model.speed_min_mps else ""
            found, least = distinct_texts(speed, slowest, 4)
            found, most = distinct_texts(speed, fastest, 4) if speed > fastest else (found, f"{fastest:.4g}")
            allowed = f"{least} to {most} m/s, {who} {vehicle.vehicle_id}'s limits{thin}"
            yield ("path", "speed_mps"), f"found {found} m/s", allowed
            return


def _into_wind(scenario: Scenario, sampled: SampledPath) -> Iterator[Finding]:
    """Yield the place where the wind leaves a leading fixed wing too little ground speed along the path."""
    if scenario.hovers:
        return
    speed, course_rad = scenario.path.begin_mps, sampled.points.course_rad
    flown = f"at {speed:g} m/s of airspeed in a wind of {scenario.wind.speed_mps:.3g} m/s"
    across_mps, over_mps = np.abs(wind_mps(scenario, course_rad)[1]), over_ground_mps(scenario, course_rad, speed)
    if across_mps.max() >= speed:
        index = int(np.argmax(across_mps >= across_mps.max() * (1.0 - EQUAL)))
        found = f"the wind blows {across_mps[index]:.3g} m/s across it"
        yield sampled.finding(index, f"{found}, {flown}", f"less than {speed:g} m/s (path.speed_mps)")
    elif over_mps.min() < LEAST_OVER_GROUND_MPS * (1.0 - TOLERANCE):
        index = int(np.argmax(over_mps <= over_mps.min() + EQUAL))
        found = f"{over_mps[index]:.2g} m/s over the ground is left"
        yield sampled.finding(index, f"{found}, {flown}", f"{LEAST_OVER_GROUND_MPS:g} m/s or more")


def _bends(scenario: Scenario, sampled: SampledPath, steps: tuple[SlotStep, ...]) -> Iterator[Finding]:
    """Yield the worst demand of each stretch that is too tight: the leader's if it is too tight for the leader."""
    everyone = columns(scenario)
    leading = [_leaders(scenario, sampled, everyone, steps)]
    of_leader, following = _over(leading), list[_Demand]()
    of_all = of_leader.copy()
    for step in steps:  # of hundreds only those that are too tight somewhere are kept
        demands = list(_followers(scenario, sampled, everyone, step))
        over = _over(demands)
        if over.any():
            following += demands
            of_all |= over
    for stretch in sampled.stretches(of_all):
        demands = leading if of_leader[stretch].any() else following
        worst = max(demands, key=lambda demand: demand.rank(stretch))
        share = worst.share[stretch]
        row, column = np.argwhere(share >= share.max() * (1.0 - EQUAL))[0]
        who, index = everyone[int(column)], stretch.start + int(row)
        assert who is not None
        too_many = np.any([(each.share[stretch] > 1.0 + TOLERANCE).any(axis=0) for each in demands], axis=0)
        shape = None if worst.step is None else worst.step.shape
        whose = f"vehicle {who.vehicle_id}'s slot in shape {shape}" if shape else f"leader {who.vehicle_id}"
        more = f", the worst of {int(too_many.sum())} slots there" if too_many.sum() > 1 else ""
        figure, bound = float(worst.figure[index, column]), float(worst.bound[column])
        found = f"{whose} would need {distinct_texts(figure, bound)[0]} {worst.unit}{more}"
        yield sampled.finding(index, found, _allowed(worst.limit, who.model, scenario.path.begin_mps))


def _over(demands: Iterable[_Demand]) -> Mask:
    """Return at which samples (K,) any demand is excessive."""
    over: Mask = np.any([(each.share > 1.0 + TOLERANCE).any(axis=1) for each in demands], axis=0)
    return over


def _leaders(
    scenario: Scenario, sampled: SampledPath, everyone: Sequence[Vehicle | None], steps: tuple[SlotStep, ...]
) -> _Demand:
    """Return the turn rates of leaders; `climbs` checks their climbs, which slots at rest share."""
    leads = {step.arrangement.leader for step in steps}
    models = [None if who is None or column not in leads else who.model for column, who in enumerate(everyone)]
    most = np.array([np.inf if each is None else each.turn_rate_max_rps for each in models])
    turn = np.abs(scenario.path.begin_mps * sampled.points.curvature_1pm)[:, None] * np.ones(len(everyone))
    return _Demand("turn", "rad/s of turn", turn, most, None)


def _followers(
    scenario: Scenario, sampled: SampledPath, everyone: Sequence[Vehicle | None], step: SlotStep
) -> Iterator[_Demand]:
    """Yield a formation's demand on each limit."""
    flight = LeaderFlight.along(sampled.points, scenario.path.begin_mps)
    needs = slot_needs(flight, SlotMotion.at_rest(step.places_m), scenario.formation.frame)
    speed, turn, accel = needs.speed_mps, np.abs(needs.turn_rate_rps), np.abs(needs.accel_mps2)
    leader, at_mps = step.arrangement.leader, scenario.path.begin_mps
    models = [None if who is None or column == leader else who.model for column, who in enumerate(everyone)]
    slowest, fastest = np.array([(0.0, np.inf) if each is None else each.soon_mps(at_mps) for each in models]).T
    turn_most = np.array([np.inf if each is None or each.hovers else each.turn_rate_max_rps for each in models])
    accel_most = np.array([np.inf if each is None else each.accel_max_mps2 for each in models])
    yield _Demand("speed", "m/s", speed, fastest, step)
    yield _Demand("speed", "m/s", speed, slowest, step, least=True)
    yield _Demand("turn", "rad/s of turn", turn, turn_most, step)
    yield _Demand("accel", "m/s² of acceleration", accel, accel_most, step)
    # By (7) an acceleration takes a setpoint that leads the speed by the lag, and setpoints are limited as speeds are.
    lags_s = np.array([0.0 if each is None else each.tau_v_s for each in models])
    commanded = speed + lags_s * (accel if scenario.hovers else needs.accel_mps2)
    yield _Demand(SETPOINT, "m/s of speed setpoint", commanded, fastest, step)
    yield _Demand(SETPOINT, "m/s of speed setpoint", commanded, slowest, step, least=True)


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


def place_of(points: PathPoints, index: int) -> str:
    """Return a point of the path in words, its height to a decimetre."""
    north_m, east_m, height_m = points.north_m[index], points.east_m[index], round(points.height_m[index], 1)
    return f"north {north_m:.0f}, east {east_m:.0f}, height {height_m:g}"
