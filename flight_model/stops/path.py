"""The path of legs with stops: the paths of legs between them, one after another, with turns in place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from flight_model.arrays import TURN
from flight_model.legs.circling import Circles
from flight_model.legs.heights import Climbs
from flight_model.legs.joining import TurnRules
from flight_model.legs.path import MIN_LEG_M, LegPlan, LegsPath, Passed
from flight_model.legs.turn import TurnLimits
from flight_model.path import FlightPath, PathError, TurnInPlace
from flight_model.stops.corners import Pass


class StopPlan(NamedTuple):
    """How the legs of a path are flown by vehicles that can hover."""

    passes: Sequence[Pass]
    """How each waypoint but the first and the last is passed."""
    climbs: Sequence[Climbs]
    """Limits of each leg."""
    limits: Sequence[TurnLimits]
    """The tightest turn at each leg's speed, for circles."""
    max_m: float
    circles: Mapping[int, Circles] = MappingProxyType({})


class PathWithStops(LegsPath):
    """Straight legs through waypoints, joined by turns, or by stops at which the leader turns in place.

    At a stop the course jumps. All but `turns_in_place` is as of `LegsPath`; a stop is passed in no length.
    """

    def __init__(self, waypoints_m: Sequence[Sequence[float]], plan: StopPlan) -> None:
        """Take (n, 3) north, east and height in m, n >= 2.

        Raises:
            PathError: two successive waypoints less than 1 m apart horizontally.
        """
        waypoints = np.asarray(waypoints_m, dtype=np.float64)
        short = np.flatnonzero(np.hypot(*np.diff(waypoints[:, :2], axis=0).T) < MIN_LEG_M)
        if short.size:
            raise PathError("found a waypoint less than 1 m from the one before it", int(short[0]) + 1)
        stops = [index for index, each in enumerate(plan.passes, 1) if each.speed_mps == 0.0]
        begins, ends = [0, *stops], [*stops, len(waypoints) - 1]
        runs = [LegsPath(waypoints[a : b + 1], _legs(plan, a, b)) for a, b in zip(begins, ends, strict=True)]
        offsets_m = np.concatenate((np.zeros(1), np.cumsum([each.length_m for each in runs]))).tolist()
        self.passes, self.passed = plan.passes, list[Passed]()
        self.steep, self.crowded_m, self.circle_radii_m, self._circled_m = {}, {}, {}, {}
        for run, first, at_m in zip(runs, begins, offsets_m, strict=False):
            if first:
                self.passed.append(Passed(first, first, "stop", at_m, 0.0))
            self.passed += [
                each._replace(first=first + each.first, last=first + each.last, begin_m=at_m + each.begin_m)
                for each in run.passed
            ]
            self.steep |= {first + index: each for index, each in run.steep.items()}
            self.crowded_m |= {first + index: each for index, each in run.crowded_m.items()}
            self.circle_radii_m |= {first + index: each for index, each in run.circle_radii_m.items()}
        self.nodes = np.concatenate([runs[0].nodes[:1], *(run.nodes[1:] for run in runs)])
        self.nodes_at_m = np.concatenate(
            [np.zeros(1), *(at + run.nodes_at_m[1:] for run, at in zip(runs, offsets_m, strict=False))]
        )
        self.circling_m = [
            (at + begin_m, at + end_m)
            for run, at in zip(runs, offsets_m, strict=False)
            for begin_m, end_m in run.circling_m
        ]
        self.tightest_m = min(each.tightest_m for each in runs)
        nodes_m = np.concatenate(
            [np.zeros(1), *(at + run.nodes_m[1:] for run, at in zip(runs, offsets_m, strict=False))]
        )
        at_m = np.concatenate(
            [np.zeros(1), *(at + run.waypoints_at_m[1:] for run, at in zip(runs, offsets_m, strict=False))]
        )
        coefficients = np.concatenate([each.coefficients for each in runs])
        FlightPath.__init__(self, nodes_m, at_m, coefficients)
        courses = [(run.at(0.0).course_rad, run.at(run.length_m).course_rad) for run in runs]
        self.turns_in_place = tuple(
            TurnInPlace(at, before[1], math.remainder(after[0] - before[1], TURN))
            for at, before, after in zip(offsets_m[1:], courses, courses[1:], strict=False)
        )


def _legs(plan: StopPlan, first: int, last: int) -> LegPlan:
    """Return the plan of the legs from one waypoint to another: each leg has the limits of the corner at its end."""
    limits = [(plan.passes[leg].limits if leg < last - 1 else None) or plan.limits[leg] for leg in range(first, last)]
    circles = {index - first: each for index, each in plan.circles.items() if first < index <= last}
    return LegPlan(TurnRules(limits, plan.max_m), plan.climbs[first:last], circles=circles)
