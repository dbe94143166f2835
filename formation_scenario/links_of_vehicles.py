"""Which links a scenario's vehicles have, and what impairs each of them when."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from airlink.endpoint import VehicleId
from formation_scenario.fields import VehicleSelection
from formation_scenario.links import Links, LinkStep, link_steps, through_air
from formation_scenario.signing import Signing
from formation_scenario.traces.keys import Trace
from formation_scenario.traces.reading import read_trace
from formation_scenario.traces.recorded import RecordedDelays
from formation_scenario.vehicles import Vehicle


class LinksOfVehicles:
    """The part of a scenario that answers for its links, by its keys `vehicles` and `links`."""

    if TYPE_CHECKING:  # keys of the scenario, in the order of its own
        vehicles: tuple[Vehicle, ...]
        links: Links

    def selected(self, selection: VehicleSelection) -> tuple[Vehicle, ...]:
        """Return the vehicles that a key such as `vehicles: [2, 3]` selects, in the scenario's order."""
        if selection == "all":
            return self.vehicles
        return tuple(vehicle for vehicle in self.vehicles if any(ref in selection for ref in vehicle.refs))

    def channel_members(self) -> list[tuple[int, tuple[Vehicle, ...]]]:
        """Return the radios that vehicles share: each one's index in `links.channels`, and its vehicles."""
        found = list[tuple[int, tuple[Vehicle, ...]]]()
        for index, channel in enumerate(self.links.channels):
            if channel.vehicles == "each":
                found += [(index, (vehicle,)) for vehicle in self.vehicles]
            else:
                found.append((index, self.selected(channel.vehicles)))
        return found

    def signing_of(self, vehicle: Vehicle) -> Signing | None:
        """Return how a vehicle's link is signed, None if it isn't."""
        signing = vehicle.signing or self.links.default.signing
        return None if signing is None or signing.file is None else signing

    def recorded_delays(self, trace: Trace) -> RecordedDelays:
        """Return recorded delays of some link's; each record is read once.

        Raises:
            FileError: the file can't be read, or holds something else.
        """
        if trace not in self._recorded:
            self._recorded[trace] = read_trace(trace)
        return self._recorded[trace]

    @cached_property
    def _recorded(self) -> dict[Trace, RecordedDelays]:
        return {}

    def link_steps(self, vehicle: Vehicle, number: int = 1) -> tuple[LinkStep, ...]:
        """Return the states of a vehicle's whole link in time order, the first at 0 s, with its channel's air.

        `number`: which of its links; only the first has a channel.
        """
        channel = self._channel_of.get(vehicle.vehicle_id) if number == 1 else None
        steps = self.own_link_steps(vehicle, number)
        return steps if channel is None else through_air(steps, self.links.channels[channel])

    def all_link_steps(self, vehicle: Vehicle) -> list[LinkStep]:
        """Return the states of all links of a vehicle."""
        return [step for number in range(1, 1 + len(vehicle.endpoints)) for step in self.link_steps(vehicle, number)]

    def each_link(self) -> Iterator[tuple[Vehicle, int]]:
        """Yield each vehicle with the number of each of its links, from 1."""
        for vehicle in self.vehicles:
            yield from ((vehicle, number) for number in range(1, 1 + len(vehicle.endpoints)))

    @property
    def has_several_links(self) -> bool:
        """Whether any vehicle has more than one link."""
        return any(len(vehicle.endpoints) > 1 for vehicle in self.vehicles)

    @cached_property
    def _channel_of(self) -> dict[VehicleId, int]:
        return {each.vehicle_id: index for index, vehicles in self.channel_members() for each in vehicles}

    def own_link_steps(self, vehicle: Vehicle, number: int = 1) -> tuple[LinkStep, ...]:
        """Return the states of one of a vehicle's own links in time order, the first at 0 s."""
        return self._link_steps[vehicle.vehicle_id, number]

    @cached_property
    def _link_steps(self) -> dict[tuple[VehicleId, int], tuple[LinkStep, ...]]:
        """The states of each vehicle's links, which are numbered from 1; links with the same changes share them."""
        changes = {(vehicle.vehicle_id, number): list[int]() for vehicle, number in self.each_link()}
        for index, change in enumerate(self.links.changes):
            for vehicle in self.selected(change.vehicles):
                for number in range(1, 1 + len(vehicle.endpoints)):
                    if change.link is None or change.link == number:
                        changes[vehicle.vehicle_id, number].append(index)
        found = dict[tuple[int, ...], tuple[LinkStep, ...]]()
        for indexes in map(tuple, changes.values()):
            if indexes not in found:
                found[indexes] = link_steps(self.links, (self.links.changes[each] for each in indexes))
        return {link: found[tuple(indexes)] for link, indexes in changes.items()}
