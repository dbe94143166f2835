"""Measurements of a vehicle by a navigation source of an extension."""

from __future__ import annotations

from functools import partial

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from formation_scenario.extensions import NAVIGATION, ExtensionError
from formation_scenario.navigation import OwnNavigation
from formation_scenario.registry import Registry
from formation_scenario.simulated import NavigationSource
from sim_vehicles.airframe.measured import measured_of, with_measured
from sim_vehicles.airframe.motion import Estimate, Motion
from sim_vehicles.outside import Failures, Guarded, reference


class OwnNavigator:
    """One vehicle's source. It is asked once an instant, however often it is read."""

    def __init__(
        self, keys: OwnNavigation, registry: Registry, vehicle: VehicleId, seed: int, failures: Failures
    ) -> None:
        """Make the vehicle's instance.

        Raises:
            ExtensionError: it can't begin, or it isn't registered.
        """
        entry = registry.get(keys.source, NAVIGATION)
        if entry is None:
            raise ExtensionError(f"found no navigation source {keys.source!r}")
        random = random_stream(seed, "navigation", *vehicle)
        self._guarded = Guarded(entry, keys.parameters, failures, vehicle=reference(vehicle), random=random)
        self._at, self._numbers = Instant(-1), tuple[float, ...]()

    def sense(self, true: Motion, now: Instant) -> Motion:
        """Return the motion as it is measured at `now`; the true one after a failure."""
        if now != self._at:
            source: NavigationSource = self._guarded.instance
            measured = measured_of(true)
            found = self._guarded.finite(partial(source.measure, measured, now / NANOSECONDS), len(measured))
            self._at, self._numbers = now, measured if found is None else found
        return with_measured(true, self._numbers)

    def estimate(self, true: Motion, now: Instant) -> Estimate:
        """Return the estimate, which is what was measured."""
        return Estimate(self.sense(true, now))
