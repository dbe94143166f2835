"""An emulated vehicle's battery, by hand."""

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from formation_scenario.battery import EmulatedBattery
from sim_vehicles.airframe.battery import Battery, throttle_of
from tests.flights.in_memory import World

START = Instant(0)
HALF = 0.5


def test_level_flight_takes_the_cruising_current() -> None:
    """10 A for 6 minutes are 1000 mAh; before the first throttle there is none."""
    battery = Battery(EmulatedBattery(capacity_mah=4000, charged_percent=90, cells=3), START)
    battery.drain(HALF, START)
    battery.drain(HALF, after(START, 360.0))
    assert battery.consumed_mah == pytest.approx(1000.0)
    assert (battery.percent, battery.current_a) == (65, pytest.approx(10.0))
    assert battery.voltage_v == pytest.approx(3 * (3.5 + 0.7 * 0.65))


def test_without_throttle_the_idle_current_flows_and_an_empty_battery_stays_empty() -> None:
    battery = Battery(EmulatedBattery(capacity_mah=100, charged_percent=1), START)
    battery.drain(0.0, after(START, 3.6))
    assert (battery.consumed_mah, battery.current_a) == (pytest.approx(0.5), 0.5)
    battery.drain(0.0, after(START, 3600.0))
    assert (battery.percent, battery.share) == (0, 0.0)


def test_throttle_grows_with_airspeed_and_climb() -> None:
    world = World(vehicles=[{"id": 1, "role": "leader"}])
    motion = world.vehicle(1).body.motion
    motion.airspeed_mps, motion.climb_mps = 22.0, 0.0
    assert throttle_of(motion, 22.0, 3.0, hovers=False) == pytest.approx(0.5)
    motion.climb_mps = 1.5
    assert throttle_of(motion, 22.0, 3.0, hovers=False) == pytest.approx(0.75)
    motion.airspeed_mps, motion.climb_mps = 11.0, -3.0
    assert throttle_of(motion, 22.0, 3.0, hovers=False) == 0.0
    assert throttle_of(motion, 22.0, 3.0, hovers=True) == 0.0


def test_it_is_reported_in_both_messages() -> None:
    world = World(vehicles=[{"id": 1, "role": "leader", "battery": {"capacity_mah": 500, "charged_percent": 50}}])
    world.run(10.0)
    vehicle = world.vehicle(1)
    status = vehicle.builders[m.MAVLINK_MSG_ID_SYS_STATUS](vehicle)
    battery = vehicle.builders[m.MAVLINK_MSG_ID_BATTERY_STATUS](vehicle)
    assert battery.battery_remaining == status.battery_remaining == 44
    assert battery.current_consumed == pytest.approx(27, abs=2)
    assert world.station.vehicles[vehicle.config.identity].telemetry.battery.left == pytest.approx(0.44, abs=0.03)
