"""Landings one after another, each where `landing_order` says.

All vehicles circle, or hover, over their homes at separate heights. The lowest lands first; the next one follows when
it stands there disarmed. So no two vehicles land at the same time, and none lands where another stands.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from gcs_formation.features.ending.holding_stack import home_of
from gcs_formation.fleet.circle_heights import CIRCLES_MEET_M, STACK_M
from gcs_formation.mission.ending import may_be_armed
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

AT_HEIGHT_M = STACK_M / 3
OVER_HOME_M, OVER_HOME_MPS = 2.0, 1.0
"""Distance from its home, and speed, within which one that hovers is over it: LAND brakes from that within 0.2 m.

Speeds are noisy, 0.3 m/s each way of a simulated PX4 (its accelerometers have 1.7 m/s²), and all that wait must be
there at once: below 0.3 m/s four never are.
"""
ROLLS_MPS = 1.5
"""Ground speed from which on a landed vehicle still rolls: a receiver says less of one that stands. Tuned: m/s; 0.5 to
3; shown by `pytest tests/gcs_formation/features/ending`."""
REFUSED_FOR_S = 5.0
"""How long a command to land may be refused until landings stop. Tuned: s; 3 to 10; shown by `pytest
tests/gcs_formation/features/ending`."""
LANDING_LIMIT_S = 900.0
"""Longest wait for vehicles to circle over their homes, and for each to land. Tuned: s; 300 to 1800; shown by `pytest
tests/gcs_formation/features/ending`."""


class Landings:
    """Lands the vehicles that circle over their homes, one at a time."""

    def __init__(self, refusal: Callable[[Sequence[VehicleId]], str | None]) -> None:
        """Start empty.

        `refusal` is called before each landing with those that are to land, the next one first; it returns why that
        isn't possible, None if it is.
        """
        self._refusal = refusal
        self.failure: str | None = None
        """Why landing was stopped; vehicles that haven't landed go on circling."""
        self._waiting = deque[tuple[float, Vehicle]]()
        self._landing: Vehicle | None = None
        self._since: Instant | None = None

    def await_turn(self, vehicle: Vehicle, height_m: float) -> None:
        """Add a vehicle that was commanded to circle over its home at a height above the origin."""
        self._waiting = deque(sorted((*self._waiting, (height_m, vehicle)), key=lambda each: each[0]))

    def call_off(self) -> Landings | None:
        """Start no further landing; return this if one has begun, which is completed."""
        self._waiting.clear()
        return self if self._landing is not None else None

    def drop(self, vehicle: Vehicle) -> None:
        """Forget that a vehicle was commanded to circle over its home, or to land."""
        self._waiting = deque(each for each in self._waiting if each[1] is not vehicle)
        if self._landing is vehicle:
            self._landing = None

    def refuse(self, text: str) -> None:
        """Begin no further landing, for a reason."""
        self.failure = self.failure or text
        self._waiting.clear()

    @property
    def under_way(self) -> bool:
        """Whether a vehicle is landing or waiting to land."""
        return self._landing is not None or bool(self._waiting)

    def is_pending(self, vehicle: Vehicle) -> bool:
        """Return whether a vehicle is landing or waiting to land."""
        return vehicle is self._landing or any(vehicle is each for _, each in self._waiting)

    def advance(self, now: Instant, *, climbs_out: bool = False) -> None:
        """Command the next landing if none is in progress, no vehicle climbs out, and all circle at their heights."""
        if self._since is None:
            self._since = now
        self._waiting = deque(each for each in self._waiting if each[1].member is not Member.PARTED)
        if self._landing is not None:
            self._watch(self._landing, seconds_between(self._since, now), now)
        elif self._waiting and not climbs_out and all(_circles(each, height_m) for height_m, each in self._waiting):
            self._begin(now)
        elif self._waiting and seconds_between(self._since, now) > LANDING_LIMIT_S:
            self._give_up(
                f"not every vehicle circled over home at the height it was commanded within {LANDING_LIMIT_S:g} s"
            )

    def _begin(self, now: Instant) -> None:
        refusal = self._refusal([each.identity for _, each in self._waiting])
        if refusal is not None:
            self._give_up(refusal)
            return
        _, self._landing = self._waiting.popleft()
        self._since = now
        self._landing.commands.send(self._landing.autopilot.land(), now)

    def _watch(self, vehicle: Vehicle, waited_s: float, now: Instant) -> None:
        refusal = vehicle.commands.refusal
        if not may_be_armed(vehicle):
            if _has_stopped(vehicle):
                self._landing, self._since = None, now
        elif vehicle.member is Member.PARTED:
            self._give_up(f"vehicle {vehicle.identity} was taken over by its pilot as it landed")
        elif vehicle.commands.outcome is not Outcome.ACCEPTED and refusal is not None and waited_s > REFUSED_FOR_S:
            vehicle.commands.send((), now)
            reason = vehicle.telemetry.last_words
            self._give_up(f"vehicle {vehicle.identity} refused to land ({m.name_of('MAV_RESULT', refusal[1])}){reason}")
        elif waited_s > LANDING_LIMIT_S:
            self._give_up(f"vehicle {vehicle.identity} has not landed within {LANDING_LIMIT_S:g} s")

    def _give_up(self, text: str) -> None:
        self.failure, self._landing = text, None
        self._waiting.clear()


def _has_stopped(vehicle: Vehicle) -> bool:
    """Return whether a vehicle that has landed has rolled out; one that doesn't tell its speed counts as standing."""
    seen = vehicle.telemetry.motion
    return seen is None or math.hypot(seen.north_mps, seen.east_mps) < ROLLS_MPS


def _circles(vehicle: Vehicle, height_m: float) -> bool:
    """Return whether a vehicle circles over its home at the commanded height."""
    seen, home_m = vehicle.telemetry.motion, home_of(vehicle)
    if seen is None or home_m is None or vehicle.commands.outcome is not Outcome.ACCEPTED:
        return False
    away_m = math.hypot(seen.north_m - home_m[0], seen.east_m - home_m[1])
    near = away_m < CIRCLES_MEET_M
    if vehicle.autopilot.hovers:
        near = away_m < OVER_HOME_M and math.hypot(seen.north_mps, seen.east_mps) < OVER_HOME_MPS
    return near and abs(seen.height_m - height_m) < AT_HEIGHT_M
