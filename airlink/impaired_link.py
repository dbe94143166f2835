"""Impaired links between an engine and its vehicles."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import Address, Endpoint, VehicleId
from airlink.engine import Datagram, DelayQueue, Engine
from airlink.frame import MANY_REMOTES, MAX_REMOTES, StreamParser, first_system
from airlink.impairment import UNIMPAIRED, Direction, Impairment
from airlink.random_streams import random_stream

Schedule = Callable[[VehicleId, Instant], tuple[Impairment, Impairment]]
"""Returns the impairments of a vehicle's uplink and downlink at an instant."""

BLOCK: Final = 256
"""Number of datagrams whose random numbers are drawn together."""
DRAWS: Final = 4
"""Random numbers that a datagram can need: for its loss, its duplication, and the delays of both copies."""


class ChannelStatistics:
    """Counts of a channel so far."""

    def __init__(self) -> None:
        """Start at 0."""
        self.datagrams: int = 0
        """Datagrams sent."""
        self.lost: int = 0
        self.delivered: int = 0
        """Datagrams that arrived, counting both copies of duplicated ones."""
        self.total_delay_s: float = 0.0

    def add(self, other: ChannelStatistics) -> None:
        """Add another channel's counts."""
        self.datagrams += other.datagrams
        self.lost += other.lost
        self.delivered += other.delivered
        self.total_delay_s += other.total_delay_s

    @property
    def loss(self) -> float:
        """Share of the datagrams that were lost, 0 to 1."""
        return self.lost / self.datagrams if self.datagrams else 0.0

    @property
    def mean_delay_s(self) -> float:
        """Mean delay of those that arrived, s, including the wait for the limited rate; NaN if none did."""
        return self.total_delay_s / self.delivered if self.delivered else math.nan


class Channel:
    """One direction of one link.

    The n-th datagram always uses the n-th random numbers of the stream, whatever the impairment, so runs that
    differ only in an impairment can be compared datagram by datagram.
    """

    def __init__(self, stream: np.random.Generator) -> None:
        """Draw from `stream`."""
        self.statistics = ChannelStatistics()
        self._random = stream
        self._draws: list[list[float]] = []
        """Random numbers of the present block of datagrams."""
        self._drawn = 0
        self._lost_last = False
        self._busy_until = Instant(0)
        self._last_delivery = Instant(0)
        self._impairment = UNIMPAIRED
        self._transparent = True
        self._loss_after_arrival, self._loss_after_loss = 0.0, 0.0

    def pass_on(self, size_bytes: int, now: Instant, impairment: Impairment) -> list[Instant]:
        """Take a datagram at `now`; return when it is delivered: never, once or twice."""
        if impairment is not self._impairment:
            self._impairment, self._transparent = impairment, impairment.transparent
            self._loss_after_arrival, self._loss_after_loss = impairment.loss_after
        statistics = self.statistics
        number = statistics.datagrams
        statistics.datagrams = number + 1
        if self._transparent:
            self._lost_last = False
            deliveries = [max(now, self._last_delivery)]
        else:
            deliveries = self._impaired(number, size_bytes, now)
        if not deliveries:
            statistics.lost += 1
            return deliveries
        statistics.delivered += len(deliveries)
        total_s = 0.0
        for delivery in deliveries:
            total_s += seconds_between(now, delivery)
            self._last_delivery = max(self._last_delivery, delivery)
        statistics.total_delay_s += total_s
        return deliveries

    def _impaired(self, number: int, size_bytes: int, now: Instant) -> list[Instant]:
        while number >= self._drawn:
            self._draws = self._random.random((BLOCK, DRAWS)).tolist()
            self._drawn += BLOCK
        impairment, draws = self._impairment, self._draws[number - self._drawn]
        loss = self._loss_after_loss if self._lost_last else self._loss_after_arrival
        self._lost_last = draws[0] < loss
        departure = self._departure(size_bytes, now)
        if impairment.outage or self._lost_last or departure is None:
            return []
        more_s = 0.0
        process = impairment.process
        if process is not None:
            found_s = process(size_bytes, now)
            if found_s is None:
                return []
            more_s = found_s
        deliveries = [after(departure, impairment.delay_of(draws[2], number) + more_s)]
        if draws[1] < impairment.duplicate:
            deliveries.append(after(departure, impairment.delay_of(draws[3], number) + more_s))
            deliveries.sort()
        if not impairment.reorder:
            deliveries = [max(delivery, self._last_delivery) for delivery in deliveries]
        return deliveries

    def _departure(self, size_bytes: int, now: Instant) -> Instant | None:
        """Return when the last bit has been sent, None if the queue is full."""
        impairment = self._impairment
        if impairment.rate_bps == 0.0 or impairment.outage:
            return now
        start = max(now, self._busy_until)
        if seconds_between(now, start) > impairment.queue_s:
            return None
        self._busy_until = after(start, 8 * size_bytes / impairment.rate_bps)
        return self._busy_until


class ImpairedEngine(Engine):
    """An engine that wraps another and impairs the link of each vehicle that this one talks to.

    A datagram's sender is identified by the system id of its first frame and the network of its socket, once a valid
    frame has come from its address; its receiver by the address from which that vehicle was last heard. Datagrams from
    or to unknown vehicles pass unimpaired.
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

    def expect(self, socket: int, peer: Address, vehicle: VehicleId) -> None:
        """Take a vehicle to be at an address from which it was heard before."""
        self._vehicle_at[socket, peer] = vehicle

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the engine's sockets."""
        return self._engine.endpoints()

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Pass datagrams through the downlinks to the engine."""
        self._move_to(now)
        arrived: list[Datagram] = []
        for datagram in datagrams:
            vehicle = self._sender(datagram)
            if vehicle is None:
                arrived.append(datagram)
                continue
            for delivery in self._pass_on(vehicle, Direction.DOWNLINK, datagram):
                if delivery <= now:
                    arrived.append(datagram)
                else:
                    self._under_way.push(delivery, (Direction.DOWNLINK, datagram))
        if arrived:
            self._engine.receive(arrived, now)

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams that have passed the uplinks by now."""
        for datagram in self._engine.datagrams_to_send():
            vehicle = self._vehicle_at.get(datagram.remote)
            if vehicle is None:
                self._outbox.append(datagram)
                continue
            for delivery in self._pass_on(vehicle, Direction.UPLINK, datagram):
                own = Datagram(datagram.socket, datagram.peer, datagram.data)  # each copy is an object of its own
                if delivery <= self._now:
                    self._outbox.append(own)
                else:
                    self._under_way.push(delivery, (Direction.UPLINK, own))
        sent, self._outbox = self._outbox, []
        return sent

    def next_timer(self) -> Instant | None:
        """Return when the engine's timer is due or the next datagram arrives, whichever is first."""
        timer, arrival = self._engine.next_timer(), self._under_way.next()
        if timer is None or arrival is None:
            return arrival if timer is None else timer
        return min(timer, arrival)

    def handle_timer(self, now: Instant) -> None:
        """Deliver what has arrived; then let the engine handle its timer if it is due."""
        self._move_to(now)
        timer = self._engine.next_timer()
        if timer is not None and timer <= now:
            self._engine.handle_timer(now)

    def known_peers(self) -> frozenset[Address] | None:
        """Return the addresses that the engine knows."""
        return self._engine.known_peers()

    def left_unread(self, octets: int) -> None:
        """Tell the engine."""
        self._engine.left_unread(octets)

    def statistics(self, vehicle: VehicleId) -> tuple[ChannelStatistics, ChannelStatistics]:
        """Return a vehicle's statistics so far, of uplink and downlink; zeros if it was never heard from."""
        uplink, downlink = self._channels_of(vehicle)
        return uplink.statistics, downlink.statistics

    def _move_to(self, now: Instant) -> None:
        self._now = max(self._now, now)
        arrived: list[Datagram] = []
        for direction, datagram in self._under_way.pop_due(now):
            (arrived if direction is Direction.DOWNLINK else self._outbox).append(datagram)
        if arrived:
            self._engine.receive(arrived, now)

    def _sender(self, datagram: Datagram) -> VehicleId | None:
        """Return the vehicle that a datagram comes from, and store its address."""
        remote = datagram.remote
        vehicle = known = self._vehicle_at.get(remote)
        system = first_system(datagram.data)
        if system is not None and (vehicle is None or vehicle.system != system):
            sound = StreamParser().feed(datagram.data)
            vehicle = VehicleId(self._network_of_socket[datagram.socket], sound[0].system) if sound else vehicle
        if vehicle is not None and vehicle is not known:
            self._vehicle_at[remote] = vehicle
            if len(self._vehicle_at) > MAX_REMOTES:
                self._vehicle_at.popitem(last=False)
        elif vehicle is not None and len(self._vehicle_at) > MANY_REMOTES:
            self._vehicle_at.move_to_end(remote)
        return vehicle

    def _pass_on(self, vehicle: VehicleId, direction: Direction, datagram: Datagram) -> list[Instant]:
        impairment = self._schedule(vehicle, self._now)[direction]
        return self._channels_of(vehicle)[direction].pass_on(len(datagram.data), self._now, impairment)

    def _channels_of(self, vehicle: VehicleId) -> tuple[Channel, Channel]:
        channels = self._channels.get(vehicle)
        if channels is None:
            uplink, downlink = (Channel(random_stream(self._seed, "links", *vehicle, way)) for way in Direction)
            channels = self._channels[vehicle] = (uplink, downlink)
        return channels
