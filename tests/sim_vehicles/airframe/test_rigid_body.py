"""Rigid bodies: what mechanics says of them, whatever their coefficients, and the trim that these have."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.endpoint import VehicleId, parse_endpoint
from flight_model.energy import GRAVITY_MPS2
from formation_scenario.start_states import StartState
from formation_scenario.vehicles import VehicleModel
from sim_vehicles.airframe.rigid_body import fixed_wing, quadrotor
from sim_vehicles.airframe.rigid_body.fixed_wing import FixedWing, coefficients
from sim_vehicles.airframe.rigid_body.motion import (
    RigidBody,
    bank_of,
    pitch_of,
    rotated,
    to_body,
    to_earth,
    wind_share,
    yaw_of,
)
from sim_vehicles.airframe.rigid_body.quadrotor import Quadrotor
from sim_vehicles.config import VehicleConfig

STEP_S = 0.0025
LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)
REFERENCE_M = 584.0
"""Above sea level: where the quadrotor's reference density is."""
angles = st.floats(-3.0, 3.0)
components = st.floats(-50.0, 50.0)


def body(
    made: type[RigidBody] = FixedWing,
    wind_mps: tuple[float, float, float] = STILL,
    field_m: float = 0.0,
    heading_rad: float = 0.0,
) -> RigidBody:
    start = StartState(0.0, 0.0, 0.0, heading_rad, 0.0, False)
    config = VehicleConfig(VehicleId(1, 1), parse_endpoint("udpout:127.0.0.1:14550"), start, VehicleModel())
    found = made(config, wind_mps, 1, field_m, STEP_S)
    found.update_density()
    return found


def aloft(made: type[RigidBody] = FixedWing, velocity_mps: tuple[float, float, float] = STILL) -> RigidBody:
    found = body(made, field_m=REFERENCE_M - 100.0)
    found.state.height_m, found.velocity_mps = 100.0, velocity_mps
    found.update_density()
    return found


@given(angles, angles, angles, components, components, components)
def test_axes_turn_there_and_back(p: float, q: float, r: float, a: float, b: float, c: float) -> None:
    attitude = rotated(LEVEL, p, q, r, 1.0)
    assert math.sqrt(sum(part * part for part in attitude)) == pytest.approx(1.0, abs=1e-12)
    assert to_body(attitude, to_earth(attitude, (a, b, c))) == pytest.approx((a, b, c), abs=1e-9)


@pytest.mark.parametrize(
    ("rates", "angle"), [((0.5, 0.0, 0.0), bank_of), ((0.0, 0.5, 0.0), pitch_of), ((0.0, 0.0, 0.5), yaw_of)]
)
def test_positive_rates_bank_right_raise_the_nose_and_turn_right(
    rates: tuple[float, float, float], angle: object
) -> None:
    attitude = LEVEL
    for _ in range(100):
        attitude = rotated(attitude, *rates, 0.01)
    assert [each(attitude) for each in (bank_of, pitch_of, yaw_of)] == pytest.approx(
        [0.5 if each is angle else 0.0 for each in (bank_of, pitch_of, yaw_of)], abs=1e-9
    )


@pytest.mark.parametrize("made", [FixedWing, Quadrotor])
def test_standing_it_measures_gravity_and_stays_in_any_wind(made: type[RigidBody]) -> None:
    standing = body(made, (8.0, -6.0, 1.0), heading_rad=1.0)
    for _ in range(400):
        sensed = standing.step([1500, 1500, 1000, 1500] if made is FixedWing else [1000] * 4)
    standing.settle()
    assert sensed.accel_mps2 == pytest.approx((0.0, 0.0, -GRAVITY_MPS2), abs=1e-3)
    assert sensed.gyro_rps == pytest.approx(STILL, abs=1e-6)
    state = standing.state
    assert (state.north_m, state.east_m, state.height_m, state.heading_rad) == pytest.approx((0, 0, 0, 1.0), abs=1e-3)
    assert not standing.airborne


def test_falling_freely_it_measures_nothing() -> None:
    falling = aloft(Quadrotor)
    sensed = falling.step([1000] * 4)
    assert sensed.accel_mps2 == pytest.approx(STILL, abs=1e-9)
    assert falling.velocity_mps[2] == pytest.approx(GRAVITY_MPS2 * STEP_S)


def test_quadrotor_hovers_at_its_share_of_full_thrust_and_is_balanced() -> None:
    hovering = aloft(Quadrotor)
    expo, share = quadrotor.EXPO, quadrotor.HOVER_THRUST_SHARE
    command = (-(1 - expo) + math.sqrt((1 - expo) ** 2 + 4 * expo * share)) / (2 * expo)
    hovering.act([round(quadrotor.IDLE_US + command * (quadrotor.FULL_US - quadrotor.IDLE_US))] * 4)
    force, moment = hovering.forces(STILL)
    assert force == pytest.approx((0.0, 0.0, -quadrotor.MASS_KG * GRAVITY_MPS2), rel=2e-3)
    assert moment == pytest.approx(STILL, abs=1e-9)


@pytest.mark.parametrize(("motor", "signs"), [(0, (-1, 0, 1)), (1, (1, 0, 1)), (2, (0, 1, -1)), (3, (0, -1, -1))])
def test_each_motor_lifts_its_side_and_turns_against_its_rotor(motor: int, signs: tuple[int, int, int]) -> None:
    hovering = aloft(Quadrotor)
    hovering.act([1700 if each == motor else 1500 for each in range(4)])
    _, moment = hovering.forces(STILL)
    assert tuple((part > 1e-9) - (part < -1e-9) for part in moment) == signs


def test_a_quadrotors_drag_is_of_the_order_of_its_weight_at_its_terminal_speed() -> None:
    """There it tilts by 45 degrees; level, more of the air is across its rotors."""
    tilted, weight_n = aloft(Quadrotor), quadrotor.MASS_KG * GRAVITY_MPS2
    drags = []
    for speed_mps in (0.0, 0.5 * quadrotor.TERMINAL_MPS, quadrotor.TERMINAL_MPS):
        tilted.act([1800] * 4)
        drags.append(-tilted.forces((speed_mps, 0.0, 0.0))[0][0])
    assert drags[0] == 0.0
    assert drags[2] == pytest.approx(weight_n, rel=0.35)
    assert 2.5 * drags[1] < drags[2] < 4.0 * drags[1]  # between linear and quadratic


def test_a_quadrotors_thrust_falls_as_it_climbs_into_its_air() -> None:
    climbing = aloft(Quadrotor)
    climbing.act([1600] * 4)
    lifts = [-climbing.forces((0.0, 0.0, down_mps))[0][2] for down_mps in (0.0, -5.0)]
    assert 0.0 < lifts[1] < lifts[0]


def test_turning_is_damped_about_each_axis() -> None:
    for made, air in ((FixedWing, (20.0, 0.0, 0.0)), (Quadrotor, STILL)):
        for axis in range(3):
            turning = aloft(made, air)
            turning.act([1500] * 4)
            still = turning.forces(air)[1][axis]
            rates = [0.0, 0.0, 0.0]
            rates[axis] = 0.5
            turning.rates_rps = (rates[0], rates[1], rates[2])
            assert turning.forces(air)[1][axis] < still


def test_a_fixed_wing_turns_into_a_wind_from_the_side() -> None:
    """A weathercock: air from the right makes it yaw right, and drives it left."""
    flying = aloft()
    (_, side_n, _), (_, _, yaw) = flying.forces((20.0, 2.0, 0.0))
    assert yaw > 0.0
    assert side_n < 0.0


@pytest.mark.parametrize("wind", [(20.0, 0.0, 0.0), (-20.0, 0.0, 0.0), (0.0, 20.0, 0.0)])
def test_a_parked_fixed_wing_is_tied_down(wind: tuple[float, float, float]) -> None:
    parked = body(FixedWing, wind)
    for _ in range(4000):
        parked.step([1500, 1500, 1000, 1500])
    assert (parked.state.north_m, parked.state.east_m, parked.state.height_m) == (0.0, 0.0, 0.0)


def test_lift_grows_with_the_angle_of_attack_until_the_stall_and_then_is_a_plates() -> None:
    """Equation (4.9); a plate's normal force at a right angle is all drag, and from behind it has no lift."""
    lifts = {
        alpha: coefficients(alpha)[0] for alpha in (0.0, 0.1, fixed_wing.STALL_RAD - 0.1, fixed_wing.STALL_RAD + 0.1)
    }
    assert lifts[0.0] == pytest.approx(fixed_wing.LIFT_0, abs=1e-6)
    assert lifts[0.1] - lifts[0.0] == pytest.approx(0.1 * fixed_wing.LIFT_ALPHA, abs=1e-3)
    assert lifts[fixed_wing.STALL_RAD + 0.1] < lifts[fixed_wing.STALL_RAD - 0.1]
    assert coefficients(math.pi / 2) == pytest.approx((0.0, 2.0 + fixed_wing.PARASITIC_DRAG), abs=1e-6)
    assert coefficients(math.pi) == pytest.approx((0.0, fixed_wing.PARASITIC_DRAG), abs=1e-6)
    assert coefficients(-0.8)[0] == pytest.approx(-coefficients(0.8)[0], abs=1e-6)


@pytest.mark.parametrize("airspeed_mps", [12.0, 14.0, 22.0])
def test_at_its_trim_a_fixed_wing_flies_level_and_climbs_by_the_power_that_is_left(airspeed_mps: float) -> None:
    """Lift carries its weight, and thrust its drag, at the angle of attack that its lift curve says."""
    trim, weight_n = fixed_wing.trim_of(airspeed_mps), fixed_wing.MASS_KG * GRAVITY_MPS2
    flying = body()
    lift = weight_n / (0.5 * flying.density * airspeed_mps**2 * fixed_wing.AREA_M2)
    alpha = (lift - fixed_wing.LIFT_0) / fixed_wing.LIFT_ALPHA
    flying.act([1500, 1500, round(1000 + 1000 * trim.throttle), 1500])
    air = (airspeed_mps * math.cos(alpha), 0.0, airspeed_mps * math.sin(alpha))
    x, _, z = flying.forces(air)[0]
    ahead_n, below_n = x * math.cos(alpha) + z * math.sin(alpha), z * math.cos(alpha) - x * math.sin(alpha)
    assert ahead_n == pytest.approx(0.0, abs=0.02)  # a pulse is rounded to 1 µs
    thrust_below_n = -trim.throttle * fixed_wing.THRUST_N * math.sin(alpha)
    assert below_n == pytest.approx(thrust_below_n - weight_n, rel=1e-3)
    assert trim.climb_mps + trim.sink_mps == pytest.approx(airspeed_mps * fixed_wing.THRUST_N / weight_n)
    assert trim.throttle == pytest.approx(trim.sink_mps / (trim.climb_mps + trim.sink_mps))


@pytest.mark.parametrize(("output", "axis"), [(0, 0), (1, 1)])
def test_at_the_steady_rate_for_a_deflection_damping_holds_the_surfaces_moment(output: int, axis: int) -> None:
    trim, air = fixed_wing.trim_of(14.0), (14.0, 0.0, 0.0)
    turning = aloft(velocity_mps=air)
    still = turning.forces(air)[1][axis]
    for _ in range(100):
        turning.act([1600 if each == output else 1500 for each in range(4)])
    rates = [0.0, 0.0, 0.0]
    rates[axis] = 0.2 * (trim.roll_rps if axis == 0 else trim.pitch_rps)
    turning.rates_rps = (rates[0], rates[1], rates[2])
    assert turning.forces(air)[1][axis] == pytest.approx(still, abs=1e-6)


@pytest.mark.parametrize(("output", "axis", "sign"), [(0, 0, 1), (1, 1, 1), (3, 2, 1)])
def test_a_longer_pulse_rolls_right_pitches_up_and_yaws_right(output: int, axis: int, sign: int) -> None:
    moments = []
    for pulse_us in (1500, 1700):
        flying = aloft(velocity_mps=(20.0, 0.0, 0.0))
        outputs = [1500, 1500, 1500, 1500]
        outputs[output] = pulse_us
        for _ in range(40):
            flying.act(outputs)
        moments.append(flying.forces((20.0, 0.0, 0.0))[1][axis])
    assert (moments[1] - moments[0]) * sign > 0.1


def test_servos_take_their_time() -> None:
    flying = aloft(velocity_mps=(20.0, 0.0, 0.0))
    steps = 0
    level = flying.forces((20.0, 0.0, 0.0))[1][0]
    reached = list[float]()
    while len(reached) < 2 or reached[-1] > reached[-2]:
        flying.act([2000, 1500, 1000, 1500])
        reached.append(flying.forces((20.0, 0.0, 0.0))[1][0])
        steps += 1
    assert reached[0] > level
    assert steps * STEP_S == pytest.approx(45.0 / 60.0 * 0.14, abs=2 * STEP_S)


def test_takes_off_rolling_straight_and_lands_without_bouncing() -> None:
    """Full throttle with some elevator; then without, until it has touched and rolls out."""
    flying = body(heading_rad=0.5)
    for _ in range(1200):
        flying.step([1500, 1530, 2000, 1500])
    flying.settle()
    assert flying.airborne
    assert flying.state.airspeed_mps > 15.0
    assert math.atan2(flying.state.east_m, flying.state.north_m) == pytest.approx(0.5, abs=0.02)
    assert flying.state.heading_rad == pytest.approx(0.5, abs=0.02)
    touched = 0
    for _ in range(40_000):
        flying.step([1500, 1500, 1000, 1500])
        touched += flying.on_ground
    flying.settle()
    assert touched > 10_000
    assert flying.on_ground
    assert math.hypot(*flying.velocity_mps) < 0.5
    assert (bank_of(flying.attitude), pitch_of(flying.attitude)) == pytest.approx((0.0, 0.0), abs=1e-3)


def test_wind_carries_it_along() -> None:
    calm, windy = (aloft(velocity_mps=(20.0, east_mps, 0.0)) for east_mps in (0.0, 5.0))
    windy.air_east_mps = 5.0
    for each in (calm, windy):
        for _ in range(400):
            each.step([1500, 1500, 1600, 1500])
        each.settle()
    assert windy.state.east_m - calm.state.east_m == pytest.approx(5.0, abs=1e-3)
    assert windy.state.airspeed_mps == pytest.approx(calm.state.airspeed_mps, abs=1e-6)


def test_the_wind_is_weaker_near_the_ground() -> None:
    """By the power law of open country, with 1/7: half of it at a hundredth of the height of its speed."""
    assert wind_share(10.0) == wind_share(100.0) == 1.0
    assert wind_share(1.0) == pytest.approx(0.1 ** (1 / 7))
    assert wind_share(0.0) == wind_share(0.1) == pytest.approx(0.518, abs=1e-3)


def test_sensors_are_shaken_by_the_motor_alike_with_one_seed() -> None:
    runs = []
    for _ in range(2):
        flying = aloft(velocity_mps=(20.0, 0.0, 0.0))
        runs.append([flying.step([1500, 1500, 2000, 1500]).accel_mps2 for _ in range(3000)])
    assert runs[0] == runs[1]
    ahead = [each[1] for each in runs[0]]
    assert math.sqrt(sum(part * part for part in ahead) / len(ahead)) == pytest.approx(0.3, rel=0.1)
