"""Take-offs beside those measured on simulated aircraft of ArduPlane 4.7 and PX4 1.17; times are from arming."""

import bisect
import math

import pytest

from formation_scenario import load_scenario
from sim_vehicles.autopilot.modes_and_failsafe import Px4Mode
from tests.sim_vehicles.conftest import mavlink

ARM, SPEED, ALTITUDE, HEADING = 400, 43000, 43001, 43002
TAKEOFF, GUIDED = 13, 15
TO_100_M = {4: 3.1, 5: 20.1, 6: 36.5, 7: 50.9, 8: 64.2, 10: 89.6, 12: 109.3, 14: 113.4, 18: 100.4, 22: 98.9, 28: 99.3}
"""Height, m, by time, s: mode TAKEOFF, TKOFF_ALT 100."""
GUIDED_FROM_45_M = {4: 2.9, 5: 18.8, 6: 35.0, 7: 48.0, 8: 57.6, 10: 64.5, 12: 63.4, 14: 67.4, 18: 83.9, 22: 96.0}
"""The same with TKOFF_ALT 50, then from 45 m GUIDED to 100 m and 22 m/s."""
REACHED_S: dict[int, float] = {1: 3.9, 10: 4.5, 45: 6.8, 50: 7.2, 90: 19.5, 98: 23.7}
"""Times at which that flight passed heights, m."""


def model_of(name, speed_mps):
    path = {"speed_mps": speed_mps, "waypoints_m": [[0, 0, 100], [900, 0, 100]]}
    return load_scenario({"vehicles": {"count": 1, "model": name}, "path": path}).vehicles[0].model


class TakeOff:
    """One vehicle's heights, airspeeds and climbs at times from arming, in steps of the main loop."""

    def __init__(self, air):
        self.air, self.armed_s = air, air.seconds
        self.times_s, self.states = [], []

    def fly(self, until_s, until_m=math.inf):
        state = self.air.fleet.bodies[0].state
        while self.air.seconds < self.armed_s + until_s and state.height_m < until_m:
            self.air.run(0.02)
            self.times_s.append(self.air.seconds - self.armed_s)
            self.states.append(state.copy())

    def at(self, time_s):
        return self.states[bisect.bisect_left(self.times_s, time_s)]

    def reached_s(self, height_m):
        return next(
            time_s for time_s, state in zip(self.times_s, self.states, strict=True) if state.height_m >= height_m
        )


@pytest.fixture
def armed(make_air):
    """Return a factory of ArduPlanes that have just been armed in TAKEOFF."""

    def make(height_m, seed):
        air = make_air(in_air=False, model=model_of("arduplane", 22), seed=seed)
        air.run(3.1)
        air.ground.send(mavlink.MAVLink_param_set_message(1, 1, b"TKOFF_ALT", height_m, 9))
        air.set_mode(TAKEOFF)
        assert air.command_long(ARM, 1) == 0
        return TakeOff(air)

    return make


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_arduplane_rolls_and_climbs_as_measured(armed, seed):
    flight = armed(100, seed)
    flight.fly(30.0)
    for time_s, speed_mps in {1: 2.2, 2: 11.9, 3: 17.8, 4: 22.3, 6: 21.9, 8: 23.8, 10: 25.0}.items():
        assert flight.at(time_s).airspeed_mps == pytest.approx(speed_mps, abs=2.0)
    run_m = next(state.north_m for state in flight.states if state.height_m > 0.5)
    assert run_m == pytest.approx(38.0, abs=5.0)
    for time_s, height_m in TO_100_M.items():
        assert flight.at(time_s).height_m == pytest.approx(height_m, abs=7.0)
    assert max(state.climb_mps for state in flight.states) == pytest.approx(17.2, abs=3.5)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_arduplane_that_is_guided_from_45_m_on_comes_to_100_m_when_a_real_one_does(armed, seed):
    flight = armed(50, seed)
    flight.fly(9.0, until_m=45.0)
    flight.air.set_mode(GUIDED)
    flight.air.command_int(SPEED, 0, 22, 0)
    flight.air.command_int(HEADING, 1, 0, 7.26)
    flight.air.command_int(ALTITUDE, z=100)
    flight.fly(30.0)
    for time_s, height_m in GUIDED_FROM_45_M.items():
        assert flight.at(time_s).height_m == pytest.approx(height_m, abs=5.0)
    for reached_m, reached_s in REACHED_S.items():
        assert flight.reached_s(reached_m) == pytest.approx(reached_s, abs=1.2)


def test_where_the_climb_ends_height_climb_and_airspeed_go_on(armed):
    flight = armed(50, 1)
    flight.fly(20.0)
    for before, after in zip(flight.states, flight.states[1:], strict=False):
        assert abs(after.height_m - before.height_m) < 0.4
        assert abs(after.climb_mps - before.climb_mps) < 0.8
        assert abs(after.airspeed_mps - before.airspeed_mps) < 0.25
        assert abs(math.remainder(after.heading_rad - before.heading_rad, math.tau)) < 0.02


def test_a_px4_rolls_and_climbs_as_measured(make_air):
    """Measured in PX4 1.17's built-in simulator; heights were read to 1 m."""
    air = make_air(in_air=False, model=model_of("px4", 14), cruise_mps=14.0)
    air.run(4.0)
    air.command_long(22, 0, 0, 0, math.nan, math.nan, math.nan, 50.0)
    assert air.command_long(ARM, 1) == 0
    flight = TakeOff(air)
    flight.fly(24.0)
    for time_s, speed_mps in {2.1: 14.6, 2.6: 16.9, 3.1: 17.8, 6.1: 18.0, 11.1: 18.2}.items():
        assert flight.at(time_s).airspeed_mps == pytest.approx(speed_mps, abs=2.0)
    for time_s, height_m in {3.1: 2.2, 5.1: 13.5, 8.1: 29.4, 11.1: 43.1, 13.1: 51.3, 14.1: 52.1, 19.6: 48.3}.items():
        assert flight.at(time_s).height_m == pytest.approx(height_m, abs=2.5)
    assert flight.reached_s(50.0) == pytest.approx(12.6, abs=1.0)
    assert air.fleet.vehicles[0].mode is Px4Mode.HOLD


def test_a_px4_multirotor_spools_up_and_climbs_slowly_to_10_m(make_air):
    """Then it flies 60 m north by DO_REPOSITION. Measured in PX4 1.17's built-in simulator."""
    air = make_air(in_air=False, model=model_of("px4_copter", 5))
    air.run(4.0)
    air.command_long(22, 0, 0, 0, math.nan, math.nan, math.nan, 20.0)
    assert air.command_long(ARM, 1) == 0
    flight = TakeOff(air)
    flight.fly(25.0)
    for time_s, height_m in {4.6: 0.2, 6.6: 2.1, 8.6: 4.4, 10.6: 7.1, 12.6: 10.3, 14.6: 14.5, 16.7: 18.4}.items():
        assert flight.at(time_s).height_m == pytest.approx(height_m, abs=2.8)
    assert air.fleet.vehicles[0].mode is Px4Mode.HOLD
    air.command_int(192, -1, 1, 0, math.nan, frame=5, x=350005396, y=1250000000, z=20)
    for north_m in (2, 10, 18, 26, 35, 43, 52, 58, 61):
        flight.fly(air.seconds - flight.armed_s + 2.0)
        assert flight.states[-1].north_m == pytest.approx(north_m, abs=5.5)
