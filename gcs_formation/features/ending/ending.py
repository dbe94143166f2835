"""The end of a run: the formation opens in height, then vehicles circle, here or at home, or land.

None goes home that refuses its own height there, which it is commanded before; it circles where it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from formation_scenario.orders import End
from gcs_formation.core.cycle import Cycle
from gcs_formation.features.ending.holding_stack import Ahead, HoldingStack, home_of, motion_of, stacked, stays
from gcs_formation.features.ending.landing_order import LandingOrder, lowest_circle_m
from gcs_formation.features.ending.landings import Landings
from gcs_formation.features.ending.vertical_separation import VerticalSeparation
from gcs_formation.fleet.circle_heights import NO_ORDER, GroundFloor, may_meet
from gcs_formation.mission.ending import EndCommand, Ending, Endings
from gcs_formation.recorder import VehicleLink
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.vehicle import Vehicle

UNANSWERED_FOR_S = 5.0
"""How long a vehicle may leave the command to go home unanswered. Tuned: s; 3 to 15; shown by `pytest
tests/gcs_formation/features/ending`."""


class SeparatedEnding(Ending):
    """Brings every vehicle to a height of its own, then home or to the ground if that was ordered."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        ground: GroundFloor,
        manner: End = "loiter",
        landings: Landings | None = None,
        ahead: Ahead = stays,
        gap_m: float = 0.0,
        sway_m: float = 0.0,
        climb_mps: float = math.inf,
    ) -> None:
        """Choose the height of each vehicle's circle; no vehicle is commanded yet.

        Args:
            vehicles: all of them.
            ground: the ground to keep clear of.
            manner: how the flight ends.
            landings: those of an earlier order to land, where a vehicle is still landing; it is left to that.
            ahead: the path ahead of a formation that is opened; by default vehicles leave where they are.
            gap_m: the distance that vehicles must be apart.
            sway_m: how far the air moves vehicles off their heights, a standard deviation.
            climb_mps: how fast all of them climb.
        """
        super().__init__(vehicles, manner)
        self.landings = landings or Landings(lambda following: LandingOrder(vehicles, ground).why_not_now(following))
        self._ours = {identity: each for identity, each in self._ours.items() if not self.landings.is_pending(each)}
        self.hovers = manner == "loiter" and all(each.autopilot.hovers for each in self._ours.values())
        """Whether all of them hover where they are, and need no separate heights."""
        lowest_m, first = -math.inf, NO_ORDER
        if manner == "land":
            order = LandingOrder(vehicles, ground)
            lowest_m, first = lowest_circle_m(vehicles), NO_ORDER if order.refusal else order.first
        self.stack = HoldingStack(
            gap_m, lowest_m, sway_m=sway_m, together=manner != "loiter", hover=self.hovers, first=first
        )
        homes = {identity: home for identity, each in self._ours.items() if (home := home_of(each))}
        self.limit_s = stacked(self._motions(), self.stack, ground, manner, ahead, climb_mps, homes)
        """Longest time for which the formation is opened."""
        self._gap_m = gap_m
        self._separation: VerticalSeparation | None = None
        """The vertical separation of the formation, if it is commanded until that is over."""

    def open(self, separation: VerticalSeparation) -> None:
        """Begin to separate the formation vertically."""
        self._separation = separation

    def steer(self, links: list[VehicleLink], now: Instant) -> list[float] | None:
        """Return the heights (C,) to command now, NaN where there is none; None if the formation isn't commanded."""
        return None if self._separation is None else self._separation.steer(links, now)

    def may_leave(self, now: Instant) -> bool:
        """Return whether every vehicle that receives has a height of its own, or time is up."""
        return self._separation is None or self._separation.over(now)

    @property
    def failure(self) -> str | None:
        """Why vehicles couldn't land."""
        return self.landings.failure

    @property
    def circles_m(self) -> Mapping[VehicleId, float]:
        """Heights of the circles, m."""
        return self.stack.heights_m

    def leave(self, now: Instant) -> None:
        """Begin to command vehicles to circle or go home; those that have no height yet get one."""
        self.stack.add(self._motions())
        super().leave(now)

    def advance(self, now: Instant) -> None:
        """Command vehicles that may be in the air and have climbed out to loiter or go home; continue the landings."""
        self.command_by_state(now)
        climbs_out = False
        for identity, vehicle in self._ours.items():
            commanded = self._obeys(identity, vehicle)
            if commanded is EndCommand.LEAVE:
                self._watch_way_home(identity, vehicle, now)
            elif commanded is not EndCommand.STAY and vehicle.member is not Member.PARTED:
                climbs_out = climbs_out or self._is_pending(identity, vehicle)
        self.landings.advance(now, climbs_out=climbs_out)

    def _tell(self, identity: VehicleId, vehicle: Vehicle, what: EndCommand, now: Instant) -> None:
        self.landings.drop(vehicle)
        super()._tell(identity, vehicle, what, now)

    def _send_away(self, identity: VehicleId, vehicle: Vehicle, now: Instant) -> None:
        height_m = self._height_m(identity, vehicle)
        vehicle.commands.send(vehicle.autopilot.leave(self.manner, height_m, vehicle.telemetry), now, insist=True)
        if self.manner == "land":
            self.landings.await_turn(vehicle, height_m)

    def _height_m(self, identity: VehicleId, vehicle: Vehicle) -> float:
        """Return the height, m, at which a vehicle circles whose position is known."""
        motion = motion_of(vehicle)
        if motion is not None:
            self.stack.add({identity: motion})
        return self.stack.heights_m[identity]

    def _watch_way_home(self, identity: VehicleId, vehicle: Vehicle, now: Instant) -> None:
        """Let a vehicle that refuses to go home, or its height there, circle here; it leaves when it accepts both.

        A vehicle that doesn't answer circles here too. One that refuses its height on the way home isn't sent there
        again. No vehicle lands if one refuses.
        """
        if self.manner == "loiter":
            return
        autopilot, seen, commands = vehicle.autopilot, vehicle.telemetry, vehicle.commands
        refuses, homeward = commands.refused(now), seen.custom_mode == autopilot.home_mode
        waits = commands.insists and commands.outcome is Outcome.WAITING and not homeward
        if not (refuses or (waits and seconds_between(commands.since, now) > UNANSWERED_FOR_S)):
            return
        if refuses and self.manner == "land":
            self.landings.refuse(f"vehicle {identity} refuses {vehicle.refusal}{seen.last_words}")
        height_m = self._height_m(identity, vehicle)
        here, home = autopilot.loiter(height_m, seen), autopilot.go_home(height_m, seen)
        self._commanded[identity] = EndCommand.STAY, vehicle.restarts
        commands.send(here if homeward else (*here, *home), now, insist=True)

    def _motions(self) -> dict[VehicleId, ReportedMotion]:
        armed = {identity: vehicle for identity, vehicle in self._ours.items() if vehicle.telemetry.armed}
        return {identity: motion for identity, vehicle in armed.items() if (motion := motion_of(vehicle))}

    def hasten(self) -> None:
        """Begin no further landing, and wait for nothing but acknowledgements."""
        super().hasten()
        self.landings.call_off()

    @property
    def _goes_on(self) -> bool:
        return self.landings.under_way

    def at_one_height(self) -> list[str]:
        """Return which pairs of vehicles may circle at one height, with the reason.

        One of the two hasn't acknowledged a height of its own, and by what they reported last their heights are nearer
        than vehicles must be apart. What hovers circles nowhere.
        """
        if self.hovers:
            return []
        flying = {identity: each for identity, each in self._vehicles.items() if each.airborne}
        motions = {identity: motion for identity, each in flying.items() if (motion := each.telemetry.motion)}
        lacking, found = {identity for identity in motions if self._is_pending(identity, flying[identity])}, list[str]()
        for one, other in combinations(motions, 2):
            off_m = abs(motions[one].height_m - motions[other].height_m)
            near = off_m < self._gap_m and may_meet(motions[one], motions[other])
            if near and not lacking.isdisjoint((one, other)):
                who = one if one in lacking else other
                why = f"refuses {refusal}" if (refusal := flying[who].refusal) else "hasn't acknowledged its height"
                found.append(f"vehicles {one} and {other} may circle at heights {off_m:.1f} m apart: {who} {why}")
        return found

    def _is_pending(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        lands = vehicle.connection.talks and self.landings.is_pending(vehicle)
        return lands or super()._is_pending(identity, vehicle)


class SeparatedEndings(Endings):
    """Begins endings of a formation that is separated vertically first."""

    def __init__(self, cycle: Cycle) -> None:
        """Take the vehicles, and what separates them."""
        super().__init__(cycle.vehicles)
        self._scenario, self._controller, self._ground = cycle.scenario, cycle.controller, GroundFloor(cycle.scenario)
        self._climb_mps = min(each.model.climb_max_mps for each in cycle.scenario.vehicles)

    def why_not(self, manner: End) -> str | None:
        """Return why a flight can't be ended in a manner, and what is allowed; None if it can."""
        unable = LandingOrder(self._vehicles, self._ground).refusal if manner == "land" else None
        return f"{unable}; allowed: rtl, loiter" if unable else None

    def start(
        self, manner: End, earlier: Ending | None, loiter_s: float, now: Instant, *, commanded: bool
    ) -> SeparatedEnding:
        """Choose the heights at which vehicles circle, return or wait to land; the formation first separates to them.

        Hovering vehicles are all stopped first: if each braked as its command arrived, they would meet.
        """
        controller, vehicles, climb_mps = self._controller, self._vehicles, self._climb_mps
        landings = earlier.landings.call_off() if isinstance(earlier, SeparatedEnding) else None
        ahead = controller.ahead_m if commanded else stays
        gap_m, sway_m = self._scenario.safety.kept_m, controller.estimator.sway_m
        ending = SeparatedEnding(vehicles, self._ground, manner, landings, ahead, gap_m, sway_m, climb_mps)
        ending.start(now, loiter_s)
        if commanded:
            if ending.hovers:
                controller.guidance.fly_at(0.0)
            limit_s = ending.limit_s
            ending.open(
                VerticalSeparation(ending.stack, controller, vehicles, now, limit_s, climb_mps, stops=ending.hovers)
            )
        return ending
