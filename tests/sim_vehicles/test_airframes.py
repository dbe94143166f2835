"""Aircraft of a fleet that fly under total-energy control, beside those that fly by equation (7)."""

import math

import numpy as np
import pytest

from airlink.endpoint import VehicleId, parse_endpoint
from formation_scenario.vehicles import EnergyAirframe, VehicleModel
from sim_vehicles.airframe.airframes import Airframes
from sim_vehicles.airframe.dynamics import Command, State, step
from sim_vehicles.config import FleetConfig, Start, VehicleConfig

LOOP_S = 0.02


START = Start(0.0, 0.0, 100.0, airspeed_mps=22.0, in_air=True)
ENDPOINT = parse_endpoint("udpout:127.0.0.1:14550")


def vehicle(number, airframe):
    model = VehicleModel(airframe=None if airframe is None else EnergyAirframe(**airframe))
    return VehicleConfig(VehicleId(1, number), ENDPOINT, START, model)


def fleet(*airframes, seed=1):
    """A fleet whose vehicles have these airframes; None: equation (7)."""
    return FleetConfig(0.6, 2.1, 0.0, tuple(vehicle(i, each) for i, each in enumerate(airframes, 1)), seed=seed)


def level(count):
    return State(np.repeat(np.array([[0.0], [0.0], [100.0], [0.0], [22.0], [0.0]]), count, axis=1))


def told(count, speed=22.0, heading=0.0, height=100.0):
    air = np.array([[speed] * count, [heading] * count])
    return Command(air, np.full((2, count), np.inf), np.full(count, height))


def fly(config, seconds, **setpoints):
    state, count = level(len(config.vehicles)), len(config.vehicles)
    frames, flown = Airframes(config, state), [state.table]
    for _ in range(round(seconds / LOOP_S)):
        state = frames.step(state, told(count, **setpoints), np.zeros((3, count)), np.ones(count, dtype=np.bool_))
        flown.append(state.table)
    return np.array(flown)


def test_beside_an_aircraft_a_vehicle_of_equation_7_flies_as_ever():
    config = fleet(None, {})
    flown, state = fly(config, 4.0, speed=24.0, heading=1.0, height=110.0), level(2)
    parameters = Airframes(fleet(None, None), state).parameters
    for table in flown[1:]:
        state = step(state, told(2, 24.0, 1.0, 110.0), parameters, np.zeros((3, 2)))
        assert (table[:, 0] == state.table[:, 0]).all()


def test_nothing_happens_before_the_dead_time_is_over():
    flown = fly(fleet({"dead_time_s": 0.6, "spread": 0.0, "airspeed_noise_mps": 0.0}), 1.0, heading=1.0)
    moved = np.abs(flown[:, 5, 0]) > 1e-9
    assert 0.6 <= np.argmax(moved) * LOOP_S <= 0.66


def test_aircraft_of_a_kind_differ_as_the_seed_says():
    once, again, other = (fly(fleet({}, {}, seed=seed), 8.0, height=110.0)[-1, 2] for seed in (1, 1, 2))
    assert (once == again).all()
    assert once[0] != once[1]
    assert once[0] != other[0]
    alike = fly(fleet({"spread": 0.0, "airspeed_noise_mps": 0.0}, {"spread": 0.0, "airspeed_noise_mps": 0.0}), 8.0)
    assert alike[-1, 2, 0] == alike[-1, 2, 1]


def test_airspeed_is_told_late_and_in_steps():
    config = fleet({"airspeed_step_mps": 0.5, "airspeed_noise_mps": 0.0, "spread": 0.0})
    state = level(1)
    frames, seen = Airframes(config, state), []
    for _ in range(250):
        state = frames.step(state, told(1, speed=25.0), np.zeros((3, 1)), np.ones(1, dtype=np.bool_))
        seen.append((state.airspeed_mps[0], frames.airspeed_mps(0)))
    true, shown = np.array(seen).T
    assert set(np.round(shown / 0.5 % 1.0, 9)) == {0.0}
    assert np.argmax(shown > 23.0) - np.argmax(true > 23.25) > 0.1 / LOOP_S
    assert Airframes(fleet(None), level(1)).airspeed_mps(0) is None


def test_wind_carries_an_aircraft():
    config, state = fleet({"airspeed_noise_mps": 0.0}), level(1)
    frames = Airframes(config, state)
    for _ in range(50):
        state = frames.step(state, told(1), np.array([[3.0], [-2.0], [0.0]]), np.ones(1, dtype=np.bool_))
    assert state.north_m[0] == pytest.approx(25.0, abs=0.05)
    assert state.east_m[0] == pytest.approx(-2.0, abs=0.05)
    assert math.isclose(state.height_m[0], 100.0, abs_tol=0.05)
