"""The end of a run: which vehicles are commanded then, and until when they are waited for.

This is the plain ending: vehicles on the ground stay there, all others circle at the heights that they have. Another
may take its place: `FlightPhaseMachine.endings`. Whether a vehicle flies is judged again at every tick until it leaves:
an unknown position isn't the ground.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.endpoint import VehicleId
from formation_scenario.orders import End
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

LOITER_LIMIT_S: Final = 20.0
"""Longest wait for vehicles to climb out and acknowledge that they loiter."""


class EndCommand(Enum):
    """What a vehicle is commanded at the end."""

    NOTHING = "to go on"
    DOWN = "to stay on the ground"
    HOLD = "to circle at the height that it has, which isn't known"
    LEAVE = "to circle at a height of its own, here or at home"
    STAY = "to circle here first, as it refuses to do so at home"


FOR_GOOD: Final = (EndCommand.LEAVE, EndCommand.STAY)
"""Commands that aren't judged again."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Ending:
    """Brings every vehicle to a state in which it may be left alone.

    A vehicle that is taking off climbs out first; one that its pilot has taken over is left to the pilot. Commands are
    insisted on, whatever vehicles answer.
    """

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle], manner: End = "loiter") -> None:
        """Begin with all `vehicles`, none of which is commanded yet; `manner`: how the flight ends."""
        self.manner: End = manner
        self._vehicles = vehicles
        self._ours = {identity: each for identity, each in vehicles.items() if not each.is_left}
        self._loiter_s = 0.0
        self._commanded = dict[VehicleId, tuple[EndCommand, int]]()
        """What each was commanded, and how often it had restarted then."""
        self._leaving = False
        """Whether vehicles leave; before that only those on the ground are commanded."""

    @property
    def failure(self) -> str | None:
        """Why it can't be carried out as ordered; None if it can."""
        return None

    @property
    def circles_m(self) -> Mapping[VehicleId, float]:
        """Heights of the circles that vehicles are assigned, m; it changes as they are."""
        return {}

    def may_leave(self, now: Instant) -> bool:  # noqa: ARG002
        """Return whether vehicles may circle: the formation needn't be commanded any longer."""
        return True

    def start(self, now: Instant, loiter_s: float = 0.0) -> None:
        """Keep vehicles on the ground there, whatever they were doing; the others loiter for `loiter_s` at the end."""
        self._loiter_s = loiter_s
        self.command_by_state(now)

    def leave(self, now: Instant) -> None:
        """Begin to command vehicles to circle."""
        self._leaving = True
        self.advance(now)

    def advance(self, now: Instant) -> None:
        """Command vehicles that may be in the air and have climbed out."""
        self.command_by_state(now)

    def command_by_state(self, now: Instant) -> None:
        """Command vehicles by their present state; one whose position is unknown counts as flying until it is known."""
        for identity, vehicle in self._ours.items():
            if self._is_left_alone(vehicle):
                continue
            commanded = self._obeys(identity, vehicle)
            wanted = commanded if commanded in FOR_GOOD else self._wanted(vehicle)
            if wanted is not commanded:
                self._tell(identity, vehicle, wanted, now)

    def _is_left_alone(self, vehicle: Vehicle) -> bool:
        """Return whether a vehicle is its pilot's, or flies home already while the others are to circle here."""
        homeward = vehicle.member is Member.HOMEWARD and self.manner == "loiter"
        return homeward or vehicle.member is Member.PARTED

    def _obeys(self, identity: VehicleId, vehicle: Vehicle) -> EndCommand:
        """Return what a vehicle was commanded; one that flew and has restarted since has forgotten it."""
        commanded, restarts = self._commanded.get(identity, (EndCommand.NOTHING, 0))
        return commanded if commanded is EndCommand.DOWN or vehicle.restarts == restarts else EndCommand.NOTHING

    def _wanted(self, vehicle: Vehicle) -> EndCommand:
        autopilot, seen = vehicle.autopilot, vehicle.telemetry
        if not vehicle.may_fly:
            return EndCommand.DOWN
        if not self._leaving or autopilot.climbs_out(seen):
            return EndCommand.NOTHING
        return EndCommand.LEAVE if seen.motion and autopilot.is_airborne(seen) else EndCommand.HOLD

    def _tell(self, identity: VehicleId, vehicle: Vehicle, what: EndCommand, now: Instant) -> None:
        self._commanded[identity] = what, vehicle.restarts
        autopilot = vehicle.autopilot
        if what is EndCommand.DOWN:
            _keep_down(vehicle, now)
        elif what is EndCommand.HOLD:
            asked = autopilot.requests(vehicle.rates_hz)
            vehicle.commands.send((*autopilot.hold(), *asked), now, insist=True)
        elif what is EndCommand.LEAVE:
            self._send_away(identity, vehicle, now)
        else:
            vehicle.commands.send((), now)

    def _send_away(self, identity: VehicleId, vehicle: Vehicle, now: Instant) -> None:  # noqa: ARG002
        """Command a vehicle, whose position is known, to circle."""
        seen = vehicle.telemetry
        assert seen.motion is not None, "`_wanted` has seen it"
        vehicle.commands.send(vehicle.autopilot.leave("loiter", seen.motion.height_m, seen), now, insist=True)

    def hasten(self) -> None:
        """Wait for nothing but acknowledgements."""
        self._loiter_s = 0.0

    def over(self, waited_s: float) -> bool:
        """Return whether the run is over, this long after vehicles were commanded to leave."""
        late = waited_s > self._loiter_s + LOITER_LIMIT_S and not self._goes_on
        return late or (waited_s >= self._loiter_s and not self.pending())

    @property
    def _goes_on(self) -> bool:
        """Whether vehicles do more than circle, and so take longer."""
        return False

    def pending(self) -> list[Vehicle]:
        """Return the vehicles that can be reached and may not be left alone yet."""
        return [vehicle for identity, vehicle in self._vehicles.items() if self._is_pending(identity, vehicle)]

    def not_landed(self) -> dict[VehicleId, str | None]:
        """Return of each vehicle None if it is down and disarmed at the flight's end, otherwise why it isn't."""
        return {identity: self._why_not_landed(vehicle) for identity, vehicle in self._vehicles.items()}

    def _why_not_landed(self, vehicle: Vehicle) -> str | None:
        if not may_be_armed(vehicle):
            return None
        mode = vehicle.autopilot.mode_name(vehicle.telemetry)
        if not vehicle.connection.talks:
            return f"not heard any more; last in {mode}"
        if vehicle.member is Member.PARTED:
            return f"left to its pilot, in {mode}"
        return self.failure or f"still armed, in {mode}{vehicle.telemetry.last_words}"

    def at_one_height(self) -> list[str]:
        """Return which pairs of vehicles may circle at one height though they shouldn't, with the reason."""
        return []

    def lacks(self, vehicle: Vehicle) -> str:
        """Return why a vehicle may not be left alone, as the end of a sentence; empty if it only hasn't answered."""
        if vehicle.refusal:
            return f": it refuses {vehicle.refusal}{vehicle.telemetry.last_words}"
        held = (
            self._obeys(vehicle.identity, vehicle) is EndCommand.HOLD and vehicle.commands.outcome is Outcome.ACCEPTED
        )
        return " at a height of its own: whether and where it flies isn't known" if held else ""

    def _is_pending(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        if not vehicle.connection.talks:
            return False
        if vehicle.commands.outcome is Outcome.WAITING:
            return True
        ours = identity in self._ours and not self._is_left_alone(vehicle)
        return ours and self._obeys(identity, vehicle) not in FOR_GOOD and may_be_armed(vehicle)


@mypyc_attr(allow_interpreted_subclasses=True)
class Endings:
    """Begins endings; one may follow another that isn't over."""

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle]) -> None:
        """Take all vehicles."""
        self._vehicles = vehicles

    def why_not(self, manner: End) -> str | None:
        """Return why a flight can't be ended in a manner, and what is allowed; None if it can."""
        return None if manner == "loiter" else f"found {manner}; allowed: loiter"

    def start(
        self,
        manner: End,
        earlier: Ending | None,  # noqa: ARG002
        loiter_s: float,
        now: Instant,
        *,
        commanded: bool,  # noqa: ARG002
    ) -> Ending:
        """Begin one.

        Args:
            manner: how the flight ends.
            earlier: the one that it follows.
            loiter_s: how long vehicles circle until the run is over, s.
            now: the instant.
            commanded: whether the formation is still commanded, until `Ending.may_leave`.
        """
        ending = Ending(self._vehicles, manner)
        ending.start(now, loiter_s)
        return ending


def may_be_armed(vehicle: Vehicle) -> bool:
    """Return whether a vehicle is armed, or restarts and hasn't reported it yet."""
    seen = vehicle.telemetry
    return seen.armed or seen.heartbeat is None or seen.boots


def _keep_down(vehicle: Vehicle, now: Instant) -> None:
    """Disarm a vehicle on the ground, even if an arming command is still pending."""
    asked, waiting = vehicle.commands.under_way, vehicle.commands.outcome is Outcome.WAITING
    acts = waiting and asked is not None and asked.command != m.MAV_CMD_SET_MESSAGE_INTERVAL
    unsafe = vehicle.telemetry.armed or acts
    vehicle.commands.send(vehicle.autopilot.stand_down() if unsafe else (), now, insist=True)
