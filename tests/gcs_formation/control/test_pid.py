"""The PID's parts: its derivative filter, its integral, its anti-windup."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from formation_scenario import load_scenario
from gcs_formation.control.follower import FollowerController
from gcs_formation.control.follower_loops import LawInput
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, ChannelConstants, FuzzyGainScheduler, Pid, PidGains
from gcs_formation.control.laws import law_parameters
from gcs_formation.control.setpoint import AS_DECIDED, LeaderMotion

DT_S = 0.1


def pid(kp: float = 1.0, ki: float = 1.0, kd: float = 1.0, filter_s: float = 0.1, windup_s: float = 1.0) -> Pid:
    return Pid(ChannelConstants(PidGains(kp, ki, kd, filter_s), 1.0, 1.0, windup_s), None)


def clip(value: float, most: float) -> float:
    return min(max(value, -most), most)


def test_the_filtered_rate_becomes_the_slope() -> None:
    controller = pid(filter_s=0.3)
    for _ in range(200):
        controller.filter_rate(2.5, DT_S)
    assert controller.rate == pytest.approx(2.5, rel=1e-9)


def test_the_filter_is_exact_for_a_constant_slope() -> None:
    """After a time t of slope m from rest, 1/(Ts+1) gives m (1 - exp(-t/T)), whatever the sampling."""
    for dt_s in (0.02, 0.1, 0.5):
        controller = pid(filter_s=0.4)
        for _ in range(round(1.0 / dt_s)):
            controller.filter_rate(3.0, dt_s)
        assert controller.rate == pytest.approx(3.0 * (1 - math.exp(-1.0 / 0.4)), rel=1e-12)


@pytest.mark.parametrize("filter_s", [0.05, 0.4, 2.0])
def test_it_answers_as_its_transfer_function_says(filter_s: float) -> None:
    """An error that grows as exp(s t) is answered by C(s) times it, C = kp + ki/s + kd s/(T s + 1), at s = 3/s."""
    s, step_s = 3.0, 0.01
    controller, error = pid(0.7, 1.9, 0.6, filter_s), 1.0
    for tick in range(400):
        error = math.exp(s * step_s * tick)
        controller.filter_rate(s * error * (1.0 - s * step_s / 2.0), step_s)
        if tick < 399:
            controller.integrate(error * (1.0 + s * step_s / 2.0), 0.0, step_s)
    response = 0.7 + 1.9 / s + 0.6 * s / (filter_s * s + 1.0)
    assert controller.output(error) / error == pytest.approx(response, rel=2e-3)


@pytest.mark.parametrize("dt_s", [1.0, 0.25])
def test_a_filter_begins_with_its_first_tick_and_with_other_constants_again(dt_s: float) -> None:
    """1 - exp(-dt / T) of the slope in a tick, with T = 0.5 s and then 2 s; nothing over no time."""
    controller = pid(filter_s=0.5)
    controller.filter_rate(8.0, 0.0)
    assert controller.rate == 0.0
    controller.filter_rate(8.0, dt_s)
    first = 8.0 * (1.0 - math.exp(-dt_s / 0.5))
    assert controller.rate == pytest.approx(first)
    controller.retune(ChannelConstants(PidGains(1.0, 1.0, 1.0, 2.0), 1.0, 1.0, 1.0))
    controller.filter_rate(8.0, dt_s)
    assert controller.rate == pytest.approx(8.0 - (8.0 - first) * math.exp(-dt_s / 2.0))
    controller.integral = 5.0
    controller.reset()
    assert (controller.rate, controller.integral) == (0.0, 0.0)
    controller.retune(ChannelConstants(PidGains(1.0, 1.0, 1.0, 2.0), 1.0, 1.0, 1.0))
    controller.filter_rate(8.0, 0.0)
    assert controller.rate == 0.0


def test_a_step_of_slope_decays_by_the_filter_alone() -> None:
    controller = pid(filter_s=0.5)
    controller.rate = 4.0
    controller.filter_rate(0.0, 0.1)
    assert controller.rate == pytest.approx(4.0 * math.exp(-0.2))


def test_each_gain_is_scheduled_by_its_own_table_and_by_error_and_rate_over_their_scales() -> None:
    """An error of 1.2 on a scale of 2 and a rate of -0.9 on one of 3: (0.6, -0.3), whose F are 0.6, 0.7, 0.44.

    Gains are nominal (0.7 + 0.6 F); half the bandwidth is half of kp and kd and a quarter of ki.
    """
    channel = ChannelConstants(PidGains(2.0, 3.0, 5.0, 0.1), 2.0, 3.0, 1.0)
    controller = Pid(channel, FuzzyGainScheduler())
    assert (controller.kp, controller.ki, controller.kd) == (2.0, 3.0, 5.0)
    controller.rate = -0.9
    controller.schedule(1.2, 1.0)
    assert (controller.kp, controller.ki, controller.kd) == pytest.approx((2.0 * 1.06, 3.0 * 1.12, 5.0 * 0.964))
    assert controller.output(1.2) == pytest.approx(2.12 * 1.2 - 4.82 * 0.9)
    controller.schedule(1.2, 0.5)
    assert (controller.kp, controller.ki, controller.kd) == pytest.approx((1.06, 0.84, 2.41))


def test_a_slower_loop_keeps_the_derivatives_corner_and_lowers_the_integrals_with_its_crossover() -> None:
    """At a quarter of the crossover kp is a quarter; kd/kp, which cancels the autopilot's lag, stays; ki/kp falls."""
    usual, slowed = PidGains(2.0, 3.0, 5.0, 0.2), PidGains(2.0, 3.0, 5.0, 0.2).slowed(0.25)
    assert slowed.kp == 0.25 * usual.kp
    assert slowed.kd / slowed.kp == usual.kd / usual.kp
    assert slowed.ki / slowed.kp == 0.25 * usual.ki / usual.kp
    assert slowed.filter_s == usual.filter_s
    assert PidGains(1.0, 1.0, 1.0).filter_s == 0.1


@pytest.mark.parametrize("outputs", [(0.0, 0.5, 1.0), (1.0, 0.0, 0.3)])
def test_fixed_gains_are_the_nominal_ones_whatever_the_tables_say(outputs: tuple[float, float, float]) -> None:
    assert FIXED_GAINS.gains(PidGains(2.0, 3.0, 5.0, 0.2), outputs) == PidGains(2.0, 3.0, 5.0, 0.2)


def test_a_change_of_gain_does_not_kick_the_integral_part() -> None:
    controller, outputs = pid(ki=5.0), list[float]()
    controller.integral = 4.0
    for share in (1.0, 0.1):
        controller.schedule(0.0, share)
        outputs.append(controller.output(0.0))
    assert outputs == [4.0, 4.0]


def test_back_calculation_holds_the_integral_at_the_limit() -> None:
    controller, error, most = pid(kd=0.0), 10.0, 1.0
    for _ in range(2000):
        output = controller.output(error)
        controller.integrate(error, clip(output, most) - output, DT_S)
    # At rest k_i e = (output - limit) / T, so output = limit + T k_i e.
    assert controller.output(error) == pytest.approx(most + 10.0)


SMALLEST_AND_LARGE = st.sampled_from((0.0, 1e-9, 1e-3, 0.1, 1.0, 10.0))


@given(kp=SMALLEST_AND_LARGE, ki=SMALLEST_AND_LARGE, kd=SMALLEST_AND_LARGE, windup_s=st.sampled_from((0.1, 1.0, 100.0)))
def test_a_limit_leaves_nothing_in_the_integral_that_the_error_did_not_put_there(
    kp: float, ki: float, kd: float, windup_s: float
) -> None:
    """For 10 s an error of 8 drives the output beyond a limit of 6, then it is gone.

    The integral then has the error's sign and is no larger than the gain can have integrated: 0 at a gain of 0. So the
    output returns to its value before the limit.
    """
    controller, accumulated = pid(kp, ki, kd, windup_s=windup_s), 0.0
    for k in range(200):
        error = 8.0 if k < 100 else 0.0
        controller.filter_rate(-80.0 if k == 100 else 0.0, DT_S)
        output = controller.output(error)
        controller.integrate(error, clip(output, 6.0) - output, DT_S)
        accumulated += ki * error * DT_S
        assert -1e-9 <= controller.integral <= accumulated + 1e-9
    controller.rate = 0.0
    assert ki > 0.0 or controller.output(0.0) == 0.0


@pytest.mark.parametrize(
    ("held", "excess", "left"), [(3.0, -9.0, 0.0), (3.0, -2.0, 1.0), (-3.0, 9.0, 0.0), (3.0, 9.0, 3.0)]
)
def test_a_limit_takes_from_the_integral_what_is_there_and_no_more(held: float, excess: float, left: float) -> None:
    controller = pid(0.0, 0.0, 0.0)
    controller.integral = held
    controller.integrate(0.0, excess, 1.0)
    assert controller.integral == pytest.approx(left)


@pytest.mark.parametrize(("error", "left"), [(8.0, -36.0), (-8.0, -44.0), (60.0, 0.0)])
def test_an_integral_that_does_not_accumulate_loses_what_the_error_takes(error: float, left: float) -> None:
    """A limit doesn't reduce it, because the vehicle is on its way to a slot, and its sign doesn't change."""
    controller = pid(ki=1.0)
    controller.integral = -44.0
    controller.integrate(error, 9.0, 1.0, grows=False)
    assert controller.integral == left


def test_an_integral_accumulates_no_more_than_there_is_to_accumulate() -> None:
    """If it and the derivative cancel, no limit is reached that would stop it."""
    controller = pid(ki=1.0)
    for _ in range(30):
        controller.integrate(-2.0, 0.0, 1.0, 12.0)
    assert controller.integral == -12.0


def descent_m(up_m: float) -> list[float]:
    """Return the height errors, for 60 s, of a follower that begins `up_m` above its slot and flies by model (7)."""
    scenario = load_scenario(
        {"vehicles": {"count": 2}, "law": {"type": "pid"}, "path": {"waypoints_m": [[0, 0, 100], [9000, 0, 100]]}}
    )
    model = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, climb_max_mps=3.0)
    controller, errors_m = FollowerController(law_parameters(scenario)), list[float]()
    leader = LeaderMotion(level_at(100.0), 0.0, 0.0, 0.0, 0.0)
    own, commanded_m, slot = level_at(100.0 + up_m), 100.0 + up_m, Slot([0.0] * 3, [0.0] * 3, [0.0] * 3)
    for _ in range(600):
        controller.decide(
            LawInput(leader, own, slot, model, (22.0, 0.0, commanded_m), 0.0, [1.0] * 3, AS_DECIDED), DT_S
        )
        commanded_m = controller.setpoint[2]
        for _ in range(10):
            own.climb_mps += DT_S / 10 * (commanded_m - own.height_m - 4.0 * own.climb_mps) / 3.0
            own.climb_mps = max(-3.0, min(3.0, own.climb_mps))
            own.height_m += DT_S / 10 * own.climb_mps
        errors_m.append(own.height_m - 100.0)
    return errors_m


def level_at(height_m: float) -> FlightState:
    return FlightState(0.0, 0.0, height_m, 0.0, 22.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("up_m", [40.0, -40.0])
def test_what_an_integrator_could_accumulate_on_a_long_climb_does_not_overshoot(up_m: float) -> None:
    """40 m at 3 m/s take 13 s; an integrator that ran during the climb used to overshoot by 1.45 m."""
    past_m = [-error_m * math.copysign(1.0, up_m) for error_m in descent_m(up_m)]
    assert 0.0 < max(past_m) < 0.5
    assert abs(past_m[-1]) < 0.01
