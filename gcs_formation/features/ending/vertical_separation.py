# Compiled by mypyc: it runs every tick.

"""Vertical separation of a formation at its end: each vehicle gets a height of its own before any circles.

A vehicle that misses the command to circle thus continues at a height that no other has.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from gcs_formation.controller.controller import FormationController
from gcs_formation.estimation.projection import FORGOTTEN_AFTER_S
from gcs_formation.features.ending.holding_stack import (
    MAX_S,
    FlyingVehicle,
    HoldingStack,
    climbed_out,
    limit_of_climb_s,
)
from gcs_formation.recorder import VehicleLink
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

UNMOVED_S = 5.0
"""Time without an answer before the others' heights are moved out of a vehicle's way: links lose in bursts. Tuned: s; 3
to 10; shown by `python -m benchmarks.endings`."""
CONFIRMED_S = 1.5
"""Time for which a vehicle must seem not to follow before the others' heights are moved out of its way: a doubt is
confirmed or dropped within two checks, 1 s, and each move has them climb above it. Tuned: s; 1 to 3; shown by flights
of PX4's simulator, whose vehicles were doubted for 0.4 to 1 s up to 14 times an ending."""
HOVER_MPS = 0.5
"""Ground speed below which a stopping vehicle counts as hovering. Tuned: m/s; 0.2 to 1; shown by `pytest
tests/gcs_formation/features/ending`."""


class VerticalSeparation:
    """Separates a controller's formation vertically, tick by tick."""

    def __init__(
        self,
        stack: HoldingStack,
        controller: FormationController,
        vehicles: Mapping[VehicleId, Vehicle],
        now: Instant,
        limit_s: float,
        climb_mps: float,
        *,
        stops: bool = False,
    ) -> None:
        """Steer to the heights of `stack` for at most `limit_s`, or longer if heights are reassigned.

        `climb_mps`: climb rate of all vehicles; `stops`: it also lasts until all steered vehicles hover.
        """
        self._stack, self._controller, self._climb_mps, self._stops = stack, controller, climb_mps, stops
        self._vehicles, self._since, self._limit_s = list(vehicles.values()), now, limit_s
        self._fliers = dict[VehicleId, FlyingVehicle]()
        self._obeyed_at = dict[VehicleId, Instant]()
        """When each vehicle last followed its setpoints during the separation."""

    def steer(self, links: list[VehicleLink], now: Instant) -> list[float]:
        """Update all vehicles' states; return the heights (C,) to command now, NaN where there is none."""
        self._fliers = dict[VehicleId, FlyingVehicle]()
        for vehicle in self._vehicles:
            flier = self._flier(vehicle, links, now)
            if flier is not None:
                self._fliers[vehicle.identity] = flier
        if self._stack.assign(self._fliers):
            self._allow_for_climb(now)
        heights_m, given_m = [math.nan] * len(links), self._stack.heights_m
        for vehicle in self._vehicles:
            heights_m[vehicle.index] = given_m.get(vehicle.identity, math.nan)
        return heights_m

    def _allow_for_climb(self, now: Instant) -> None:
        given_m, steered = self._stack.heights_m, ((i, each) for i, each in self._fliers.items() if each.steered)
        climb_m = max((given_m[identity] - each.motion.height_m for identity, each in steered), default=0.0)
        needed_s = seconds_between(self._since, now) + limit_of_climb_s(climb_m, self._climb_mps)
        self._limit_s = max(self._limit_s, min(needed_s, MAX_S))

    def over(self, now: Instant) -> bool:
        """Return whether vehicles may circle, or the time limit is reached."""
        late = seconds_between(self._since, now) >= self._limit_s
        return late or (self._stack.is_separated(self._fliers) and not (self._stops and self._moves()))

    def _moves(self) -> bool:
        """Return whether a steered vehicle doesn't hover yet."""
        steered = (flier.motion for flier in self._fliers.values() if flier.steered)
        return any(math.hypot(motion.north_mps, motion.east_mps) > HOVER_MPS for motion in steered)

    def _flier(self, vehicle: Vehicle, links: list[VehicleLink], now: Instant) -> FlyingVehicle | None:
        motion, index = vehicle.telemetry.motion, vehicle.index
        silent_s = seconds_between(vehicle.connection.last_received, now)
        if motion is None or not vehicle.telemetry.armed or silent_s > FORGOTTEN_AFTER_S:
            return None
        if vehicle.autopilot.climbs_out(vehicle.telemetry):
            motion = climbed_out(motion, vehicle)
            return FlyingVehicle(motion, motion.height_m)
        answers = seconds_between(vehicle.round_trips.received_at(now), now) <= UNMOVED_S
        led = links[index].ready and links[self._controller.plan.leader].ready
        if led and answers and self._follows(vehicle, links[index], now):
            return FlyingVehicle(motion, self._commanded_m(index), steered=True)
        orders_m = self._orders_m(vehicle, index, links, answers=answers)
        heights_m = [motion.height_m, *(height_m for height_m in orders_m if math.isfinite(height_m))]
        return FlyingVehicle(motion, heights_m[-1], (min(heights_m), max(heights_m)))

    def _follows(self, vehicle: Vehicle, link: VehicleLink, now: Instant) -> bool:
        """Return whether a vehicle follows its setpoints, as far as is certain; one that didn't before doesn't yet."""
        if not link.disobeying:
            self._obeyed_at[vehicle.identity] = now
            return True
        obeyed_at = self._obeyed_at.get(vehicle.identity)
        in_doubt = obeyed_at is not None and seconds_between(obeyed_at, now) < CONFIRMED_S
        return in_doubt and not vehicle.may_loiter

    def _orders_m(self, vehicle: Vehicle, index: int, links: list[VehicleLink], *, answers: bool) -> tuple[float, ...]:
        """Return the heights to which a vehicle may be on its way, the last order last; NaN where there was none.

        One that acknowledges its height and doesn't follow keeps it: sinking air may carry it below for as long as it
        lasts, and its present height in place of that would be the next one to sink from.
        """
        if vehicle.member in (Member.HOLDING, Member.RETURNING):
            return self._received_m(index, links), vehicle.holds_at_m
        if not answers:
            return self._received_m(index, links), self._commanded_m(index)
        return (self._commanded_m(index),) if links[index].disobeying else ()

    def _received_m(self, index: int, links: list[VehicleLink]) -> float:
        """Return the height setpoint at the time when a vehicle was last known to receive."""
        _, _, height_m = self._controller.history.commanded(links[index].received_at, index)
        return height_m

    def _commanded_m(self, index: int) -> float:
        tick = self._controller.last_tick
        return math.nan if tick is None else tick.setpoints[index][2]
