"""The end of a run: the formation opens in height, then vehicles circle, here or at home, or land.

Whether one flies is judged anew at every tick until it leaves: an unknown place isn't the ground. None goes home that
refuses its own height there, which it is told before; it circles where it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from itertools import combinations
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from formation_scenario.orders import End
from gcs_formation.fleet.circle_heights import GroundFloor, may_meet
from gcs_formation.mission.landings import Landings, lowest_circle_m, may_be_armed, why_not_land
from gcs_formation.mission.vertical_separation import Ahead, Stack, home_of, place_of, stacked, stays
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.telemetry import ReportedMotion
from gcs_formation.vehicle.vehicle import Member, Vehicle

LOITER_LIMIT_S = 20.0
"""Longest wait for vehicles to climb out and acknowledge that they loiter."""
UNANSWERED_FOR_S = 5.0
"""How long a vehicle may leave the command to go home unanswered."""


class EndCommand(Enum):
    """What a vehicle is told at the end."""

    NOTHING = "to go on"
    DOWN = "to stay on the ground"
    HOLD = "to circle at the height that it has, which isn't known"
    LEAVE = "to circle at a height of its own, here or at home"
    STAY = "to circle here first, as it refuses to do so at home"


FOR_GOOD: Final = (EndCommand.LEAVE, EndCommand.STAY)
"""Commands that aren't judged anew."""


class Ending:
    """Brings every vehicle to a state in which it may be left alone.

    A vehicle that is taking off climbs out first; one that its pilot has taken over is left to the pilot. Commands are
    insisted on, whatever vehicles answer.
    """

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
            ahead: the way on of a formation that is opened; by default vehicles leave where they are.
            gap_m: the distance that vehicles must be apart.
            sway_m: how far the air moves vehicles off their heights, a standard deviation.
            climb_mps: how fast all of them climb.
        """
        self.landings = landings or Landings(lambda: why_not_land(vehicles, ground))
        commanded = {identity: each for identity, each in vehicles.items() if not each.is_left}
        self._ours = {identity: each for identity, each in commanded.items() if not self.landings.is_pending(each)}
        self.stands = manner == "loiter" and all(each.autopilot.stands for each in self._ours.values())
        """Whether all of them hover where they are, and need no separate heights."""
        lowest_m = lowest_circle_m(vehicles) if manner == "land" else -math.inf
        self.stack = Stack(gap_m, lowest_m, sway_m=sway_m, together=manner != "loiter", stand=self.stands)
        homes = {identity: home for identity, each in self._ours.items() if (home := home_of(each))}
        self.limit_s = stacked(self._places(), self.stack, ground, manner, ahead, climb_mps, homes)
        """Longest time for which the formation is opened."""
        self._loiter_s, self._gap_m = 0.0, gap_m
        self.manner: End = manner
        self._vehicles = vehicles
        self._told: dict[VehicleId, tuple[EndCommand, int]] = {}
        """What each was told, and how often it had restarted then."""
        self._leaving = False
        """Whether vehicles leave; before that only those on the ground are told anything."""

    def begin(self, now: Instant, loiter_s: float = 0.0) -> None:
        """Keep vehicles on the ground there, whatever they were doing; the others loiter for `loiter_s` at the end."""
        self._loiter_s = loiter_s
        self.judge(now)

    def leave(self, now: Instant) -> None:
        """Begin to command vehicles to circle or go home; those that have no height yet get one."""
        self.stack.add(self._places())
        self._leaving = True
        self.advance(now)

    def advance(self, now: Instant) -> None:
        """Command vehicles that may be in the air and have climbed out to loiter or go home; continue the landings."""
        self.judge(now)
        climbs_out = False
        for identity, vehicle in self._ours.items():
            told = self._heeds(identity, vehicle)
            if told is EndCommand.LEAVE:
                self._watch_way_home(identity, vehicle, now)
            elif told is not EndCommand.STAY and vehicle.member is not Member.PARTED:
                climbs_out = climbs_out or self._is_pending(identity, vehicle)
        self.landings.advance(now, climbs_out=climbs_out)

    def judge(self, now: Instant) -> None:
        """Command vehicles by their present state; one whose place is unknown counts as flying until it is known."""
        for identity, vehicle in self._ours.items():
            if vehicle.member is Member.PARTED:
                continue
            told = self._heeds(identity, vehicle)
            wanted = told if told in FOR_GOOD else self._wanted(vehicle)
            if wanted is not told:
                self._tell(identity, vehicle, wanted, now)

    def _heeds(self, identity: VehicleId, vehicle: Vehicle) -> EndCommand:
        """Return what a vehicle was told; one that flew and has restarted since has forgotten it."""
        told, restarts = self._told.get(identity, (EndCommand.NOTHING, 0))
        return told if told is EndCommand.DOWN or vehicle.restarts == restarts else EndCommand.NOTHING

    def _wanted(self, vehicle: Vehicle) -> EndCommand:
        autopilot, seen = vehicle.autopilot, vehicle.telemetry
        if not vehicle.may_fly:
            return EndCommand.DOWN
        if not self._leaving or autopilot.climbs_out(seen):
            return EndCommand.NOTHING
        return EndCommand.LEAVE if seen.motion and autopilot.is_airborne(seen) else EndCommand.HOLD

    def _tell(self, identity: VehicleId, vehicle: Vehicle, what: EndCommand, now: Instant) -> None:
        self._told[identity] = what, vehicle.restarts
        self.landings.drop(vehicle)
        autopilot, seen = vehicle.autopilot, vehicle.telemetry
        if what is EndCommand.DOWN:
            _keep_down(vehicle, now)
        elif what is EndCommand.HOLD:
            asked = autopilot.requests(vehicle.rates_hz)
            vehicle.commands.begin((*autopilot.hold(), *asked), now, insist=True)
        elif what is EndCommand.LEAVE:
            height_m = self._height_m(identity, vehicle)
            vehicle.commands.begin(autopilot.leave(self.manner, height_m, seen), now, insist=True)
            if self.manner == "land":
                self.landings.await_turn(vehicle, height_m)
        else:
            vehicle.commands.begin((), now)

    def _height_m(self, identity: VehicleId, vehicle: Vehicle) -> float:
        """Return the height, m, at which a vehicle circles whose position is known."""
        place = place_of(vehicle)
        if place is not None:
            self.stack.add({identity: place})
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
        self._told[identity] = EndCommand.STAY, vehicle.restarts
        commands.begin(here if homeward else (*here, *home), now, insist=True)

    def _places(self) -> dict[VehicleId, ReportedMotion]:
        armed = {identity: vehicle for identity, vehicle in self._ours.items() if vehicle.telemetry.armed}
        return {identity: place for identity, vehicle in armed.items() if (place := place_of(vehicle))}

    def hasten(self) -> None:
        """Begin no further landing, and wait for nothing but acknowledgements."""
        self._loiter_s = 0.0
        self.landings.call_off()

    def over(self, waited_s: float) -> bool:
        """Return whether the run is over, this long after vehicles were told to leave."""
        late = waited_s > self._loiter_s + LOITER_LIMIT_S and not self.landings.under_way
        return late or (waited_s >= self._loiter_s and not self.pending())

    def pending(self) -> list[Vehicle]:
        """Return the vehicles that can be reached and may not be left alone yet."""
        return [vehicle for identity, vehicle in self._vehicles.items() if self._is_pending(identity, vehicle)]

    def at_one_height(self) -> list[str]:
        """Return which pairs of vehicles may circle at one height, with the reason.

        One of the two hasn't acknowledged a height of its own, and by what they told last their heights are nearer than
        vehicles must be apart. What stands circles nowhere.
        """
        if self.stands:
            return []
        flying = {identity: each for identity, each in self._vehicles.items() if each.airborne}
        places = {identity: place for identity, each in flying.items() if (place := each.telemetry.motion)}
        lacking, found = {identity for identity in places if self._is_pending(identity, flying[identity])}, list[str]()
        for one, other in combinations(places, 2):
            off_m = abs(places[one].height_m - places[other].height_m)
            near = off_m < self._gap_m and may_meet(places[one], places[other])
            if near and not lacking.isdisjoint((one, other)):
                who = one if one in lacking else other
                why = f"refuses {refusal}" if (refusal := flying[who].refusal) else "hasn't acknowledged its height"
                found.append(f"vehicles {one} and {other} may circle at heights {off_m:.1f} m apart: {who} {why}")
        return found

    def lacks(self, vehicle: Vehicle) -> str:
        """Return why a vehicle may not be left alone, as the end of a sentence; empty if it only hasn't answered."""
        if vehicle.refusal:
            return f": it refuses {vehicle.refusal}{vehicle.telemetry.last_words}"
        held = (
            self._heeds(vehicle.identity, vehicle) is EndCommand.HOLD and vehicle.commands.outcome is Outcome.ACCEPTED
        )
        return " at a height of its own: whether and where it flies isn't known" if held else ""

    def _is_pending(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        if not vehicle.connection.talks:
            return False
        if vehicle.commands.outcome is Outcome.WAITING or self.landings.is_pending(vehicle):
            return True
        ours = identity in self._ours and vehicle.member is not Member.PARTED
        return ours and self._heeds(identity, vehicle) not in FOR_GOOD and may_be_armed(vehicle)


def _keep_down(vehicle: Vehicle, now: Instant) -> None:
    """Disarm a vehicle on the ground, even if an arming command is still pending."""
    asked, waiting = vehicle.commands.under_way, vehicle.commands.outcome is Outcome.WAITING
    acts = waiting and asked is not None and asked.command != m.MAV_CMD_SET_MESSAGE_INTERVAL
    unsafe = vehicle.telemetry.armed or acts
    vehicle.commands.begin(vehicle.autopilot.stand_down() if unsafe else (), now, insist=True)
