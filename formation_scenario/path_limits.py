"""What a path and its slots ask of vehicles, of the ground and of the fence: the worst place of each, as problems."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask, beside
from flight_model.displacement import SAMPLE_M, STEP_M, sample_places
from flight_model.fence_geometry import CHECKED_M, inside_m, room_m
from flight_model.path import PathPoints, SplinePath
from formation_scenario.begin_and_end import start_states
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import SlotStep, column_names, columns, slot_schedule
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.source import Finding, KeyPath
from formation_scenario.surroundings import Fence, Terrain
from formation_scenario.terrain import LEADER_SHARE, Ground, LiftedPath
from formation_scenario.vehicles import Vehicle, VehicleModel

BETWEEN_SAMPLES_M = 5.0
TOLERANCE = 1e-6
EQUAL = 1e-9
"""Shares that differ by less are equally bad: the first of them is named, whatever their last digits."""
SAME_PLACE_M = 250.0
"""Longest gap between two excesses that count as one place: the two ends of one bend, for instance."""
MOST_PLACES = 10
"""How many places are reported each by itself."""
WAYPOINTS: KeyPath = ("path", "waypoints_m")
OFF_M = 0.01
"""By how much heights may exceed a limit, and clearances fall short."""
Flyers = dict[tuple[float, float, float], tuple[str, Vehicle]]
"""Who flies at each place of the formations: forward, right and up of the leader."""
LEVEL_M = 1.0
"""Largest height of the ground at a take-off, above or below the origin: the emulators' ground is level."""


class SampledPath(NamedTuple):
    """A path that is sampled: its arc lengths (K,), its points there, and the index of the waypoint nearest to each."""

    places_m: Array
    points: PathPoints
    waypoints: Array

    @classmethod
    def along(cls, path: SplinePath, from_m: float = 0.0) -> SampledPath:
        """Sample a path from `from_m` to its end."""
        uniform = np.linspace(from_m, path.length_m, int((path.length_m - from_m) / BETWEEN_SAMPLES_M) + 2)
        places = np.array(sorted({*uniform.tolist(), *path.nodes_m[path.nodes_m >= from_m].tolist()}))
        middles = (path.waypoints_at_m[1:] + path.waypoints_at_m[:-1]) / 2.0
        return cls(places, path.at(places), np.searchsorted(middles, places).astype(np.float64))

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
    """What is asked of one limit: shares of it (K, N), too much above 1, the figures (K, N) and their unit."""

    limit: str
    unit: str
    share: Array
    figure: Array
    step: SlotStep | None


def excesses(scenario: Scenario, sampled: SampledPath, steps: tuple[SlotStep, ...]) -> list[Finding]:
    """Return what is outside some vehicle's limits: the path's speed, or else up to `MOST_PLACES` places."""
    speed = list(_speed(scenario))
    if speed:
        return speed
    places = [*climbs(scenario, sampled), *_bends(scenario, sampled, steps)]
    rest = len(places) - MOST_PLACES
    return [*places[:MOST_PLACES], *([(WAYPOINTS, f"found {rest} more places like these", "")] if rest > 0 else [])]


def climbs(scenario: Scenario, sampled: SampledPath) -> Iterator[Finding]:
    """Yield the steepest point of each stretch that climbs or descends faster than some vehicle can."""
    weakest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.climb_max_mps)
    most_mps = weakest.model.climb_max_mps
    climb_mps = scenario.path.speed_mps * sampled.points.slope
    for stretch in sampled.stretches(np.abs(climb_mps) > most_mps * (1.0 + TOLERANCE)):
        index = stretch.start + int(np.argmax(np.abs(climb_mps[stretch])))
        found = f"{'climbs' if climb_mps[index] > 0 else 'descends'} {abs(climb_mps[index]):.3g} m/s"
        allowed = f"up to {most_mps:g} m/s, vehicle {weakest.vehicle_id}'s climb_max_mps"
        yield sampled.finding(index, found, allowed)


def _speed(scenario: Scenario) -> Iterator[Finding]:
    """Yield the path's speed if some vehicle can't fly it, the leader first."""
    speed = scenario.path.speed_mps
    for vehicle in (each for each in columns(scenario) if each is not None):
        if not vehicle.model.speed_min_mps <= speed <= vehicle.model.speed_max_mps:
            who = "leader" if vehicle is scenario.leader else "vehicle"
            allowed = f"{_speeds(vehicle.model)}, {who} {vehicle.vehicle_id}'s limits"
            yield ("path", "speed_mps"), f"found {speed:g} m/s", allowed
            return


def _bends(scenario: Scenario, sampled: SampledPath, steps: tuple[SlotStep, ...]) -> Iterator[Finding]:
    """Yield the worst demand of each stretch that is too tight: the leader's if it is too tight for the leader."""
    everyone = columns(scenario)
    leading = [_leaders(scenario, sampled, everyone, steps)]
    following = [demand for step in steps for demand in _followers(scenario, sampled, everyone, step)]
    of_leader, of_all = (
        np.any([(each.share > 1.0 + TOLERANCE).any(axis=1) for each in demands], axis=0)
        for demands in (leading, [*leading, *following])
    )
    for stretch in sampled.stretches(of_all):
        demands = leading if of_leader[stretch].any() else following
        worst = max(demands, key=lambda demand: float(demand.share[stretch].max()))
        share = worst.share[stretch]
        row, column = np.argwhere(share >= share.max() * (1.0 - EQUAL))[0]
        who, index = everyone[int(column)], stretch.start + int(row)
        assert who is not None
        over = np.any([(each.share[stretch] > 1.0 + TOLERANCE).any(axis=0) for each in demands], axis=0)
        shape = None if worst.step is None else worst.step.shape
        whose = f"vehicle {who.vehicle_id}'s slot in shape {shape}" if shape else f"leader {who.vehicle_id}"
        more = f", the worst of {int(over.sum())} slots there" if over.sum() > 1 else ""
        found = f"{whose} would need {worst.figure[index, column]:.3g} {worst.unit}{more}"
        yield sampled.finding(index, found, _allowed(worst.limit, who.model, scenario.path.speed_mps))


def _leaders(
    scenario: Scenario, sampled: SampledPath, everyone: Sequence[Vehicle | None], steps: tuple[SlotStep, ...]
) -> _Demand:
    """Return the turn rates of those that lead; slots at rest climb as their leader does."""
    leads = {step.arrangement.leader for step in steps}
    models = [None if who is None or column not in leads else who.model for column, who in enumerate(everyone)]
    most = np.array([np.inf if each is None else each.turn_rate_max_rps for each in models])
    turn = np.abs(scenario.path.speed_mps * sampled.points.curvature_1pm)[:, None] * np.ones(len(everyone))
    return _Demand("turn", "rad/s of turn", turn / most, turn, None)


def _followers(
    scenario: Scenario, sampled: SampledPath, everyone: Sequence[Vehicle | None], step: SlotStep
) -> Iterator[_Demand]:
    """Yield what a formation's slots ask of each limit."""
    flight = LeaderFlight.along(sampled.points, scenario.path.speed_mps)
    needs = slot_needs(flight, SlotMotion.at_rest(step.places_m), scenario.formation.frame)
    speed, turn, accel = needs.speed_mps, np.abs(needs.turn_rate_rps), np.abs(needs.accel_mps2)
    leader, at_mps = step.arrangement.leader, scenario.path.speed_mps
    models = [None if who is None or column == leader else who.model for column, who in enumerate(everyone)]
    slowest, fastest = np.array([(0.0, np.inf) if each is None else each.soon_mps(at_mps) for each in models]).T
    turn_most = np.array([np.inf if each is None or each.hovers else each.turn_rate_max_rps for each in models])
    accel_most = np.array([np.inf if each is None else each.accel_max_mps2 for each in models])
    yield _Demand("speed", "m/s", speed / fastest, speed, step)
    yield _Demand("speed", "m/s", slowest / np.maximum(speed, TOLERANCE), speed, step)
    yield _Demand("turn", "rad/s of turn", turn / turn_most, turn, step)
    yield _Demand("accel", "m/s² of acceleration", accel / accel_most, accel, step)


def _allowed(limit: str, model: VehicleModel, speed_mps: float) -> str:
    slowest, fastest = model.soon_mps(speed_mps)
    soon = "" if fastest == model.speed_max_mps else f", as it soon flies of {_speeds(model)} (prompt_share)"
    return {
        "speed": f"{slowest:.3g} to {fastest:.3g} m/s{soon}" if soon else _speeds(model),
        "turn": f"up to {model.turn_rate_max_rps:g} rad/s",
        "accel": f"up to {model.accel_max_mps2:g} m/s²",
    }[limit]


def _speeds(model: VehicleModel) -> str:
    return f"{model.speed_min_mps:g} to {model.speed_max_mps:g} m/s"


def place_of(points: PathPoints, index: int) -> str:
    """Return a point of the path in words."""
    return f"north {points.north_m[index]:.0f}, east {points.east_m[index]:.0f}, height {points.height_m[index]:.0f}"


def check_terrain(scenario: Scenario) -> list[Finding]:
    """Return the reasons why the formation can't clear the ground, each with the place where it is worst."""
    terrain = scenario.terrain
    if terrain is None:
        return list(_over_plain(scenario))
    ground, flat = scenario.ground, scenario.path.written
    begin_m = -scenario.run_in_m
    places = np.concatenate((np.arange(begin_m, 0.0, SAMPLE_M), sample_places(0.0, int(flat.length_m / STEP_M))))
    points = flat.at(places)
    unknown = list(_unknown_ground(scenario, ground, places, points))
    if unknown:
        return unknown
    height_m = ground.height(points.north_m, points.east_m)
    begun = [*_take_off(scenario, ground), *_run_in(terrain, places, points, height_m)]
    return begun or list(_clearance(scenario, terrain, ground))


def _over_plain(scenario: Scenario) -> Iterator[Finding]:
    """Yield the lowest point of any vehicle if it is below the clearance: over a plain, paths aren't lifted."""
    path, least_m = scenario.path.written, scenario.safety.clearance_m
    points = path.at(sample_places(0.0, int(path.length_m / STEP_M)))
    worst = int(np.argmin(points.height_m))
    below_m, who = min((float(step.places_m[:, 2].min()), step.shape) for step in slot_schedule(scenario))
    height_m = float(points.height_m[worst]) + min(below_m, 0.0)
    if height_m < least_m - OFF_M:
        whose = f"the lowest slot of shape {who}" if below_m < 0.0 else "the leader"
        found = f"{place_of(points, worst)}: {whose} is {height_m:.1f} m above the ground"
        yield WAYPOINTS, found, f"{least_m:g} m or more (safety.clearance_m)"


def _unknown_ground(scenario: Scenario, ground: Ground, places: Array, points: PathPoints) -> Iterator[Finding]:
    """Yield the first point of the path below which, or below a slot at which, the file has no value."""
    everyone, slots = column_names(scenario), {(0.0, 0.0, 0.0): "the leader"}
    for step in slot_schedule(scenario):
        for who, (forward, right, up) in zip(everyone, step.places_m.tolist(), strict=True):
            slots.setdefault((forward, right, up), f"{who} in shape {step.shape}")
    for slot, who in slots.items():
        north, east = beside(points.north_m, points.east_m, points.course_rad, slot[0], slot[1])
        void = np.flatnonzero(np.isnan(ground.height(north, east)))
        if void.size:
            first = int(void[0])
            place = f"north {north[first]:.0f}, east {east[first]:.0f}"
            found = f"found no elevation under {who} at {places[first]:.0f} m of the path ({place})"
            yield ("terrain", "file"), found, "a file that covers the path and every slot, without voids"
            return


def _take_off(scenario: Scenario, ground: Ground) -> Iterator[Finding]:
    """Yield the first take-off of an emulated vehicle on ground that isn't as high as the origin."""
    if scenario.start.in_air:
        return
    places = np.array([(each.north_m, each.east_m) for each in start_states(scenario)])
    height_m = ground.height(*places.T)
    for vehicle, ground_m in zip(scenario.vehicles, height_m.tolist(), strict=True):
        if vehicle.autopilot == "emulator" and not abs(ground_m) <= LEVEL_M:
            found = f"found ground at {ground_m:.0f} m where emulated vehicle {vehicle.vehicle_id} would take off"
            yield ("terrain",), found, "the origin's height there, 0 ± 1 m, or start.in_air: true"
            return


def _run_in(terrain: Terrain, places: Array, points: PathPoints, height_m: Array) -> Iterator[Finding]:
    """Yield the lowest clearance on the level run-in, which isn't lifted, and at the path's start."""
    before = np.flatnonzero(places <= 0.0)
    clearance = points.height_m[before] - height_m[before]
    worst = int(np.argmin(clearance))
    if clearance[worst] < terrain.clearance_m - OFF_M:
        where = "the path's start" if places[worst] == 0.0 else f"{-places[worst]:.0f} m before the path's start"
        found = f"{place_of(points, worst)}: {clearance[worst]:.1f} m above the ground at {where}"
        yield (*WAYPOINTS, 0), found, _least(terrain)


def _clearance(scenario: Scenario, terrain: Terrain, ground: Ground) -> Iterator[Finding]:
    """Yield the lowest clearance of a path that can't be lifted as far as it should be."""
    path = scenario.leader_path
    assert isinstance(path, LiftedPath)
    if path.lift.short_m <= OFF_M:
        return
    places = np.arange(0.0, path.length_m, SAMPLE_M)
    points = path.at(places)
    clearance = points.height_m - ground.height(points.north_m, points.east_m)
    worst = int(np.argmin(clearance))
    climb_mps = LEADER_SHARE * min(vehicle.model.climb_max_mps for vehicle in scenario.vehicles)
    found = (
        f"path at {places[worst]:.0f} m ({place_of(points, worst)}): {clearance[worst]:.1f} m above the ground, "
        f"{terrain.clearance_m - clearance[worst]:.1f} m too low, with climbs of {climb_mps:.3g} m/s from its start on"
    )
    yield WAYPOINTS, found, f"{_least(terrain)}, or a higher start"


def _least(terrain: Terrain) -> str:
    return f"{terrain.clearance_m:g} m or more (terrain.clearance_m)"


def check_fence(scenario: Scenario, path: SplinePath, steps: tuple[SlotStep, ...], from_m: float) -> Iterator[Finding]:
    """Yield the worst place of each limit of the fence, from `from_m` on the path; from its start: with the run-in."""
    fence = scenario.safety.fence
    if fence is None:
        return
    begin_m = -scenario.run_in_m if from_m <= 0.0 else from_m
    sampled, flyers = SampledPath.along(path, begin_m), _flyers(scenario, steps)
    yield from _fence_heights(fence, sampled, flyers)
    if fence.corners_m is not None:
        yield from _fence_sides(np.array(fence.corners_m), scenario, sampled, flyers)


def _flyers(scenario: Scenario, steps: tuple[SlotStep, ...]) -> Flyers:
    found: Flyers = {}
    for step in steps:
        for column, vehicle in enumerate(columns(scenario)):
            if vehicle is not None:
                leads = column == step.arrangement.leader
                who = "the leader" if leads else f"vehicle {vehicle.vehicle_id}'s slot in shape {step.shape}"
                forward, right, up = step.places_m[column].tolist()
                found.setdefault((forward, right, up), (who, vehicle))
    return found


def _fence_heights(fence: Fence, sampled: SampledPath, flyers: Flyers) -> Iterator[Finding]:
    lowest, highest = min(flyers, key=lambda place: place[2]), max(flyers, key=lambda place: place[2])
    height_m, (least_m, most_m) = sampled.points.height_m, fence.heights_m
    for place, index, limit, key in (
        (lowest, int(height_m.argmin()), least_m, "height_min_m"),
        (highest, int(height_m.argmax()), most_m, "height_max_m"),
    ):
        found_m = float(height_m[index]) + place[2]
        if found_m < limit - OFF_M if key == "height_min_m" else found_m > limit + OFF_M:
            allowed = f"{limit:g} m or {'more' if key == 'height_min_m' else 'less'} (safety.fence.{key})"
            yield sampled.finding(index, f"{flyers[place][0]} is at {found_m:.1f} m", allowed)


def _fence_sides(corners_m: Array, scenario: Scenario, sampled: SampledPath, flyers: Flyers) -> Iterator[Finding]:
    """Yield the place farthest outside; if none is, the one with the least room."""
    points, speed = sampled.points, scenario.path.speed_mps
    forward_m, right_m, _ = np.array(list(flyers)).T[:, :, None]
    places = np.stack(beside(points.north_m, points.east_m, points.course_rad, forward_m, right_m), axis=-1)
    within = inside_m(corners_m, places)
    if within.min() < 0.0:
        who, index = np.unravel_index(int(within.argmin()), within.shape)
        found = f"{list(flyers.values())[who][0]} is {-within.min():.0f} m outside the fence"
        yield sampled.finding(int(index), found, "inside it (safety.fence.corners_m)")
        return
    velocity = speed * np.stack((np.cos(points.course_rad), np.sin(points.course_rad)), axis=-1)
    through_air = speed + scenario.wind.speed_mps
    turn = np.array([vehicle.model.turn_rate_max_rps for _, vehicle in flyers.values()])[:, None]
    room = room_m(corners_m, places, velocity, np.full(within.shape, through_air), turn + 0.0 * within).max(-1)
    if room.min() < CHECKED_M:
        who, index = np.unravel_index(int(room.argmin()), room.shape)
        found = f"{list(flyers.values())[who][0]} is {within[who, index]:.0f} m from the fence and heads for it"
        allowed = f"{CHECKED_M - room.min():.0f} m more room to turn away (safety.fence.corners_m)"
        yield sampled.finding(int(index), found, allowed)
