"""An aircraft under total-energy control against mechanics, and against steps flown by a simulated ArduPlane."""

import math
from pathlib import Path

import numpy as np
import pytest

from flight_model import energy
from flight_model.energy import GRAVITY_MPS2
from formation_scenario.source import Source
from formation_scenario.vehicle_files import read_model
from formation_scenario.vehicles import EnergyAirframe

SHIPPED = read_model("arduplane", Path(), Source(None, {}), ())
KEYS = EnergyAirframe.model_validate(SHIPPED["airframe"])
BANK_RAD = math.atan(22.0 * 0.25 / GRAVITY_MPS2)


def aircraft(speed_mps=22.0):
    begun, parameters = energy.Aircraft(100.0, 0.0, speed_mps, 0.0), KEYS.parameters()
    energy.trim(begun, parameters)
    return begun, parameters


def fly(speed_mps, seconds, speed=None, heading=0.0, height=100.0):
    """Heights, airspeeds and headings (3, K) every 0.02 s of an aircraft that gets new setpoints at time 0."""
    one, parameters = aircraft(speed_mps)
    commanded = energy.Commanded(speed_mps if speed is None else speed, math.inf, heading, BANK_RAD, height)
    flown = [(one.height_m, one.speed_mps, one.heading_rad)]
    for cycle in range(round(seconds / energy.CYCLE_S)):
        if cycle % energy.CYCLES == 0:
            energy.control(one, commanded, parameters)
        energy.cycle(one, commanded, parameters)
        flown.append((one.height_m, one.speed_mps, one.heading_rad))
    return np.array(flown).T


@pytest.mark.parametrize("speed_mps", [18.0, 22.0, 26.0])
def test_trimmed_aircraft_fly_on_straight_and_level(speed_mps):
    heights, speeds, _ = fly(speed_mps, 20.0)
    assert np.ptp(heights) == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(speeds) == pytest.approx(0.0, abs=1e-6)


def test_energy_changes_by_thrust_less_drag_and_nothing_else():
    one, parameters = aircraft()
    one.pitch += 0.2
    commanded = energy.Commanded(22.0, math.inf, 0.0, 1.0, 100.0)
    before = GRAVITY_MPS2 * one.height_m + 0.5 * one.speed_mps**2
    drag_mps2 = lift_mps = 0.0
    for _ in range(50):
        speed, thrust = one.speed_mps, one.throttle * KEYS.thrust_mps2
        drag_mps2 = KEYS.drag_mps2 * (speed / 22) ** 2 + KEYS.induced_drag_mps2 * (22 / speed) ** 2
        lift_mps += (thrust - drag_mps2) * speed * energy.CYCLE_S
        energy.cycle(one, commanded, parameters)
    after = GRAVITY_MPS2 * one.height_m + 0.5 * one.speed_mps**2
    assert one.height_m > 101.5
    assert after - before == pytest.approx(lift_mps, abs=0.3)


def test_a_bank_at_its_limit_turns_at_gravity_times_its_tangent_by_the_speed():
    _, _, headings = fly(22.0, 6.0, heading=3.0)
    rate = (headings[250] - headings[150]) / 2.0
    assert rate == pytest.approx(GRAVITY_MPS2 * math.tan(BANK_RAD) / 22.0, rel=0.02)


def reached_s(values, begin, end, share):
    return float(np.argmax((values - begin) / (end - begin) >= share)) * energy.CYCLE_S + KEYS.dead_time_s


# Times to 63 and 90 % of steps that ArduPlane flew in its simulator, at 22 m/s unless named.
@pytest.mark.parametrize(
    ("begin", "end", "t63_s", "t90_s"), [(22, 26, 4.2, 7.4), (26, 22, 4.5, 8.5), (18, 26, 6.3, 9.8)]
)
def test_steps_of_airspeed_take_as_long_as_arduplanes(begin, end, t63_s, t90_s):
    _, speeds, _ = fly(float(begin), 20.0, speed=float(end))
    assert reached_s(speeds, begin, end, 0.63) == pytest.approx(t63_s, rel=0.25)
    assert reached_s(speeds, begin, end, 0.9) == pytest.approx(t90_s, rel=0.2)


@pytest.mark.parametrize("degrees", [20, 90])
def test_steps_of_heading_take_as_long_as_arduplanes(degrees):
    _, _, headings = fly(22.0, 20.0, heading=math.radians(degrees))
    assert 3.2 <= reached_s(headings, 0.0, math.radians(degrees), 0.63) <= 4.8
    assert 6.5 <= reached_s(headings, 0.0, math.radians(degrees), 0.9) <= 8.8


@pytest.mark.parametrize("climb_m", [10.0, -10.0, 30.0, -30.0])
def test_steps_of_height_take_as_long_as_arduplanes(climb_m):
    heights, _, _ = fly(22.0, 25.0, height=100.0 + climb_m)
    assert 4.0 <= reached_s(heights, 100.0, 100.0 + climb_m, 0.63) <= 7.2
    assert 7.6 <= reached_s(heights, 100.0, 100.0 + climb_m, 0.9) <= 11.0


def test_a_large_gain_of_speed_is_paid_in_height_as_arduplane_does():
    heights, _, _ = fly(18.0, 20.0, speed=26.0)
    assert 100.0 - heights.min() == pytest.approx(5.4, rel=0.2)


def test_a_demand_that_is_swung_quickly_comes_back_larger():
    """The demand's rate is fed forward: at 0.8 rad/s airspeed swings by more than the 0.3 of a time constant of 4 s."""
    one, parameters = aircraft()
    swung = []
    for cycle in range(3000):
        commanded_mps = 22.0 + 0.5 * math.sin(0.8 * cycle * energy.CYCLE_S)
        commanded = energy.Commanded(commanded_mps, math.inf, 0.0, 1.0, 100.0)
        if cycle % energy.CYCLES == 0:
            energy.control(one, commanded, parameters)
        energy.cycle(one, commanded, parameters)
        swung.append(one.speed_mps)
    assert np.ptp(swung[1500:]) / 1.0 > 0.6


@pytest.mark.parametrize("throttle_cruise", [0.3, 0.5, 0.7, 0.75, 0.9, 1.0])
def test_whatever_the_cruise_throttle_an_aircraft_climbs_out_as_its_autopilot_assumes(throttle_cruise):
    """From 0.7 on it accelerated to where full throttle flew level, and stayed 4 to 40 m high."""
    keys = EnergyAirframe(throttle_cruise=throttle_cruise)
    parameters = keys.parameters()
    climbing = energy.Aircraft(0.0, 0.0, 0.8 * keys.airspeed_cruise_mps, 0.0)
    energy.trim(climbing, parameters)
    level = energy.Commanded(keys.airspeed_cruise_mps, math.inf, 0.0, 1.0, 100.0)
    for _ in range(round(20.0 / energy.CYCLE_S)):
        energy.climb_out(climbing, energy.full_throttle(parameters), parameters)
        energy.cycle(climbing, level, parameters)
    assert climbing.climb_mps > 0.98 * keys.climb_max_mps
    assert climbing.height_m > 50.0


def test_the_steepest_climb_is_what_thrust_leaves_of_drag():
    """22 m/s by (14 - 6.7 - 0.065) / 9.80665."""
    assert energy.steepest_climb_mps(EnergyAirframe().parameters()) == pytest.approx(16.23, abs=0.01)
