"""What a path and its slots demand of vehicles in still air: one problem for each place where it is too much."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.path import PathPoints, SplinePath
from formation_scenario.arrangement import SlotStep, columns
from formation_scenario.errors import Problem
from formation_scenario.model import Scenario
from formation_scenario.slot_motion import Course, SlotMotion, slot_needs
from formation_scenario.source import KeyPath, Source
from formation_scenario.vehicles import Vehicle, VehicleModel

SAMPLE_M = 5.0
TOLERANCE = 1e-6
EQUAL = 1e-9
"""Shares that differ by less are equally bad: the first of them is named, whatever their last digits."""
SAME_PLACE_M = 250.0
"""Longest gap between two excesses that count as one place: the two ends of one bend, for instance."""
MOST_PLACES = 10
"""How many places are reported each by itself."""
WAYPOINTS: KeyPath = ("path", "waypoints_m")


class Flown(NamedTuple):
    """A path that is sampled: its arc lengths (K,), its points there, and the index of the waypoint nearest to each."""

    places_m: Array
    points: PathPoints
    waypoints: Array

    @classmethod
    def along(cls, path: SplinePath, from_m: float = 0.0) -> Flown:
        """Sample a path from `from_m` to its end."""
        uniform = np.linspace(from_m, path.length_m, int((path.length_m - from_m) / SAMPLE_M) + 2)
        places = np.array(sorted({*uniform.tolist(), *path.nodes_m[path.nodes_m >= from_m].tolist()}))
        middles = (path.waypoints_at_m[1:] + path.waypoints_at_m[:-1]) / 2.0
        return cls(places, path.at(places), np.searchsorted(middles, places).astype(np.float64))

    def where(self, index: int) -> str:
        """Return a sample's place in words."""
        north, east, height = (self.points[axis][index] for axis in range(3))
        return f"path at {self.places_m[index]:.0f} m (north {north:.0f}, east {east:.0f}, height {height:.0f})"

    def stretches(self, over: Mask) -> Iterator[slice]:
        """Yield the stretches of the path where `over` (K,) holds, with gaps of up to `SAME_PLACE_M`."""
        indices = np.flatnonzero(over)
        breaks = np.flatnonzero(np.diff(self.places_m[indices]) > SAME_PLACE_M) + 1
        for run in np.split(indices, breaks) if indices.size else []:
            yield slice(int(run[0]), int(run[-1]) + 1)

    def problem(self, source: Source, index: int, found: str, allowed: str) -> Problem:
        """Return a problem at a sample, with the nearest waypoint as its key."""
        return source.problem((*WAYPOINTS, int(self.waypoints[index])), f"{self.where(index)}: {found}", allowed)


class _Demand(NamedTuple):
    """What is asked of one limit: shares of it (K, N), too much above 1, the figures (K, N) and their unit."""

    limit: str
    unit: str
    share: Array
    figure: Array
    step: SlotStep | None


def excesses(scenario: Scenario, source: Source, flown: Flown, steps: tuple[SlotStep, ...]) -> list[Problem]:
    """Return what is outside some vehicle's limits: the path's speed, or else one problem for each place."""
    speed = list(_speed(scenario, source))
    return speed or _first([*climbs(scenario, source, flown), *_bends(scenario, source, flown, steps)], source)


def climbs(scenario: Scenario, source: Source, flown: Flown) -> Iterator[Problem]:
    """Yield the steepest point of each stretch that climbs or descends faster than some vehicle can."""
    weakest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.climb_max_mps)
    most_mps = weakest.model.climb_max_mps
    climb_mps = scenario.path.speed_mps * flown.points.slope
    for stretch in flown.stretches(np.abs(climb_mps) > most_mps * (1.0 + TOLERANCE)):
        index = stretch.start + int(np.argmax(np.abs(climb_mps[stretch])))
        found = f"{'climbs' if climb_mps[index] > 0 else 'descends'} {abs(climb_mps[index]):.3g} m/s"
        allowed = f"up to {most_mps:g} m/s, vehicle {weakest.vehicle_id}'s climb_max_mps"
        yield flown.problem(source, index, found, allowed)


def _speed(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield the path's speed if some vehicle can't fly it, the leader first."""
    speed = scenario.path.speed_mps
    for vehicle in (each for each in columns(scenario) if each is not None):
        if not vehicle.model.speed_min_mps <= speed <= vehicle.model.speed_max_mps:
            who = "leader" if vehicle is scenario.leader else "vehicle"
            allowed = f"{_speeds(vehicle.model)}, {who} {vehicle.vehicle_id}'s limits"
            yield source.problem(("path", "speed_mps"), f"found {speed:g} m/s", allowed)
            return


def _bends(scenario: Scenario, source: Source, flown: Flown, steps: tuple[SlotStep, ...]) -> Iterator[Problem]:
    """Yield the worst demand of each stretch that is too tight: the leader's if it is too tight for the leader."""
    everyone = columns(scenario)
    leading = [_leaders(scenario, flown, everyone, steps)]
    following = [demand for step in steps for demand in _followers(scenario, flown, everyone, step)]
    of_leader, of_all = (
        np.any([(each.share > 1.0 + TOLERANCE).any(axis=1) for each in demands], axis=0)
        for demands in (leading, [*leading, *following])
    )
    for stretch in flown.stretches(of_all):
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
        yield flown.problem(source, index, found, _allowed(worst.limit, who.model))


def _leaders(
    scenario: Scenario, flown: Flown, everyone: Sequence[Vehicle | None], steps: tuple[SlotStep, ...]
) -> _Demand:
    """Return the turn rates of those that lead; slots at rest climb as their leader does."""
    leads = {step.arrangement.leader for step in steps}
    most = _limits(everyone, "turn_rate_max_rps", [column not in leads for column in range(len(everyone))])
    turn = np.abs(scenario.path.speed_mps * flown.points.curvature_1pm)[:, None] * np.ones(len(everyone))
    return _Demand("turn", "rad/s of turn", turn / most, turn, None)


def _followers(
    scenario: Scenario, flown: Flown, everyone: Sequence[Vehicle | None], step: SlotStep
) -> Iterator[_Demand]:
    """Yield what a formation's slots ask of each limit."""
    course = Course.along(flown.points, scenario.path.speed_mps)
    needs = slot_needs(course, SlotMotion.at_rest(step.places_m), scenario.formation.frame)
    free = [column == step.arrangement.leader for column in range(len(everyone))]
    speed, turn, accel = needs.speed_mps, np.abs(needs.turn_rate_rps), np.abs(needs.accel_mps2)
    slowest = _limits(everyone, "speed_min_mps", free, unlimited=0.0)
    yield _Demand("speed", "m/s", speed / _limits(everyone, "speed_max_mps", free), speed, step)
    yield _Demand("speed", "m/s", slowest / np.maximum(speed, TOLERANCE), speed, step)
    turns = [exempt or (who is not None and who.model.hovers) for who, exempt in zip(everyone, free, strict=True)]
    yield _Demand("turn", "rad/s of turn", turn / _limits(everyone, "turn_rate_max_rps", turns), turn, step)
    yield _Demand("accel", "m/s² of acceleration", accel / _limits(everyone, "accel_max_mps2", free), accel, step)


def _limits(everyone: Sequence[Vehicle | None], name: str, free: Sequence[bool], unlimited: float = np.inf) -> Array:
    """Return a limit of each column, (N,); `unlimited` for a virtual leader and for who is `free` of it."""
    each = zip(everyone, free, strict=True)
    bound = [unlimited if who is None or exempt else getattr(who.model, name) for who, exempt in each]
    return np.array(bound, dtype=np.float64)


def _allowed(limit: str, model: VehicleModel) -> str:
    return {
        "speed": _speeds(model),
        "turn": f"up to {model.turn_rate_max_rps:g} rad/s",
        "accel": f"up to {model.accel_max_mps2:g} m/s²",
    }[limit]


def _speeds(model: VehicleModel) -> str:
    return f"{model.speed_min_mps:g} to {model.speed_max_mps:g} m/s"


def _first(problems: list[Problem], source: Source) -> list[Problem]:
    """Return the first `MOST_PLACES` problems, and how many more there are."""
    rest = len(problems) - MOST_PLACES
    more = [source.problem(WAYPOINTS, f"found {rest} more places like these")] if rest > 0 else []
    return [*problems[:MOST_PLACES], *more]
