"""Autopilots whose clocks are stepped: their bodies in the scenario's air, and their MAVLink on the run's network."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from airlink.clock import Instant, after
from airlink.endpoint import LOOPBACK, Address, Endpoint
from airlink.engine import Datagram, Engine
from gcs_formation.app.sitl.exchange import Exchange, ExchangeError, Sample
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.airframe.rigid_body.fixed_wing import FixedWing
from sim_vehicles.airframe.rigid_body.motion import RigidBody
from sim_vehicles.airframe.rigid_body.quadrotor import Quadrotor
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import FleetConfig
from sim_vehicles.truth import TruthWriter

CYCLE_S: Final = 0.01
"""Between an autopilot's looks at its serial ports, s."""
AIR_CYCLES: Final = round(LOOP_S / CYCLE_S)
"""Cycles for each change of the air, and each look of the ground truth: a cycle of the emulators' main loop."""
MAX_DATAGRAM: Final = 65535
CALL: Final = b"\0"
"""Is no MAVLink: shows an autopilot that waits for a station where that is."""


class SteppedVehicle:
    """One autopilot: what steps its clock, its body, and its serial port."""

    def __init__(
        self, name: str, exchange: Exchange, body: RigidBody, station: Address | None, serial_port: int
    ) -> None:
        """Listen for its link.

        `station`: where the ground station listens, None if that sends first; `serial_port`: where the autopilot
        listens, 0 if it sends first.
        """
        self.exchange, self.body, self.station = exchange, body, station
        self._name, self.steps = name, round(CYCLE_S / exchange.step_s)
        """`steps`: of its clock in a cycle."""
        self._serial = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._serial.bind((LOOPBACK, 0))
        self._serial.setblocking(False)
        self.port: int = self._serial.getsockname()[1]
        """The UDP port to which it sends."""
        self._sender: tuple[str, int] | None = (LOOPBACK, serial_port) if serial_port else None
        self.calls = bool(serial_port)
        """Whether the autopilot must first be sent something, and has sent nothing yet."""
        self._number = 0
        self._home = body.state.north_m, body.state.east_m, body.state.height_m
        self.outputs_us: tuple[int, ...] = ()
        """What it last put out."""

    def clock_s(self) -> float:
        """Return how far its clock has been stepped, s."""
        return self._number * self.exchange.step_s

    def ask(self) -> None:
        """Wait until it has done all that its last sample made it do, and asks for the next.

        Raises:
            ExchangeError: it doesn't; the message says whose simulator it is.
        """
        try:
            self.outputs_us = self.exchange.outputs_us()
        except ExchangeError as error:
            raise ExchangeError(f"vehicle {self._name}: {error}") from error

    def answer(self) -> None:
        """Move the body for a step, and let the autopilot measure that."""
        body = self.body
        sensed = body.step(self.outputs_us)
        state, home = body.state, self._home
        self._number += 1
        position_m = state.north_m - home[0], state.east_m - home[1], home[2] - state.height_m
        self.exchange.answer(
            Sample(
                self._number,
                sensed.accel_mps2,
                sensed.gyro_rps,
                position_m,
                body.attitude,
                body.velocity_mps,
                sensed.airspeed_mps,
            )
        )

    def send(self, data: bytes) -> None:
        """Let its link receive; what comes before it is known where it listens is lost."""
        if self._sender is not None:
            with suppress(OSError):
                self._serial.sendto(data, self._sender)

    def sent(self) -> list[bytes]:
        """Return what its link has sent since the last call."""
        if self.calls:
            self.send(CALL)
        found = list[bytes]()
        while True:
            try:
                data, self._sender = self._serial.recvfrom(MAX_DATAGRAM)
            except OSError:
                return found
            found.append(data)
            self.calls = False

    def close(self) -> None:
        """Free its link's port."""
        self._serial.close()


class SteppedFleet(Engine):
    """Moves all autopilots in step: in each cycle each has done all that its samples made it do.

    What they do between two steps they do at the same time, on the machine's processors.
    """

    def __init__(
        self, config: FleetConfig, exchanges: Sequence[Exchange], serial_ports: Sequence[int], truth: TruthWriter
    ) -> None:
        """Set each vehicle's body at its start; `serial_ports`: where autopilots listen, 0 of those that send first."""
        self.config, self._truth = config, truth
        self.each = [
            SteppedVehicle(
                str(vehicle.identity), exchange, body_of(config, index, exchange.step_s), vehicle.endpoint.peer, port
            )
            for index, (vehicle, exchange, port) in enumerate(
                zip(config.vehicles, exchanges, serial_ports, strict=True)
            )
        ]
        self.bodies = [each.body for each in self.each]
        self.environment = Environment(config, self.bodies)
        self.failure: str | None = None
        """What ended the exchange, in words; None if nothing did."""
        self._outbox: list[Datagram] = []
        self._cycles, self._next = 0, after(Instant(0), CYCLE_S)

    def begin(self) -> None:
        """Wait until all autopilots have started.

        Raises:
            ExchangeError: one hasn't.
        """
        for each in self.each:
            each.ask()

    def run_on(self) -> None:
        """Let all go on by a cycle.

        Raises:
            ExchangeError: one doesn't ask for the next sample.
        """
        rounds = max(each.steps for each in self.each)
        for number in range(rounds):
            stepped = [each for each in self.each if number * each.steps % rounds < each.steps]
            for each in stepped:
                each.answer()
            for each in stepped:
                each.ask()

    def drop_sent(self) -> None:
        """Drop what their links have sent before the station listens."""
        for each in self.each:
            each.sent()

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return each vehicle's own end of its link."""
        return tuple(each.endpoint for each in self.config.vehicles)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:  # noqa: ARG002 - they read in their own time
        """Pass datagrams on to the vehicles' serial ports."""
        for datagram in datagrams:
            each = self.each[datagram.socket]
            each.station = datagram.peer
            each.send(datagram.data)

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        out, self._outbox = self._outbox, []
        return out

    def next_timer(self) -> Instant | None:
        """Return when the next cycle ends; None once the exchange has failed."""
        return None if self.failure else self._next

    def handle_timer(self, now: Instant) -> None:
        """Run every cycle that is due."""
        while self._next <= now and self.failure is None:
            self._cycle(self._next)
            self._next = after(self._next, CYCLE_S)

    def _cycle(self, now: Instant) -> None:
        if self._cycles % AIR_CYCLES == 0:
            self.environment.advance(now)
        for body in self.bodies:
            body.update_density()
        try:
            self.run_on()
        except ExchangeError as error:
            self.failure = str(error)
            return
        self._cycles += 1
        for index, each in enumerate(self.each):
            each.body.settle()
            peer = each.station
            sent = each.sent()
            if peer is not None:
                self._outbox += [Datagram(index, peer, data) for data in sent]
        if self._cycles % AIR_CYCLES == 0:
            self._truth.take(now, self.bodies)

    def close(self) -> None:
        """Free all ports."""
        for each in self.each:
            each.close()


def body_of(config: FleetConfig, index: int, step_s: float) -> RigidBody:
    """Return a vehicle's body, standing at its start."""
    vehicle = config.vehicles[index]
    made = Quadrotor if vehicle.model.hovers else FixedWing
    return made(vehicle, config.wind_mps, config.seed, config.origin.alt_m, step_s)
