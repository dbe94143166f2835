"""Bodies of emulated vehicles: motion of the air, and aircraft under total-energy control beside equation (7)."""

import math

import numpy as np
import pytest

from airlink.endpoint import VehicleId, parse_endpoint
from flight_model.autopilot_model import advance
from formation_scenario.start_states import StartState
from formation_scenario.vehicles import EnergyAirframe, VehicleModel
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.hovering import HoveringBody
from sim_vehicles.airframe.motion import Approach
from sim_vehicles.config import Pitot, VehicleConfig

LOOP_S = 0.02


START = StartState(0.0, 0.0, 100.0, airspeed_mps=22.0, in_air=True)
ENDPOINT = parse_endpoint("udpout:127.0.0.1:14550")


def body(airframe=None, number=1, seed=1, wind_mps=(0.0, 0.0, 0.0)):
    """Return a vehicle in the air, heading north at 22 m/s; without an airframe it flies by equation (7)."""
    model = VehicleModel(airframe=None if airframe is None else EnergyAirframe(**airframe))
    made = Body(VehicleConfig(VehicleId(1, number), ENDPOINT, START, model), wind_mps, seed)
    made.steering.stopped, made.steering.airborne = False, True
    return made


def reported(made, speed=22.0, heading=0.0, height=100.0):
    made.steering.speed_mps, made.steering.direction_rad, made.steering.height_m = speed, heading, height
    return made


def fly(made, seconds):
    """Fly, and return the states' values (K, 8)."""
    flown = [made.state.values()]
    for _ in range(round(seconds / LOOP_S)):
        made.fly()
        flown.append(made.state.values())
    return np.array(flown)


def test_without_an_airframe_a_vehicle_flies_by_equation_7():
    flown = fly(made := reported(body(), speed=24.0, heading=1.0, height=110.0), 4.0)
    expected = body().state
    for values in flown[1:]:
        advance(expected, made.model, 24.0, 1.0, 110.0, LOOP_S)
        assert values.tolist() == list(expected.values())


@pytest.mark.parametrize(
    ("wind_mps", "ground_mps"),
    [((0.0, 0.0), 12.0), ((-4.0, 0.0), 8.0), ((4.0, 0.0), 16.0), ((0.0, 7.2), 9.6), ((-15.0, 0.0), 0.0)],
)
def test_a_glide_slope_ends_before_home_by_what_the_speed_over_ground_takes_to_brake(wind_mps, ground_mps):
    """v^2 / 2a and v times the height's delay, of v over ground: in 7.2 m/s across, (12^2 - 7.2^2)^1/2 = 9.6 m/s."""
    crab_rad = -math.asin(wind_mps[1] / 12.0)
    over_mps = 12.0 * math.cos(crab_rad) + wind_mps[0], 12.0 * math.sin(crab_rad) + wind_mps[1]
    made = reported(body())
    made.fly()
    motion = made.motion
    motion.north_m, motion.east_m, motion.airspeed_mps, motion.heading_rad = -500.0, 0.0, 12.0, crab_rad
    motion.velocity_north_mps, motion.velocity_east_mps = over_mps
    lead_m = ground_mps**2 / (2.0 * 0.5) + ground_mps * 3.0
    course_rad, height_m = Approach(0.0, 0.0, 0.0, 1000.0, 50.0, 12.0, 0.5, 3.0).guide(motion)
    assert height_m == pytest.approx(50.0 * (500.0 - lead_m) / 1000.0)
    assert course_rad == pytest.approx(0.0)


@pytest.mark.parametrize("wind_mps", [(-4.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 5.0, 0.0)])
def test_what_touches_down_rolls_on_as_it_came_over_the_ground_and_is_carried_no_farther(wind_mps):
    """Its nose turns to its course. It used to roll where its nose pointed, at its airspeed, from that instant on."""
    made = reported(body(wind_mps=wind_mps))
    made.fly()
    north_mps, east_mps, _ = made.ground_velocity()
    assert (north_mps, east_mps) == pytest.approx((22.0 + wind_mps[0], wind_mps[1]), abs=0.05)
    made.steering.stopped, made.steering.airborne = True, False
    made.fly()
    rolls_mps = made.state.airspeed_mps
    assert rolls_mps == pytest.approx(math.hypot(north_mps, east_mps), abs=0.1)
    assert made.ground_velocity()[:2] == pytest.approx(
        (rolls_mps * math.cos(made.state.heading_rad), rolls_mps * math.sin(made.state.heading_rad))
    )
    assert made.state.heading_rad == pytest.approx(math.atan2(east_mps, north_mps), abs=0.01)


def test_what_falls_to_the_ground_lies_there_in_any_wind():
    made = reported(body(wind_mps=(3.0, -8.0, 0.0)))
    made.fly()
    made.ground()
    made.steering.stopped, made.steering.airborne = True, False
    made.fly()
    assert made.ground_velocity() == pytest.approx((0.0, 0.0, 0.0))


def test_what_flies_by_its_sensor_flies_faster_in_thin_air_and_where_the_sensor_reads_low():
    """At 3100 m air has 0.735 of its density at sea level (ICAO Doc 7488)."""
    for scale, expected_mps in ((1.0, 22.0 / math.sqrt(0.7346)), (0.9, 22.0 / 0.9 / math.sqrt(0.7346))):
        pitot = Pitot(3000.0, scale)
        made = Body(
            VehicleConfig(VehicleId(1, 1), ENDPOINT, START, VehicleModel(speed_max_mps=40), pitot=pitot), (0, 0, 0), 1
        )
        made.steering.stopped, made.steering.airborne = False, True
        fly(reported(made, speed=22.0), 60.0)
        assert made.state.airspeed_mps == pytest.approx(expected_mps, rel=1e-3)
        assert pitot.indicated(made.state.airspeed_mps, 100.0) == pytest.approx(22.0, rel=1e-3)


def test_the_velocity_over_ground_is_through_the_air_plus_what_carries_it():
    made = reported(body(wind_mps=(1.0, 2.0, 0.5)), heading=math.radians(30), height=120.0)
    fly(made, 30.0)
    north, east, down = made.ground_velocity()
    cos, sin = math.cos(made.state.heading_rad), math.sin(made.state.heading_rad)
    assert (north, east) == pytest.approx((1 + 22 * cos, 2 + 22 * sin))
    assert down == 0.5 - made.state.climb_mps
    assert made.state.heading_rad == pytest.approx(math.radians(30), abs=1e-6)


def test_what_stands_on_the_ground_stays_there_whatever_the_wind():
    made = body(wind_mps=(5.0, 5.0, 0.0))
    made.ground()
    made.steering.stopped, made.steering.airborne = True, False
    flown = fly(made, 10.0)
    assert (flown == flown[0]).all()
    assert made.ground_velocity() == (0.0, 0.0, 0.0)


def test_nothing_sinks_below_the_ground():
    flown = fly(reported(body(), height=-50.0), 60.0)
    assert flown[:, 2].min() == 0.0


def test_nothing_happens_before_the_dead_time_is_over():
    flown = fly(reported(body({"dead_time_s": 0.6, "spread": 0.0, "airspeed_noise_mps": 0.0}), heading=1.0), 1.0)
    moved = np.abs(flown[:, 5]) > 1e-9
    assert 0.6 <= np.argmax(moved) * LOOP_S <= 0.66


STILL = {"spread": 0.0, "airspeed_noise_mps": 0.0}
HOVERS = {"hovers": True, "speed_min_mps": 0.0, "speed_max_mps": 29.0}


def steered(keys, kind=Body):
    """Return the states (K, 8) of a vehicle whose steering changes in every quantity, each at its own time."""
    model = VehicleModel(**keys)
    made = kind(VehicleConfig(VehicleId(1, 1), ENDPOINT, START, model), (0.0, 0.0, 0.0), 1)
    made.steering.stopped, made.steering.airborne = False, True
    made.steering.velocity_mps, made.steering.yaw_rad = (22.0, 0.0, 0.0), 0.0
    flown = [fly(reported(made), 0.1)]
    made.steering.accel_mps2, made.steering.lateral_mps2 = 0.8, 3.0
    flown.append(fly(reported(made, speed=25.0), 0.1))
    made.steering.velocity_mps = (5.0, 1.0, -1.0)
    flown.append(fly(reported(made, speed=25.0, heading=1.0), 0.1))
    made.steering.yaw_rad = 1.0
    flown.append(fly(reported(made, speed=25.0, heading=1.0, height=105.0), 3.0))
    return np.concatenate([each[1:] for each in flown])


@pytest.mark.parametrize(
    ("keys", "kind"),
    [({}, Body), ({"prompt_share": 0.6}, Body), ({"airframe": STILL}, Body), (HOVERS, HoveringBody)],
)
def test_a_vehicle_with_a_dead_time_flies_as_without_exactly_as_much_later(keys, kind):
    """0.3 s are 15 cycles. The position differs, since it flies straight on meanwhile."""
    prompt, late = steered(keys, kind), steered(keys | {"dead_time_s": 0.3}, kind)
    moved = [2, 3, 4] if kind is HoveringBody else [2, 3, 4, 5]
    assert np.abs(late[15:, moved] - prompt[:-15, moved]).max() < 1e-9
    assert np.abs(prompt[15:, moved] - prompt[:-15, moved]).max() > 0.1


def height_after_8_s(keys, number, seed=1):
    return fly(reported(body(keys, number, seed), height=110.0), 8.0)[-1, 2]


def test_aircraft_of_a_kind_differ_as_the_seed_says():
    assert height_after_8_s({}, 1) == height_after_8_s({}, 1)
    assert height_after_8_s({}, 1) != height_after_8_s({}, 2)
    assert height_after_8_s({}, 1) != height_after_8_s({}, 1, seed=2)
    alike = {"spread": 0.0, "airspeed_noise_mps": 0.0}
    assert height_after_8_s(alike, 1) == height_after_8_s(alike, 2)


def test_airspeed_is_reported_late_and_in_steps():
    made = reported(body({"airspeed_step_mps": 0.5, "airspeed_noise_mps": 0.0, "spread": 0.0}), speed=25.0)
    seen = []
    for _ in range(250):
        made.fly()
        seen.append((made.state.airspeed_mps, made.shown_mps))
    true, shown = np.array(seen).T
    assert set(np.round(shown / 0.5 % 1.0, 9)) == {0.0}
    assert np.argmax(shown > 23.0) - np.argmax(true > 23.25) > 0.1 / LOOP_S
    assert body().shown_mps is None


def test_wind_carries_an_aircraft():
    state = (made := body({"airspeed_noise_mps": 0.0}, wind_mps=(3.0, -2.0, 0.0))).state
    fly(reported(made), 1.0)
    assert state.north_m == pytest.approx(25.0, abs=0.05)
    assert state.east_m == pytest.approx(-2.0, abs=0.05)
    assert math.isclose(state.height_m, 100.0, abs_tol=0.05)
