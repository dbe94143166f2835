"""Impaired links between an engine and its vehicles."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from airlink.clock import Instant
from airlink.endpoint import Address, Endpoint, VehicleId
from airlink.engine import Datagram, DelayQueue, Engine
from airlink.frame import first_system
from airlink.impairment import Direction, Impairment
from airlink.one_way_channel import Channel, ChannelStatistics
from airlink.radio.settings import RADIO
from airlink.radio.shared_radio import SharedRadio
from airlink.random_streams import random_stream
from airlink.receiver import MANY_REMOTES, MAX_REMOTES
from airlink.stream_parser import StreamParser

LinkId = tuple[VehicleId, int]
"""A vehicle, and which of its links, from 1."""
Schedule = Callable[[VehicleId, Instant], tuple[Impairment, Impairment]]
"""Returns the impairments of a vehicle's uplink and downlink at an instant."""
FurtherSchedule = Callable[[VehicleId, Instant, int], tuple[Impairment, Impairment]]
"""Returns those of a vehicle's link with a number from 2."""
Numbers = Mapping[tuple[VehicleId, int], int]
"""Which of its links a vehicle has at a socket, where that isn't the first."""
Radios = Mapping[VehicleId, SharedRadio[Datagram]]
"""The radio by which each vehicle is reached, if it is one for several."""
NO_RADIOS: Final[Radios] = MappingProxyType({})
UPLINK: Final = Direction.UPLINK
DOWNLINK: Final = Direction.DOWNLINK
"""By name: to look a member of an enumeration up takes longer than all else that a datagram needs here."""
NO_NUMBERS: Final[Numbers] = MappingProxyType({})


class ImpairedEngine(Engine):
    """An engine that wraps another and impairs the link of each vehicle that this one talks to.

    A datagram's sender is identified by the system id of its first frame and the network of its socket, once a valid
    frame has come from its address; its receiver by the address from which that vehicle was last received. Datagrams
    from or to unknown vehicles pass unimpaired. What goes to or comes from a vehicle with a radio passes that first, on
    its first link.
    """

    def __init__(
        self,
        engine: Engine,
        network_of_socket: Sequence[int],
        schedule: Schedule,
        seed: int,
        radios: Radios = NO_RADIOS,
        numbers: Numbers = NO_NUMBERS,
        further: FurtherSchedule | None = None,
    ) -> None:
        """Wrap `engine`, whose socket s belongs to network `network_of_socket[s]`; links follow `schedule`.

        Where a vehicle has several links, the later ones are at the sockets in `numbers`, and follow `further`.
        """
        self._numbers, self._further = numbers, further
        self._engine = engine
        self._network_of_socket = network_of_socket
        self._schedule = schedule
        self._seed = seed
        self._radio_of = dict(radios)
        self._radios = list({id(radio): radio for radio in radios.values()}.values())
        self._channels: dict[VehicleId, list[tuple[Channel, Channel]]] = {}
        """Of each vehicle's links, up and down."""
        self._vehicle_at = OrderedDict[tuple[int, Address], VehicleId]()
        self._under_way = DelayQueue[tuple[Direction, Datagram]]()
        self._outbox: list[Datagram] = []
        self._now = Instant(0)

    def expect(self, socket: int, peer: Address, vehicle: VehicleId) -> None:
        """Take a vehicle to be at an address from which it was received before."""
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
            if self._radios and self._takes_radio(vehicle, DOWNLINK, datagram):
                continue
            for delivery in self._pass_on(vehicle, DOWNLINK, datagram):
                if delivery <= now:
                    arrived.append(datagram)
                else:
                    self._under_way.push(delivery, (DOWNLINK, datagram))
        if arrived:
            self._engine.receive(arrived, now)

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams that have passed the uplinks by now."""
        for datagram in self._engine.datagrams_to_send():
            vehicle = self._vehicle_at.get(datagram.remote)
            if vehicle is None:
                self._outbox.append(datagram)
                continue
            if self._radios and self._takes_radio(vehicle, UPLINK, datagram):
                continue
            for delivery in self._pass_on(vehicle, UPLINK, datagram):
                own = _copy(datagram)
                if delivery <= self._now:
                    self._outbox.append(own)
                else:
                    self._under_way.push(delivery, (UPLINK, own))
        sent, self._outbox = self._outbox, []
        return sent

    def next_timer(self) -> Instant | None:
        """Return when the engine's timer or a radio's is due, or the next datagram arrives, whichever is first."""
        first = _earlier(self._engine.next_timer(), self._under_way.next())
        for radio in self._radios:
            first = _earlier(first, radio.next_timer())
        return first

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

    def statistics(self, vehicle: VehicleId, number: int = 1) -> tuple[ChannelStatistics, ChannelStatistics]:
        """Return the statistics so far of a vehicle's link, up and down; zeros if it was never received from there."""
        uplink, downlink = self._channels_of(vehicle, number)
        return uplink.statistics, downlink.statistics

    def _move_to(self, now: Instant) -> None:
        self._now = max(self._now, now)
        arrived: list[Datagram] = []
        for radio in self._radios:
            self._move_radio_to(radio, now)
            if radio.report_due(now):
                arrived += self._reports(radio)
        for direction, datagram in self._under_way.pop_due(now):
            (arrived if direction is DOWNLINK else self._outbox).append(datagram)
        if arrived:
            self._engine.receive(arrived, now)

    def _sender(self, datagram: Datagram) -> VehicleId | None:
        """Return the vehicle that a datagram comes from, and store its address."""
        remote = datagram.remote
        vehicle = known = self._vehicle_at.get(remote)
        system = first_system(datagram.data)
        if system is not None and (vehicle is None or vehicle.system != system):
            sound = [each for each in StreamParser().feed(datagram.data) if (each.system, each.component) != RADIO]
            if not sound and system == RADIO.system:
                return None  # a real radio's own report
            vehicle = VehicleId(self._network_of_socket[datagram.socket], sound[0].system) if sound else vehicle
        if vehicle is not None and vehicle is not known:
            self._vehicle_at[remote] = vehicle
            if len(self._vehicle_at) > MAX_REMOTES:
                self._vehicle_at.popitem(last=False)
        elif vehicle is not None and len(self._vehicle_at) > MANY_REMOTES:
            self._vehicle_at.move_to_end(remote)
        return vehicle

    def _takes_radio(self, vehicle: VehicleId, direction: Direction, datagram: Datagram) -> bool:
        """Give a datagram to the vehicle's radio; return False if it has none."""
        radio = self._radio_of.get(vehicle)
        if radio is None or (vehicle, datagram.socket) in self._numbers:
            return False
        self._move_radio_to(radio, self._now)
        if not radio.offer(direction, vehicle, len(datagram.data), datagram, self._now):
            self._channels_of(vehicle)[direction].lose()
        return True

    def _move_radio_to(self, radio: SharedRadio[Datagram], now: Instant) -> None:
        """Let what the radio has sent by now pass its vehicle's own link."""
        for sent in radio.passed(now):
            vehicle = VehicleId(*sent.vehicle)
            channel = self._channels_of(vehicle)[sent.direction]
            deliveries = list[Instant]()
            if sent.air_s is None:
                channel.lose()
            else:
                impairment = self._schedule(vehicle, sent.left)[sent.direction]
                deliveries = channel.pass_on(sent.size_bytes, sent.left, impairment, sent.waited_s, sent.air_s)
            if not deliveries:
                radio.lose(sent.vehicle, sent.direction)
            for delivery in deliveries:
                self._under_way.push(delivery, (sent.direction, _copy(sent.item)))

    def _reports(self, radio: SharedRadio[Datagram]) -> list[Datagram]:
        """Return what the radio's ground end reports, at each address of its vehicles; those of these ends are sent."""
        report = radio.ground_report()
        found = list[Datagram]()
        for (socket, peer), vehicle in self._vehicle_at.items():
            if self._radio_of.get(vehicle) is radio and (vehicle, socket) not in self._numbers:
                found.append(Datagram(socket, peer, report))
                self._outbox.append(Datagram(socket, peer, radio.vehicle_report(vehicle)))
        return found

    def _pass_on(self, vehicle: VehicleId, direction: Direction, datagram: Datagram) -> list[Instant]:
        number = self._numbers.get((vehicle, datagram.socket), 1) if self._numbers else 1
        if number == 1 or self._further is None:
            up, down = self._schedule(vehicle, self._now)
        else:
            up, down = self._further(vehicle, self._now, number)
        uplink, downlink = self._channels_of(vehicle, number)
        if direction is UPLINK:
            return uplink.pass_on(len(datagram.data), self._now, up)
        return downlink.pass_on(len(datagram.data), self._now, down)

    def _channels_of(self, vehicle: VehicleId, number: int = 1) -> tuple[Channel, Channel]:
        each = self._channels.get(vehicle)
        if each is None:
            each = self._channels[vehicle] = []
        while len(each) < number:
            key = [*vehicle] if not each else [*vehicle, len(each) + 1]
            uplink, downlink = (
                Channel(random_stream(self._seed, "further links" if each else "links", *key, direction))
                for direction in Direction
            )
            each.append((uplink, downlink))
        return each[number - 1]


def _copy(datagram: Datagram) -> Datagram:
    """Return a datagram of its own, as each copy has to be: its receiver owns it."""
    return Datagram(datagram.socket, datagram.peer, datagram.data)


def _earlier(one: Instant | None, other: Instant | None) -> Instant | None:
    if one is None or other is None:
        return other if one is None else one
    return min(one, other)
