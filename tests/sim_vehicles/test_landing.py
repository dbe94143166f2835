"""AUTOLAND: down beside the start of the final approach, then straight in along the take-off's direction."""

import pytest

ARM, SET_MODE = 400, 176
TAKEOFF, GUIDED, RTL, AUTOLAND = 13, 15, 11, 26
HEADING, ALTITUDE = 43002, 43001
ACCEPTED, FAILED = 0, 4


@pytest.mark.parametrize(
    ("wind_mps", "radius_m"),
    [((0.0, 0.0, 0.0), 115), ((0.0, 0.0, 0.0), -115), pytest.param((-5.0, 4.0, 0.0), 115, marks=pytest.mark.slow)],
)
def test_it_lands_where_it_took_off_the_same_way_and_disarms_itself(make_air, wind_mps, radius_m):
    air = make_air(in_air=False, wind_mps=wind_mps)
    air.run(3.1)
    air.ground.send(air.ground.dialect.param_set_encode(1, 1, b"WP_LOITER_RAD", radius_m, 9))
    air.set_mode(TAKEOFF)
    air.command_long(ARM, 1)
    air.run_until(lambda: air.state("height_m") > 45.0, limit_s=60.0)
    air.set_mode(GUIDED)
    air.command_int(HEADING, 1, 90.0, 5.0)
    air.command_int(ALTITUDE, z=100.0)
    air.run(60.0)
    assert air.set_mode(AUTOLAND) == ACCEPTED
    air.run_until(lambda: air.state("height_m") < 10.0, limit_s=400.0)
    assert -200.0 < air.state("north_m") < -50.0
    assert abs(air.state("east_m")) < 3.0
    air.run_until(lambda: not air.ground.of("HEARTBEAT")[-1].base_mode & 128, limit_s=500.0)
    assert air.state("height_m") == 0.0
    assert abs(air.state("north_m")) < 50.0
    assert abs(air.state("east_m")) < 4.0
    assert air.state("airspeed_mps") < 1.0
    assert "Throttle disarmed" in [said.text for said in air.ground.of("STATUSTEXT")]


def test_it_lands_only_in_flight_and_only_where_it_took_off(make_air, parked):
    assert parked.set_mode(AUTOLAND) == FAILED
    air = make_air()
    air.run(0.1)
    assert air.set_mode(RTL) == ACCEPTED
    assert air.set_mode(AUTOLAND) == FAILED
    assert air.ground.of("HEARTBEAT")[-1].custom_mode == RTL
    said = [air.ground.of("STATUSTEXT")[-1].text for air in (parked, air)]
    assert said == ["Must already be flying!", "Takeoff initial direction not set"]
