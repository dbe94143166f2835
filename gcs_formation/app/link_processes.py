"""Delay and loss processes of extensions, for the links that name them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from airlink.impairment import Direction
from airlink.random_streams import random_stream
from formation_scenario import Scenario
from formation_scenario.extensions import LINK, Registered
from formation_scenario.links import Impairment
from formation_scenario.simulated import Carried, LinkProcess, Place
from gcs_formation.control.outside import guarded, made
from gcs_formation.control.plain_values import vehicle_name
from gcs_formation.errors import NotFiniteError, RunAbortedError

Positions = Callable[[VehicleId], Place]
"""Returns where a vehicle is now."""
UNKNOWN = Place(math.nan, math.nan, math.nan)


class LinkProcesses:
    """The processes of a flight's links: an instance for each direction of each link that names one."""

    def __init__(self, scenario: Scenario) -> None:
        """Make none before it is asked for."""
        self._scenario = scenario
        self._station = Place(*(scenario.links.station_m or (0.0, 0.0, 0.0)))
        self._made = dict[tuple[str, str, VehicleId, int, Direction], Callable[[int, Instant], float | None]]()
        self.positions: Positions = lambda _: UNKNOWN
        self.failure: str | None = None
        """What failed, with file and line; a process that failed changes nothing."""

    @property
    def any(self) -> bool:
        """Whether any link has one."""
        return bool(self._made)

    def of(
        self, vehicle: VehicleId, direction: Direction, link: Impairment, number: int = 1
    ) -> Callable[[int, Instant], float | None] | None:
        """Return what delays and loses datagrams of one direction of a vehicle's link; None if nothing does."""
        entry = self._scenario.registered.get(link.process, LINK)
        if entry is None:
            return None
        keys = dict(link.parameters or {})
        key = entry.name, json.dumps(keys, sort_keys=True), vehicle, number, direction
        try:
            if key not in self._made:
                process: LinkProcess = made(entry, keys, **self._given(vehicle, direction, number))
                self._made[key] = partial(self._carry, entry, process, vehicle)
        except RunAbortedError as error:
            self.failure = self.failure or f"the {error}"
            return None
        return self._made[key]

    def _given(self, vehicle: VehicleId, direction: Direction, number: int) -> dict[str, Any]:
        further = () if number == 1 else (number,)
        random = random_stream(self._scenario.seed, "link process", *vehicle, direction, *further)
        uplink = direction is Direction.UPLINK
        return {"vehicle": vehicle_name(vehicle), "uplink": uplink, "random": random, "ground_m": self._ground_m}

    def _ground_m(self, north_m: float, east_m: float) -> float:
        if self._scenario.terrain is None:
            return 0.0
        return float(self._scenario.ground.height(np.array([north_m]), np.array([east_m]))[0])

    def _carry(
        self, entry: Registered, process: LinkProcess, vehicle: VehicleId, size_bytes: int, now: Instant
    ) -> float | None:
        if self.failure is not None:
            return 0.0
        carried = Carried(now / NANOSECONDS, size_bytes, self._station, self.positions(vehicle))
        try:
            return guarded(entry, partial(_delay_s, entry, process, carried))
        except NotFiniteError as error:
            self.failure = f"the {error.part} failed: {error.found}"
            return 0.0


def _delay_s(entry: Registered, process: LinkProcess, carried: Carried) -> float | None:
    """Return a process's delay of a datagram, s; None if it is lost.

    Raises:
        NotFiniteError: it isn't a number from 0.
    """
    delay_s = process.delay_s(carried)
    if delay_s is None:
        return None
    if not 0.0 <= float(delay_s) < math.inf:
        raise NotFiniteError(str(entry), None, f"a delay of {float(delay_s):g} s ({entry.where})")
    return float(delay_s)
