"""What a law gets: how its leader moves, the setpoint that a vehicle follows, gains, and inputs that aren't finite."""

from __future__ import annotations

import math

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.control.fuzzy_pid import GainRange, PidGains
from gcs_formation.control.law_interface import CycleInput, Lead
from gcs_formation.control.laws import leader_motion
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_commands import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading

MODEL = AutopilotModel(4.0, 1.2, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)


@pytest.mark.parametrize(("dt_s", "bend_rps2"), [(0.2, 0.1), (0.7, 0.2), (0.8, 0.25), (1.0, 0.2)])
def test_a_leaders_motion_follows_from_its_commands_by_its_time_constants(dt_s: float, bend_rps2: float) -> None:
    """Heading: 0.12 rad / 1.2 s. Its bend: 0.1 rad/s in the rest of 1.2 s after a tick, or half a tick at least."""
    state = FlightState(0.0, 0.0, 100.0, 1.0, 20.0, 3.1, 0.0, 0.0, 0.5)
    motion = leader_motion(LeaderCommand(24.0, 3.22 - math.tau, 104.0, 0.2), state, MODEL, dt_s)
    assert motion.turn_rps == pytest.approx(0.1)
    assert motion.bend_rps2 == pytest.approx(bend_rps2)
    assert motion.begun_rps == pytest.approx(0.1 - dt_s / 2.0 * bend_rps2)
    assert motion.acceleration_mps2 == pytest.approx(1.0)
    assert motion.climb_change_mps2 == pytest.approx((4.0 - 4.0 * 0.5) / 3.0), "4 m to climb, 2 m of it by its climb"


def test_a_leaders_motion_keeps_its_limits() -> None:
    state = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, 0.0, 0.0)
    motion = leader_motion(LeaderCommand(10.0, -2.0, 100.0, -9.0), state, MODEL, 0.2)
    assert (motion.turn_rps, motion.bend_rps2) == pytest.approx((-0.25, 0.0))
    assert motion.acceleration_mps2 == -1.5


def test_a_vehicle_follows_the_setpoint_before_the_one_that_acts_from_its_own_instant_on() -> None:
    history = SetpointHistory(10.0)
    for acts, speed_mps in ((1000, 20.0), (2000, 25.0)):
        history.begin_tick(vec[i64]([acts]))
        history.record([(speed_mps, 0.0, 100.0)])
    state = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, 0.0, 0.0)
    lead = Lead(0, Instant(0), [], RouteHeading(0.0, 0.0, 0.0, 0.0, 20.0))
    for stamp, followed_mps in ((1500, 20.0), (2000, 20.0), (2001, 25.0)):
        states = MeasuredStates([state], vec[i64]([stamp]), [True], vec[i64]([Instant(9000)]))
        assert CycleInput(states, lead, [], history, [0.0], [True], [], []).commanded(0)[0] == followed_mps


def test_a_fuzzy_gain_is_0_7_to_1_3_of_the_nominal_one_each_by_its_own_output() -> None:
    gains = GainRange().gains(PidGains(2.0, 3.0, 4.0, 0.3), (0.0, 0.5, 1.0))
    assert (gains.kp, gains.ki, gains.kd, gains.filter_s) == pytest.approx((1.4, 3.0, 5.2, 0.3))
    gains = GainRange(1.0, 2.0).gains(PidGains(2.0, 3.0, 4.0, 0.3), (1.0, 0.0, 0.5))
    assert (gains.kp, gains.ki, gains.kd) == pytest.approx((6.0, 3.0, 8.0))


@pytest.mark.parametrize("ki", [3.0, 0.0])
def test_the_transfer_function_is_that_of_the_gains(ki: float) -> None:
    """At s = 2: kp + ki/s + kd s/(T s + 1)."""
    numerator, denominator = PidGains(2.0, ki, 4.0, 0.3).transfer()
    found = sum(each * 2.0**power for power, each in enumerate(reversed(numerator.tolist())))
    found /= sum(each * 2.0**power for power, each in enumerate(reversed(denominator.tolist())))
    assert found == pytest.approx(2.0 + ki / 2.0 + 4.0 * 2.0 / 1.6)
    assert len(denominator) == (3 if ki else 2), "without integral gain there is no integrator"
