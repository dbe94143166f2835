"""The velocity that a disturbance of an extension gives the air at vehicles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from formation_scenario.extensions import DISTURBANCE, ExtensionError
from formation_scenario.simulated import AirDisturbance, AirPoint
from formation_scenario.surroundings import OwnDisturbance
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import FleetConfig
from sim_vehicles.outside import Failures, Guarded, reference


class OwnAir:
    """A disturbance of an extension, with an instance for each vehicle; still air after a failure."""

    def __init__(
        self,
        keys: OwnDisturbance,
        config: FleetConfig,
        index: int,
        hit: Sequence[tuple[VehicleId, InAir]],
        failures: Failures,
    ) -> None:
        """Make the instances of the `index`-th disturbance.

        Raises:
            ExtensionError: one can't begin, or it isn't registered.
        """
        entry = config.registered.get(keys.kind, DISTURBANCE)
        if entry is None:
            raise ExtensionError(f"found no disturbance {keys.kind!r}")
        self.keys = keys
        self.zero: Instant | None = None
        """From when times count; None: from mission time 0."""
        self._each = [
            (
                Guarded(
                    entry,
                    keys.parameters,
                    failures,
                    vehicle=reference(identity),
                    random=random_stream(config.seed, "disturbance", index, *identity),
                    dt_s=LOOP_S,
                ),
                body,
            )
            for identity, body in hit
        ]

    def share(self, mission_s: float) -> float:
        """Return the time since it began instead of a share, so that it is asked at each instant."""
        return mission_s - self.keys.at_s

    def add(self, since_s: float) -> None:
        """Add its velocity to the vehicles' disturbances."""
        for guarded, body in self._each:
            state = body.state
            instance: AirDisturbance = guarded.instance
            at = AirPoint(since_s, state.north_m, state.east_m, state.height_m, state.airspeed_mps, state.heading_rad)
            found = guarded.finite(partial(instance.velocity_mps, at), 3)
            if found is not None:
                north, east, down = body.disturbance_mps
                body.disturbance_mps = north + found[0], east + found[1], down + found[2]
