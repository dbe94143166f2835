"""Impaired links: around an engine, or between remotes and the target of a relay."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import NamedTuple

from airlink.clock import Instant
from airlink.endpoint import Address, Endpoint, VehicleId
from airlink.engine import Datagram, DelayQueue, Engine
from airlink.frame import StreamParser, first_system
from airlink.impairment import UNIMPAIRED, Channel, ChannelStatistics, Direction, Impairment, link_stream

Schedule = Callable[[VehicleId, Instant], tuple[Impairment, Impairment]]
"""Returns the impairments of a vehicle's uplink and downlink at an instant."""


MAX_REMOTES = 1024
"""Addresses that are remembered. The one silent longest is forgotten first, so strangers can't fill the memory."""
_NETWORK = 1


class LinkStatistics(NamedTuple):
    """Statistics of both directions of a vehicle's link."""

    uplink: ChannelStatistics
    downlink: ChannelStatistics


class ImpairedEngine:
    """Wraps an engine and impairs the link of each vehicle that it talks to; itself an engine.

    A datagram's sender is identified by the system id of its first frame and the network of its socket, once a valid
    frame has come from its address; its receiver by the address from which that vehicle was last heard. Datagrams of no
    known vehicle pass unimpaired.
    """

    def __init__(self, engine: Engine, network_of_socket: Sequence[int], schedule: Schedule, seed: int) -> None:
        """Wrap `engine`, whose socket s belongs to network `network_of_socket[s]`; links follow `schedule`."""
        self._engine = engine
        self._network_of_socket = network_of_socket
        self._schedule = schedule
        self._seed = seed
        self._channels: dict[VehicleId, tuple[Channel, Channel]] = {}
        self._vehicle_at = OrderedDict[tuple[int, Address], VehicleId]()
        self._under_way = DelayQueue[tuple[Direction, Datagram]]()
        self._outbox: list[Datagram] = []
        self._now = Instant(0)

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the engine's sockets."""
        return self._engine.endpoints()

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Send a datagram on its way to the engine."""
        self._move_to(now)
        vehicle = self._sender(datagram)
        if vehicle is None:
            self._engine.receive(datagram, now)
            return
        for delivery in self._pass_on(vehicle, Direction.DOWNLINK, datagram):
            if delivery <= now:
                self._engine.receive(datagram, now)
            else:
                self._under_way.push(delivery, (Direction.DOWNLINK, datagram))

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return what has passed the uplinks by now."""
        for datagram in self._engine.datagrams_to_send():
            vehicle = self._vehicle_at.get(datagram.remote)
            if vehicle is None:
                self._outbox.append(datagram)
                continue
            for delivery in self._pass_on(vehicle, Direction.UPLINK, datagram):
                if delivery <= self._now:
                    self._outbox.append(datagram)
                else:
                    self._under_way.push(delivery, (Direction.UPLINK, datagram))
        sent, self._outbox = self._outbox, []
        return sent

    def next_timer(self) -> Instant | None:
        """Return when the engine's timer is due or the next datagram arrives, whichever is first."""
        timers = [timer for timer in (self._engine.next_timer(), self._under_way.next()) if timer is not None]
        return min(timers, default=None)

    def handle_timer(self, now: Instant) -> None:
        """Deliver what has arrived; then let the engine handle its timer if it is due."""
        self._move_to(now)
        timer = self._engine.next_timer()
        if timer is not None and timer <= now:
            self._engine.handle_timer(now)

    def statistics(self, vehicle: VehicleId) -> LinkStatistics:
        """Return the statistics of a vehicle's link so far; all zero for one that was never heard."""
        uplink, downlink = self._channels_of(vehicle)
        return LinkStatistics(uplink.statistics, downlink.statistics)

    def _move_to(self, now: Instant) -> None:
        self._now = max(self._now, now)
        for direction, datagram in self._under_way.pop_due(now):
            if direction is Direction.DOWNLINK:
                self._engine.receive(datagram, now)
            else:
                self._outbox.append(datagram)

    def _sender(self, datagram: Datagram) -> VehicleId | None:
        """Return the vehicle that a datagram comes from, and remember where it can be reached."""
        remote = datagram.remote
        vehicle = self._vehicle_at.pop(remote, None)
        system = first_system(datagram.data)
        if system is not None and (vehicle is None or vehicle.system != system):
            sound = StreamParser().feed(datagram.data)
            vehicle = VehicleId(self._network_of_socket[datagram.socket], sound[0].system) if sound else vehicle
        if vehicle is not None:
            self._vehicle_at[remote] = vehicle
            if len(self._vehicle_at) > MAX_REMOTES:
                self._vehicle_at.popitem(last=False)
        return vehicle

    def _pass_on(self, vehicle: VehicleId, direction: Direction, datagram: Datagram) -> list[Instant]:
        impairment = self._schedule(vehicle, self._now)[direction]
        return self._channels_of(vehicle)[direction].pass_on(len(datagram.data), self._now, impairment)

    def _channels_of(self, vehicle: VehicleId) -> tuple[Channel, Channel]:
        channels = self._channels.get(vehicle)
        if channels is None:
            uplink, downlink = (Channel(link_stream(self._seed, vehicle, way)) for way in Direction)
            channels = self._channels[vehicle] = (uplink, downlink)
        return channels


class Passage(NamedTuple):
    """A datagram of one remote, in transit in one direction."""

    remote: int
    direction: Direction
    data: bytes


class Relay:
    """Impairs the links of remotes, numbered from 0; the present settings apply to all of them."""

    def __init__(self, seed: int) -> None:
        """Start with unimpaired links; remote r has the random numbers of vehicle r + 1 on network 1."""
        self.impairments: dict[Direction, Impairment] = dict.fromkeys(Direction, UNIMPAIRED)
        self._seed = seed
        self._channels: dict[tuple[int, Direction], Channel] = {}
        self._under_way = DelayQueue[Passage]()

    def accept(self, passage: Passage, now: Instant) -> None:
        """Send a datagram on its way."""
        key = (passage.remote, passage.direction)
        channel = self._channels.get(key)
        if channel is None:
            vehicle = VehicleId(_NETWORK, passage.remote + 1)
            channel = self._channels[key] = Channel(link_stream(self._seed, vehicle, passage.direction))
        for delivery in channel.pass_on(len(passage.data), now, self.impairments[passage.direction]):
            self._under_way.push(delivery, passage)

    def pop_due(self, now: Instant) -> list[Passage]:
        """Remove and return what has arrived by `now`."""
        return self._under_way.pop_due(now)

    def next_timer(self) -> Instant | None:
        """Return when the next datagram arrives, None if none is in transit."""
        return self._under_way.next()

    def statistics(self, direction: Direction) -> ChannelStatistics:
        """Return the statistics of one direction, summed over all remotes."""
        total = ChannelStatistics()
        for (_, of_direction), channel in self._channels.items():
            if of_direction is direction:
                total.datagrams += channel.statistics.datagrams
                total.lost += channel.statistics.lost
                total.delivered += channel.statistics.delivered
                total.total_delay_s += channel.statistics.total_delay_s
        return total
