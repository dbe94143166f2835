"""Faults that end: a hang, ignored commands, a pilot's mode switch."""

import math

import pytest

from airlink.endpoint import VehicleId
from formation_scenario.surroundings import Fault, PilotsMode
from sim_vehicles.autopilot.modes_and_failsafe import CopterMode
from tests.sim_vehicles.test_copter import MODEL

WHO = frozenset({VehicleId(1, 1)})
HEADING, INTERVAL, ATTITUDE, LAND = 43002, 511, 30, 21
UNSUPPORTED = 3
FBWA, RTL, GUIDED = 5, 11, 15
AT_S, END_S = 60.0, 80.0


@pytest.fixture
def struck(make_air):
    """Return a vehicle in GUIDED on which a fault has just begun; it ends 20 s later."""

    def made(kind, mode: PilotsMode = "LOITER"):
        air = make_air(1, faults=((Fault(at_s=AT_S, until_s=END_S, kind=kind, mode=mode), WHO),))
        air.run(3.0)
        air.set_mode(GUIDED)
        air.send_mission_time(AT_S)
        air.run(0.1)
        return air

    return made


def counted(air, name, seconds):
    before = len(air.ground.of(name))
    air.run(seconds)
    return len(air.ground.of(name)) - before


def test_a_hang_that_ends_leaves_the_clock_and_no_backlog(struck):
    air = struck("freeze")
    assert counted(air, "HEARTBEAT", 19.8) == 0
    assert 10 <= counted(air, "HEARTBEAT", 10.0) <= 12
    assert air.ground.of("SYSTEM_TIME")[-1].time_boot_ms / 1e3 == pytest.approx(air.seconds, abs=1.1)
    assert air.command_int(HEADING, 1, 90.0, 10.0) == 0


def test_a_vehicle_that_ignores_acknowledges_orders_and_flies_on(struck):
    air = struck("ignore")
    heading_rad = air.state("heading_rad")
    assert air.set_mode(RTL) == 0
    assert air.command_int(HEADING, 1, 90.0, 10.0) == 0
    assert air.command_long(INTERVAL, ATTITUDE, 100_000) == 0
    assert 95 <= counted(air, "ATTITUDE", 10.0) <= 102  # telemetry goes on
    assert air.ground.of("HEARTBEAT")[-1].custom_mode == GUIDED
    assert air.state("heading_rad") == pytest.approx(heading_rad)
    air.run(10.0)
    assert air.command_int(HEADING, 1, 90.0, 10.0) == 0
    air.run(15.0)
    assert math.degrees(air.state("heading_rad")) == pytest.approx(90.0, abs=0.5)


def test_of_two_faults_that_overlap_the_later_end_counts(struck):
    air = struck("ignore")
    other = Fault(at_s=20.0, until_s=60.0, kind="ignore")
    vehicle = air.fleet.vehicles[0]
    vehicle.inject(other, vehicle.now, ends=False)
    air.run(25.0)
    assert vehicle.ignores
    vehicle.inject(other, vehicle.now, ends=True)
    assert not vehicle.ignores


def test_a_pilot_takes_the_vehicle_and_gives_it_back(struck):
    air = struck("pilot", mode="FBWA")
    air.run(1.0)
    assert air.ground.of("HEARTBEAT")[-1].custom_mode == FBWA
    air.run(20.0)
    assert air.ground.of("HEARTBEAT")[-1].custom_mode == GUIDED


def test_a_multirotor_that_ignores_hovers_at_an_order_to_land_and_refuses_what_only_planes_know(make_air):
    air = make_air(1, model=MODEL)
    air.run(8.0)
    vehicle = air.fleet.vehicles[0]
    vehicle.inject(Fault(at_s=AT_S, kind="ignore"), vehicle.now, ends=False)
    assert air.command_long(LAND) == 0
    assert air.command_int(HEADING, 1, 90.0, 10.0) == UNSUPPORTED
    air.run(5.0)
    assert vehicle.mode is CopterMode.GUIDED
    assert air.state("height_m") == pytest.approx(100.0, abs=0.1)
