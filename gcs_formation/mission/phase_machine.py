"""The phases of a run and their transitions, orders in flight, and the end."""

from __future__ import annotations

import math

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from flight_model.path import Route
from formation_scenario import Scenario
from formation_scenario.orders import End
from formation_scenario.slot_assignment import names_by_index
from gcs_formation.controller.controller import FormationController
from gcs_formation.errors import NotFiniteError
from gcs_formation.fleet.dispatch import Dispatch
from gcs_formation.fleet.membership import Membership
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.link.link_health import LinkState
from gcs_formation.mission.ending import Ending, Endings
from gcs_formation.mission.gate import Gate
from gcs_formation.phases import ALL_ENDED, BEFORE_COMMANDS, NOT_ALL_ENDED, OVER, Cause, Flight, Phase
from gcs_formation.recorder import LogEvent, Tick
from gcs_formation.vehicle.vehicle import Vehicle

GETS_ON_S, GETS_ON_SHARE = 120.0, 0.05
"""A leader must get nearer to its path within this time, by this share of the distance flown through the air."""


class ProgressToStart:
    """Watches whether the leader approaches the start of its path: against strong wind it may not."""

    def __init__(self) -> None:
        """Start without a route."""
        self._route: Route | None = None
        self._farthest_m, self._since = 0.0, Instant(0)

    def too_little_m(self, guidance: LeaderGuidance, now: Instant) -> float | None:
        """Return the distance gained in the last `GETS_ON_S`, m, if that is too little; None otherwise.

        A leader that is to hover needn't move.
        """
        gained_m, speed_mps = guidance.distance_m - self._farthest_m, guidance.speed_mps
        enough = speed_mps == 0.0 or gained_m >= GETS_ON_SHARE * GETS_ON_S * speed_mps
        if enough or guidance.route is not self._route:
            self._route, self._farthest_m, self._since = guidance.route, guidance.distance_m, now
        return gained_m if seconds_between(self._since, now) > GETS_ON_S else None


class FlightPhaseMachine:
    """Moves a run from phase to phase, and ends it."""

    def __init__(
        self,
        scenario: Scenario,
        controller: FormationController,
        membership: Membership,
        dispatch: Dispatch,
        vehicles: dict[VehicleId, Vehicle],
        log_event: LogEvent,
        gate: Gate,
    ) -> None:
        """Start in phase CONNECTING.

        Args:
            scenario: the scenario to fly.
            controller: steers the leader along its path, which ends the flight.
            membership: lets no loitering vehicle return after that.
            dispatch: its delayed setpoints are dropped when vehicles loiter.
            vehicles: all vehicles.
            log_event: reports events.
            gate: tells whether vehicles may be commanded; before that a run ends without commands.
        """
        self.flight = Flight()
        self.failure: str | None = None
        """Why the run couldn't continue."""
        self.flown = False
        """Whether it failed only after the flight, for instance because a vehicle couldn't land."""
        self.cut_short = False
        """Whether the flight was ended before its path or its time was over."""
        self.assembled: bool | None = None
        """Whether every follower was in its slot when the path began; None before that."""
        self.unsafe: list[str] = []
        """Vehicles that may circle at the same height after the run."""
        self.flying_on = dict[VehicleId, str]()
        """Vehicles that are still in their guided mode after the run, without setpoints, in words."""
        self._scenario, self._controller, self._duration_s = scenario, controller, scenario.duration_s
        self.membership, self._dispatch = membership, dispatch
        self._vehicles, self._log_event, self.gate = vehicles, log_event, gate
        self._late, self._progress = False, ProgressToStart()
        self.endings = Endings(vehicles)
        """Begins the end; a feature may bring others."""
        self._ending: Ending | None = None
        self.opening: Ending | None = None
        """The ending, while the formation is still commanded."""

    def move(self, cause: Cause, now: Instant, manner: End = "loiter") -> bool:
        """Move to the phase that `cause` leads to; return whether there is one. `manner`: how the flight ends then."""
        none_received = all(vehicle.connection.state is LinkState.SEARCHING for vehicle in self._vehicles.values())
        if not self.gate.passed or (cause is Cause.FAILURE and none_received):
            cause = BEFORE_COMMANDS.get(cause, cause)
        if not self.flight.move(cause, now):
            return False
        if cause is Cause.PATH_BEGUN:
            self._judge_assembly(now)
        self._log_event(now, "phase", self.flight.phase.value, details={"cause": cause.value})
        if self.flight.phase in OVER and cause is not Cause.OPENED:
            self._begin_to_end(cause, manner, now)
        if self.flight.phase is Phase.LOITERING and self._ending is not None:
            self._dispatch.clear()
            self._ending.leave(now)
        return True

    def waited_long_enough(self, tick: Tick | None, now: Instant) -> bool:
        """Return whether the time to assemble is over; if no leader is there to follow by then, the run fails."""
        if self.flight.phase is not Phase.ASSEMBLING:
            self._late = False
            return False
        limit_s = self._scenario.start.timeout_s
        self._late = late = seconds_between(self.flight.since, now) > limit_s
        if late and tick is not None and not tick.active[tick.leader]:
            age_s, max_s = tick.age_s[tick.leader], self._scenario.law.max_age_s
            old = f": its telemetry is {age_s:.3g} s old; law.max_age_s is {max_s:g}" if age_s > max_s else ""
            self.fail(f"the leader was not there to follow within {limit_s:g} s{old}", now)
        elif late:
            gained_m = self._progress.too_little_m(self._controller.guidance, now)
            if gained_m is not None:
                self._fail_to_start(gained_m, now)
        return late

    def _judge_assembly(self, now: Instant) -> None:
        """Record whether the path begins with every follower in its slot.

        Until the time for assembling is over it counts so: a follower that a turn to the start displaced will return.
        """
        self.assembled = self._controller.assembly.complete or not self._late
        if not self.assembled:
            self._log_event(now, "unassembled", "not every follower is in its slot, but the time for that is over")

    def _fail_to_start(self, gained_m: float, now: Instant) -> None:
        moved = f"{abs(gained_m):.0f} m {'nearer to' if gained_m > 0.0 else 'farther from'}"
        reached = (
            f"commanded to fly {self._controller.guidance.speed_mps:g} m/s, it is {moved} it than {GETS_ON_S:g} s ago"
        )
        self.fail(f"the leader does not get to the start of its path: {reached}", now)

    @property
    def not_landed(self) -> dict[VehicleId, str | None] | None:
        """Of each vehicle None if it has landed and is disarmed, otherwise why not; None if none was to land."""
        ending = self._ending
        lands = self._scenario.finish.then == "land" and ending is not None and ending.manner == "land"
        return ending.not_landed() if lands and ending is not None else None

    def end_rehearsal(self, now: Instant) -> None:
        """End a rehearsal, in which no one is commanded."""
        self.cut_short = self.move(Cause.REHEARSED, now)

    def stop(self, now: Instant) -> None:
        """End the flight: the formation separates, all vehicles loiter, and no further landing begins."""
        if self.move(Cause.STOP, now):
            self.cut_short = True
        if self._ending is not None:
            self._ending.hasten()

    def go_home_at_once(self, now: Instant) -> bool:
        """Send vehicles home that were commanded to stop, however far apart they are; return whether that began."""
        return self.why_not_end("rtl") is None and self.move(Cause.IMMEDIATE_RETURN, now, "rtl")

    def fail(self, text: str, now: Instant, *, begun: bool = True) -> None:
        """End the run with the first reason why it can't continue; vehicles loiter if it had `begun`."""
        self.flown = self.flown or (self.failure is None and self.flight.phase in OVER)
        self.failure = self.failure or text
        self._log_event(now, "failure", text)
        self.move(Cause.FAILURE if begun else Cause.NOT_BEGUN, now)

    def fail_by(self, fault: NotFiniteError, now: Instant, *, begun: bool = True) -> None:
        """End the run, once, because a part returned what isn't finite: which one, for which vehicle, and when."""
        if self.failure is not None:
            return
        mission_s = self.flight.mission_time_s(now)
        since = f"{seconds_between(Instant(0), now):.1f} s after the start"
        when = since if math.isnan(mission_s) else f"{mission_s:.1f} s"
        if fault.index is None:
            self.fail(f"the {fault.part} could not compute anything at {when}: {fault.found}", now, begun=begun)
        else:
            who = names_by_index(self._scenario)[fault.index]
            self.fail(
                f"what the {fault.part} returned for {who} at {when} is not finite: {fault.found}", now, begun=begun
            )

    def end_by_order(self, manner: End, now: Instant) -> str | None:
        """End the flight as ordered; return why a vehicle can't do that, None if all can."""
        refusal = self.why_not_end(manner)
        if refusal is not None:
            return refusal
        self.cut_short = self.cut_short or self.flight.phase not in OVER
        self.move(Cause.ORDERED, now, manner)
        return None

    def why_not_end(self, manner: End) -> str | None:
        """Return why the flight can't be ended in a manner; None if it can."""
        return self.endings.why_not(manner)

    def end_in_time(self, until_s: float, now: Instant) -> None:
        """End a flight whose path or time is over, or that has reached mission time `until_s`."""
        flown_s = self.flight.mission_time_s(now)
        if flown_s >= self._duration_s or self._controller.guidance.at_end:
            self.move(Cause.PATH_ENDED, now, self._scenario.finish.then)
        elif flown_s >= until_s:
            self.cut_short = True
            self.move(Cause.PATH_ENDED, now, self._scenario.finish.then)

    def bring_to_end(self, now: Instant) -> None:
        """Manage the vehicles in the phases after the flight."""
        assert self._ending is not None, "it begins with the first of these phases"
        if self.flight.phase is Phase.LOITERING:
            self._wait_for_loiter(self._ending, now)
        else:
            self._ending.command_by_state(now)

    def _wait_for_loiter(self, ending: Ending, now: Instant) -> None:
        """Continue until vehicles may be left alone; end the run when all are."""
        ending.advance(now)
        if ending.failure and not self.failure:
            self.fail(ending.failure, now)
        if ending.over(seconds_between(self.flight.since, now)):
            pending = ending.pending()
            for vehicle in pending:
                text = f"has not acknowledged that it loiters{ending.lacks(vehicle)}"
                self._log_event(now, "unacknowledged", text, vehicle)
            received = [each for each in self._vehicles.values() if each.connection.talks]
            elsewhere = [each for each in received if each.effects.missing is not None]
            for vehicle in dict.fromkeys((*pending, *elsewhere)):
                if vehicle.flies_on:
                    mode = vehicle.autopilot.mode_name(vehicle.telemetry)
                    self.flying_on[vehicle.identity] = f"vehicle {vehicle.identity} flies on in {mode}"
            self.unsafe = ending.at_one_height()
            if self.failure:
                self.move(Cause.GIVEN_UP, now)
            else:
                self.move((NOT_ALL_ENDED if pending or elsewhere else ALL_ENDED)[ending.manner], now)

    def _begin_to_end(self, cause: Cause, manner: End, now: Instant) -> None:
        """Begin the ending; the formation is commanded meanwhile unless it loiters already."""
        commanded = self.flight.phase is Phase.ENDING
        loiter_s = self._scenario.finish.loiter_s if cause in (Cause.PATH_ENDED, Cause.ORDERED) else 0.0
        self._ending = ending = self.endings.start(manner, self._ending, loiter_s, now, commanded=commanded)
        self.opening = ending if commanded else None
        if commanded:
            self.membership.end(ending.circles_m)
