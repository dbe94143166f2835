"""What happens to vehicles by mission time: the wind and its disturbances, and the faults that become due."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from formation_scenario.extensions import ExtensionError
from formation_scenario.surroundings import Disturbance, Fault
from sim_vehicles.airframe.disturbances import Acting, acting
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.config import FleetConfig
from sim_vehicles.outside import Failures

Due = tuple[float, bool, Fault, frozenset[VehicleId]]
"""Mission time at which a fault begins or ends, s; whether it ends; the fault; the vehicles concerned."""


class Environment:
    """The velocity that the air has at each vehicle besides the wind, and the faults that are due.

    Vehicles don't know the path, so mission time is received from a ground station.
    """

    def __init__(self, config: FleetConfig, bodies: Sequence[InAir]) -> None:
        """Take disturbances and faults from the configuration; `bodies` are its vehicles' in the same order."""
        self.mission_zero: Instant | None = None
        self.failures = Failures()
        """What failed of the extensions of the fleet."""
        self._bodies = bodies
        self._wind_mps = config.wind_mps
        self._config = config
        self._disturbances = [
            acting(config, index, keys, hit, bodies, self.failures)
            for index, (keys, hit) in enumerate(config.disturbances)
        ]
        due = [(at_s, ends, fault, hit) for fault, hit in config.faults for at_s, ends in fault.moments()]
        self._faults: list[Due] = sorted(due, key=itemgetter(0))
        self._scheduled: list[tuple[Instant, Due]] = []
        """Faults that are due at an instant instead of a mission time."""
        self._acting: list[tuple[Acting, float]] = []
        """The disturbances active at present, with their shares."""

    def receive_mission_time(self, mission_time_s: float, now: Instant) -> None:
        """Take a mission time from a ground station; only the first non-negative one is used."""
        if self.mission_zero is None and mission_time_s >= 0:
            self.mission_zero = after(now, -mission_time_s)

    def strike(self, fault: Fault, hit: frozenset[VehicleId], zero: Instant) -> None:
        """Add a fault of some vehicles, whose times count from `zero`."""
        for at_s, ends in fault.moments():
            self._scheduled.append((after(zero, at_s), (at_s, ends, fault, hit)))
        self._scheduled.sort(key=itemgetter(0))

    def disturb(self, keys: Disturbance, hit: frozenset[VehicleId], zero: Instant) -> None:
        """Add a disturbance of some vehicles, whose times count from `zero`."""
        try:
            added = acting(self._config, len(self._disturbances), keys, hit, self._bodies, self.failures)
        except ExtensionError as error:
            self.failures.add(str(error))
            return
        added.zero = zero
        self._disturbances.append(added)

    def advance(self, now: Instant) -> list[Due]:
        """Update the air at every vehicle for `now`; return the faults that have become due."""
        if not (self._disturbances or self._faults or self._scheduled):
            return []
        if self._disturbances:
            self._disturb(now)
        struck: list[Due] = []
        while self._scheduled and self._scheduled[0][0] <= now:
            struck.append(self._scheduled.pop(0)[1])
        mission_zero = self.mission_zero
        if mission_zero is not None:
            mission_s = seconds_between(mission_zero, now)
            while self._faults and self._faults[0][0] <= mission_s:
                struck.append(self._faults.pop(0))
        return struck

    def _disturb(self, now: Instant) -> None:
        active = list[tuple[Acting, float]]()
        for each in self._disturbances:
            zero = self.mission_zero if each.zero is None else each.zero
            since_s = math.nan if zero is None else seconds_between(zero, now)
            if each.keys.acts(since_s):
                active.append((each, each.share(since_s)))
        if active == self._acting:
            return
        self._acting = active
        for body in self._bodies:
            body.disturbance_mps = (0.0, 0.0, 0.0)
        for each, share in active:
            each.add(share)
        north_mps, east_mps, down_mps = self._wind_mps
        for body in self._bodies:
            north, east, down = body.disturbance_mps
            body.air_north_mps, body.air_east_mps = north_mps + north, east_mps + east
            body.air_down_mps = down_mps + down
