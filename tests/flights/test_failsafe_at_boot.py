"""Vehicles with their ground-station failsafes on are started, in whatever order they and the station come up."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant, after
from airlink.engine import Datagram, Engine
from airlink.messages.command import CommandInt, CommandLong
from airlink.messages.system import Statustext
from airlink.stream_parser import StreamParser
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.phases import Phase
from gcs_formation.station import Station
from sim_vehicles.autopilot.modes_and_failsafe import CopterMode, Mode, Px4Mode
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, MemoryRecorder, World

READ = PreFlightOptions(parameters=True)
SELDOM = {"rate_hz": 5}
COPTERS_PATH = {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [300, 0, 30], [600, 0, 30]]}
PX4_PATH = {"speed_mps": 14, "waypoints_m": [[0, 0, 60], [2000, 0, 60], [4000, 0, 60]]}
FAMILIES: dict[str, dict[str, Any]] = {
    "ArduPlane": {"parameters": {"FS_GCS_ENABL": 1, "FS_LONG_ACTN": 1}},
    "ArduCopter": {"parameters": {"FS_GCS_ENABLE": 1}, "model": "arducopter", "path": COPTERS_PATH},
    "PX4": {"parameters": {"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5}, "model": "px4", "path": PX4_PATH},
    "PX4 multirotor": {
        "parameters": {"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5},
        "model": "px4_copter",
        "path": COPTERS_PATH,
    },
}
LONGER_S = 9.0
"""Longer than any of these failsafes waits."""
TAKES_OFF_S = 60.0


class Radio(Engine):
    """The station's radio, which can be switched off."""

    def __init__(self, station: Engine) -> None:
        self._station = station
        self.on = True

    def endpoints(self) -> Any:
        return self._station.endpoints()

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        if self.on:
            self._station.receive(datagrams, now)

    def datagrams_to_send(self) -> list[Datagram]:
        sent = self._station.datagrams_to_send()
        return sent if self.on else []

    def next_timer(self) -> Instant | None:
        return self._station.next_timer()

    def handle_timer(self, now: Instant) -> None:
        self._station.handle_timer(now)


class Listening(Between):
    """Notes when the first command arrives that asks for more than messages, and what is said."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.commanded_s = math.inf
        self.texts = list[str]()
        """What the first vehicle says."""

    def datagrams_to_send(self) -> list[Datagram]:
        sent = super().datagrams_to_send()
        frames = (frame for each in sent if each.socket == 0 for frame in StreamParser().feed(each.data))
        self.texts += [each.message.text for each in frames if isinstance(each.message, Statustext)]
        return sent

    def take(self, datagram: Datagram, now: Instant) -> None:
        messages = (frame.message for frame in StreamParser().feed(datagram.data))
        commands = (each for each in messages if isinstance(each, CommandInt | CommandLong))
        if any(each.command != m.MAV_CMD_SET_MESSAGE_INTERVAL for each in commands):
            self.commanded_s = min(self.commanded_s, now / NANOSECONDS)
        super().take(datagram, now)


def on_the_ground(family: str, caution: PreFlightOptions = READ) -> World:
    """Return two vehicles of a family, their failsafes on, switched on at the same time as the station."""
    given = FAMILIES[family]
    vehicles = {"count": 2, "autopilot_parameters": given["parameters"]}
    keys: dict[str, Any] = {"start": {"in_air": False}, "telemetry": SELDOM, "law": SELDOM, "duration_s": 5}
    keys |= {"formation": {"shape": "line", "spacing_m": 30}}
    if "model" in given:
        keys["path"], vehicles["model"] = given["path"], given["model"]
    return World(Listening, caution, around=lambda engine, _: Radio(engine), vehicles=vehicles, **keys)


def another_station(world: World, caution: PreFlightOptions = READ) -> None:
    """Start another station in the place of the one before."""
    world.recorder = MemoryRecorder()
    world.station = Station(world.station.scenario, world.recorder, caution=caution)
    world.station.flight.resume(world.clock.now(), None)
    world.process.replace(world.station)


def silence(world: World, seconds: float) -> None:
    """Have no station for a while."""
    until = after(world.clock.now(), seconds)
    world.process.stop(world.clock.now(), 1e6)
    world.network.run(lambda: world.clock.now() >= until)
    assert isinstance(world.between, Listening)
    world.between.commanded_s = math.inf


def switch_radio(world: World, *, on: bool) -> None:
    radio = world.process._station
    assert isinstance(radio, Radio)
    radio.on = on


def station_first(_: str, world: World) -> None:
    """Let both begin at once."""


def vehicles_first(_: str, world: World) -> None:
    silence(world, 25.0)
    another_station(world)


def station_restarted(_: str, world: World) -> None:
    world.run(3.0)
    silence(world, LONGER_S)
    another_station(world)


def radio_off_and_on(_: str, world: World) -> None:
    """While the parameters are read."""
    world.run(1.5)
    switch_radio(world, on=False)
    world.run(LONGER_S)
    switch_radio(world, on=True)


def dry_run_then_fly(_: str, world: World) -> None:
    rehearses = PreFlightOptions(parameters=True, rehearse=True)
    another_station(world, rehearses)
    world.run(30.0)
    assert world.station.gate.rehearsed
    assert world.station.flight.phase is Phase.DONE
    silence(world, LONGER_S)
    another_station(world)


ORDERS = (station_first, vehicles_first, station_restarted, radio_off_and_on, dry_run_then_fly)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("family", FAMILIES)
def test_everybody_takes_off_in_whatever_order_they_and_the_station_come_up(
    family: str, order: Callable[[str, World], None]
) -> None:
    world = on_the_ground(family)
    order(family, world)
    world.network.run(
        lambda: world.station.flight.ended or all(each.start_up.finished for each in world.station.vehicles.values())
    )
    assert world.station.phase_machine.failure is None
    assert {each.pilot.airborne for each in world.fleet.vehicles} == {True}
    assert world.words("parameters") == ["in order"] * 2  # their failsafes are on to the end
    assert isinstance(world.between, Listening)
    assert max(world.times_s("parameters")) < world.between.commanded_s


def test_an_ardu_plane_without_a_station_goes_home_on_the_ground_and_can_not_be_armed_there() -> None:
    world = on_the_ground("ArduPlane")
    vehicle = world.vehicle(1)
    silence(world, 5.9)
    assert vehicle.pilot.mode is Mode.MANUAL
    world.run(0.2)  # it is up 1 s after boot, and FS_LONG_TIMEOUT is 5 s
    assert (vehicle.pilot.mode, vehicle.armable) == (Mode.RTL, False)
    world.run(10.0)
    assert isinstance(world.between, Listening)
    assert world.between.texts == ["GCS Failsafe On: RTL", "PreArm: RTL mode not armable"]
    assert not vehicle.arm(force=False)
    vehicle.enter(Mode.TAKEOFF)
    assert vehicle.armable
    world.run(20.0)
    assert vehicle.pilot.mode is Mode.TAKEOFF  # it acts once


@pytest.mark.parametrize(("family", "mode"), [("ArduCopter", CopterMode.STABILIZE), ("PX4", Px4Mode.HOLD)])
def test_others_keep_their_mode_on_the_ground_and_can_not_be_armed_until_a_station_is_heard(
    family: str, mode: object
) -> None:
    world = on_the_ground(family, PreFlightOptions(parameters=True, confirm=True))
    world.run(4.0)
    vehicle = world.vehicle(1)
    assert vehicle.armable
    silence(world, LONGER_S)
    assert (vehicle.mode, vehicle.armable, vehicle.arm(force=False)) == (mode, False, False)
    another_station(world, PreFlightOptions(confirm=True))
    world.run(2.0)
    assert vehicle.armable


def test_a_radio_switched_off_after_the_take_off_mode_is_set_undoes_it_and_it_is_set_again() -> None:
    """On the ground, before anybody is armed."""
    world = on_the_ground("ArduPlane", PreFlightOptions())
    for vehicle in world.fleet.vehicles:
        vehicle.parameters.prepare({"FS_LONG_TIMEOUT": 1.0})
    world.network.run(lambda: bool(world.times_s("mode", 2, "TAKEOFF")))
    switch_radio(world, on=False)
    world.run(4.0)
    assert world.vehicle(2).pilot.mode is Mode.RTL
    switch_radio(world, on=True)
    world.run(TAKES_OFF_S)
    assert world.station.phase_machine.failure is None
    assert world.vehicle(2).pilot.airborne


def test_a_failsafe_in_the_climb_of_a_take_off_waits_for_its_end() -> None:
    world = on_the_ground("ArduPlane")
    vehicle = world.vehicle(1)
    world.network.run(lambda: vehicle.pilot.airborne)
    silence(world, 6.0)
    assert vehicle.failsafe.active
    assert vehicle.pilot.mode is Mode.TAKEOFF
    world.run(20.0)
    assert vehicle.pilot.mode is Mode.RTL


def test_an_armed_copter_on_the_ground_is_disarmed_by_its_failsafe() -> None:
    world = on_the_ground("ArduCopter")
    vehicle = world.vehicle(1)
    vehicle.parameters.prepare({"DISARM_DELAY": 60.0})
    world.run(4.0)
    world.process.stop(world.clock.now(), 1e6)
    vehicle.pilot.enter(CopterMode.GUIDED, vehicle.body.motion)
    vehicle.arm(force=True)
    world.run(LONGER_S)
    assert not vehicle.pilot.condition.armed
    assert vehicle.pilot.mode is CopterMode.GUIDED
