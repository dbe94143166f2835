"""Which vehicles fly in the formation at each tick, and what the others are commanded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from typing import Final

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from formation_scenario import Scenario
from gcs_formation.estimation.estimator import StateEstimator
from gcs_formation.estimation.projection import FORGOTTEN_AFTER_S
from gcs_formation.fleet.circle_heights import GroundFloor, loiter_heights, may_meet
from gcs_formation.fleet.membership_table import Seen, next_membership
from gcs_formation.fleet.mode_watch import ModeWatch
from gcs_formation.link.link_health import LinkState
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.vehicle_state import UNANSWERED_S

SUCCESSION_S: Final = 3.0
"""Silence of a leader, or time without its answers, after which it is replaced where another vehicle can lead. Tuned:
s; 2 to 6; shown by `pytest tests/gcs_formation/features/succession`."""
MUTE_S: Final = 1.5
"""Longest lack of heartbeats beyond what loss explains; after that a vehicle's mode counts as unknown. Tuned: s; 1 to
3; shown by `pytest tests/gcs_formation/fleet`."""
ORDER_COMES_S: Final = 5.0
"""Time after it was last sent during which a command to loiter may still reach a vehicle. Tuned: s; 3 to 10; shown by
`pytest tests/gcs_formation/fleet`."""
BACK_S: Final = 3.0
"""Largest age of telemetry with which a vehicle may return to the formation. Tuned: s; 1 to 5; shown by `pytest
tests/gcs_formation/fleet`."""
KEEP_HEIGHTS: Final = (Member.HOLDING, Member.HOMEWARD)
"""Memberships of vehicles that have been commanded to a height of their own."""
PARTED: Final = "parted by "
"""Beginning of the text about a vehicle that has left the formation; by whom follows."""
FAILSAFE_S: Final = 3.0
"""Time before a failsafe's text, and after it or after a reason for one, in which a new mode may be the failsafe's.
Tuned: s; 2 to 6; shown by `pytest tests/gcs_formation/fleet`."""


class Membership:
    """Decides the vehicles' membership in the formation."""

    def __init__(self, scenario: Scenario, vehicles: dict[VehicleId, Vehicle], log_event: LogEvent) -> None:
        """Judge `vehicles`, the leader first."""
        self._max_age_s = scenario.law.max_age_s
        self._vehicles, self._each = vehicles, list(vehicles.values())
        self._log_event = log_event
        self._ground = GroundFloor(scenario)
        self._circles_m: Mapping[VehicleId, float] | None = None
        self._heartbeats_stop = False
        """Whether a vehicle leaves the formation because its heartbeats are missing. All whose heartbeats are overdue
        leave with it: circles that are begun a second apart cross one another."""
        self._floor_at, self._floor_m = Instant(-1), -math.inf
        self._modes = ModeWatch()
        self._commanded_to_loiter = dict[VehicleId, Instant]()
        """When each vehicle was last commanded to loiter."""
        self._parted, self._failsafes = dict[VehicleId, Instant](), dict[VehicleId, tuple[Instant, str]]()
        """When each vehicle left without a failsafe's text; time and text of each one's last failsafe."""

    def update(
        self,
        leader: Vehicle | None,
        estimator: StateEstimator,
        now: Instant,
        *,
        connecting: bool,
        beyond: Set[VehicleId] = frozenset(),
    ) -> None:
        """Decide which vehicles fly in the formation; after there has been a leader, none does without one.

        `leader` is None for a virtual one; `connecting`: the station waits for its vehicles; `beyond`: vehicles that
        are to be held because a loop is unstable by its delay.
        """
        self._heartbeats_stop = any(self._is_without_heartbeats(vehicle) for vehicle in self._each)
        led = True
        if leader is not None:
            self.judge_one(leader, estimator, now, fresh=self.is_fresh(leader, estimator, beyond, now))
            led = leader.member is Member.FLYING or connecting
        for vehicle in self._each:
            if vehicle is not leader:
                self.judge_one(vehicle, estimator, now, fresh=led and self.is_fresh(vehicle, estimator, beyond, now))

    def update_at_end(self, now: Instant) -> None:
        """Leave vehicles to their pilots that have changed the modes in which they obeyed the commands of the end."""
        for vehicle in self._each:
            if vehicle.member is not Member.PARTED and not vehicle.is_left and self._modes.is_taken_over(vehicle, now):
                self._become(vehicle, Member.PARTED, now)

    def receive(self, vehicle: Vehicle, text: str, now: Instant) -> None:
        """Take a vehicle's text; a failsafe's text may arrive after the mode that the failsafe chose."""
        if not vehicle.autopilot.tells_failsafe(text):
            return
        self._failsafes[vehicle.identity] = now, text
        parted = self._parted.pop(vehicle.identity, None)
        if parted is not None and vehicle.member is Member.PARTED and seconds_between(parted, now) <= FAILSAFE_S:
            self._log_event(now, "member", self._parting_text(vehicle, now), vehicle)

    def _words(self, vehicle: Vehicle, now: Instant) -> str:
        """Return the membership in words, and for a loitering vehicle why its positions can't be used."""
        if vehicle.member is Member.PARTED:
            return self._parting_text(vehicle, now)
        if vehicle.member is Member.HOMEWARD:
            return f"{vehicle.member.value}: {vehicle.sent_home}"
        why = vehicle.unfit or (vehicle.sampler.why_unknown(now) if vehicle.sampler.refused else None)
        holds = vehicle.member is Member.HOLDING and why is not None
        return f"{vehicle.member.value}: {why}" if holds else vehicle.member.value

    def _parting_text(self, vehicle: Vehicle, now: Instant) -> str:
        """Return that a vehicle has left the formation and, if known, on whose command."""
        failsafe = self._failsafes.get(vehicle.identity)
        if failsafe is not None and seconds_between(failsafe[0], now) <= FAILSAFE_S:
            return f"{PARTED}its failsafe: '{failsafe[1]}'"
        self._parted[vehicle.identity] = now
        if seconds_between(vehicle.alone_at, now) > FAILSAFE_S:
            return Member.PARTED.value
        return f"{PARTED}its pilot or its failsafe, in {vehicle.autopilot.mode_name(vehicle.telemetry)}"

    def judge_one(self, vehicle: Vehicle, estimator: StateEstimator, now: Instant, *, fresh: bool) -> None:
        """Decide whether a vehicle flies in the formation; `fresh`: what is known of it is recent enough for that."""
        if seconds_between(vehicle.round_trips.received_at(now), now) > UNANSWERED_S:
            vehicle.left_alone(now)
        if fresh and vehicle.member is Member.FLYING and vehicle.follows_setpoints and not vehicle.sent_home:
            return
        vehicle.pilots_choice.confirm_mode(vehicle.telemetry, waiting=vehicle.commands.outcome is Outcome.WAITING)
        if vehicle.member is Member.HOLDING:
            self._commanded_to_loiter[vehicle.identity] = now
        member = self._next(vehicle, estimator, now, fresh=fresh)
        if member is not vehicle.member:
            self._become(vehicle, member, now)

    def _become(self, vehicle: Vehicle, member: Member, now: Instant) -> None:
        """Change a vehicle's membership: record it, and send its commands."""
        revokes = vehicle.member is Member.HOLDING and self.order_may_come(vehicle, now)
        vehicle.member, vehicle.member_since = member, now
        self._log_event(now, "member", self._words(vehicle, now), vehicle)
        self._command(vehicle, now, revokes=revokes)

    def _next(self, vehicle: Vehicle, estimator: StateEstimator, now: Instant, *, fresh: bool) -> Member:
        """Return a vehicle's next membership by what is known of it now."""
        link = vehicle.connection  # after silence a vehicle gets time to answer: it may have hung, and still receive us
        receives = link.talks and seconds_between(link.back_at, now) > UNANSWERED_S
        forgotten = not estimator.age_s(vehicle.index, now) <= FORGOTTEN_AFTER_S
        seen = Seen(
            started=vehicle.start_up.finished and not vehicle.telemetry.boots,
            guided=vehicle.follows_setpoints,
            loiters=vehicle.telemetry.custom_mode == vehicle.autopilot.loiter_mode,
            fresh=fresh,
            loiter_may_be_commanded=receives or forgotten,
            order_may_come=self.order_may_come(vehicle, now),
            sent_home=vehicle.sent_home != "",
            homeward=vehicle.telemetry.custom_mode == vehicle.autopilot.home_mode,
        )
        return next_membership(vehicle.member, seen)

    def is_fresh(
        self,
        vehicle: Vehicle,
        estimator: StateEstimator,
        beyond: Set[VehicleId],
        now: Instant,
        limit_s: float = math.inf,
    ) -> bool:
        """Return whether a vehicle can be flown by what is known of it, which may be `limit_s` old at most."""
        if vehicle.unfit or vehicle.identity in beyond:
            return False
        if vehicle.member is Member.HOLDING and self._circles_m is not None:
            return False
        out, link = vehicle.member is not Member.FLYING, vehicle.connection
        if out and (link.state is LinkState.MUTE or link.state is LinkState.LOST):
            return False
        if self._is_without_heartbeats(vehicle) or (self._heartbeats_stop and link.overdue):
            return False
        limit_s = min(self._max_age_s, BACK_S if out else limit_s)
        if seconds_between(vehicle.round_trips.received_at(now), now) > max(limit_s, UNANSWERED_S):
            return False
        age_s = estimator.age_s(vehicle.index, now)
        return math.isnan(age_s) or age_s <= limit_s

    def _is_without_heartbeats(self, vehicle: Vehicle) -> bool:
        """Return whether a vehicle's mode is unknown by now, as its heartbeats are missing."""
        link = vehicle.connection
        if link.state is not LinkState.MUTE and link.state is not LinkState.LOST:
            return False
        return vehicle.member is Member.FLYING and link.mute_s(vehicle.sequence.loss) > MUTE_S

    def end(self, circles_m: Mapping[VehicleId, float]) -> None:
        """At the end of the flight let no loitering vehicle return; take the heights of all circles."""
        self._circles_m = circles_m

    def _command(self, vehicle: Vehicle, now: Instant, *, revokes: bool) -> None:
        """Send the commands of a new membership; `revokes`: an earlier command to loiter may still arrive."""
        autopilot = vehicle.autopilot
        if vehicle.member is Member.HOLDING:
            vehicle.holds_at_m, vehicle.holds_from = self._holding_height_m(vehicle, now), now
            # Circles that are begun a second apart cross one another: one that is late for a loss would.
            loses = vehicle.setpoints.loses(now)
            loiter = autopilot.loiter(vehicle.holds_at_m, vehicle.telemetry)
            vehicle.commands.send(loiter, now, insist=True, twice=loses)
        elif vehicle.member is Member.HOMEWARD:
            vehicle.holds_at_m = self._holding_height_m(vehicle, now)
            vehicle.commands.send(autopilot.go_home(vehicle.holds_at_m, vehicle.telemetry), now, insist=True)
        elif vehicle.member is Member.RETURNING or (vehicle.member is Member.FLYING and revokes):
            vehicle.commands.send((autopilot.set_mode(autopilot.guided_mode),), now, insist=True)
        elif vehicle.member is Member.PARTED and vehicle.pilots_choice.mode is not None:
            vehicle.commands.send((autopilot.set_mode(vehicle.pilots_choice.mode),), now)
        elif vehicle.member is not Member.STARTING:
            vehicle.commands.send((), now)

    def order_may_come(self, vehicle: Vehicle, now: Instant) -> bool:
        """Return whether a recently sent command to loiter may still reach a vehicle."""
        commanded = self._commanded_to_loiter.get(vehicle.identity)
        return commanded is not None and now < after(commanded, ORDER_COMES_S)

    def _holding_height_m(self, vehicle: Vehicle, now: Instant) -> float:
        """Return the height at which a vehicle loiters clear of all others, m."""
        if self._circles_m is not None and vehicle.identity in self._circles_m:
            return self._circles_m[vehicle.identity]
        motions = {i: v.telemetry.motion for i, v in self._vehicles.items() if v.telemetry.motion}
        if now != self._floor_at:
            top = self._ground.highest((each.north_m, each.east_m) for each in motions.values())
            self._floor_at, self._floor_m = now, top.height_m
        # Those that loiter already keep the heights that they were commanded to, wherever they are on their way there.
        kept_m = {
            i: each.holds_at_m
            for i, each in self._vehicles.items()
            if i in motions and each is not vehicle and each.member in KEEP_HEIGHTS and not math.isnan(each.holds_at_m)
        }
        own, homeward = motions.get(vehicle.identity), vehicle.member is Member.HOMEWARD
        at_home = {i for i in kept_m if homeward and self._vehicles[i].member is Member.HOMEWARD}
        near = [i for i in kept_m if i in at_home or (own is not None and may_meet(own, motions[i]))]
        taken = [(kept_m[i], kept_m[i]) for i in near]
        free = {i: motion for i, motion in motions.items() if i not in kept_m}
        floor_m, home_m = self._floor_m, vehicle.telemetry.home_m
        if homeward and own is not None and home_m is not None:
            floor_m = max(floor_m, self._ground.over_leg((own.north_m, own.east_m), home_m))
        return loiter_heights(free, floor_m, taken)[vehicle.identity]
