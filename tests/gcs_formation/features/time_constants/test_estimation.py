"""Lags estimated from simulated vehicles with known lags."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints, advance
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.time_constants.estimator import TimeConstantEstimator
from gcs_formation.stability.mismatch import TAUS_OFF_COUNTED
from tests.gcs_formation import tables
from tests.gcs_formation.features.time_constants.time_constants_on_arrays import LagsOnArrays

TICK_S, DELAY_S = 0.1, 0.35
TAUS = ("tau_v_s", "tau_psi_s", "tau_ha_s", "tau_hb_s")
BELIEVED = VehicleModel()
CRUISE_TOLD = 22.0, 0.0, 100.0
CRUISE = Setpoints(*np.array([[22.0], [0.0], [100.0]]))


def models(ratios):
    """Return a column for each row of four ratios to the default lags."""
    lags = np.array([getattr(BELIEVED, lag) for lag in TAUS]) * np.array(ratios)
    limits = [getattr(BELIEVED, key) for key in ("speed_min_mps", "speed_max_mps")]
    limits += [BELIEVED.accel_max_mps2, BELIEVED.turn_rate_max_rps, BELIEVED.climb_max_mps]
    return AutopilotModels.of(np.concatenate((lags, np.tile(limits, (len(lags), 1))), axis=1).T.copy())


def wander(time_s):
    """Return setpoints whose changes stay within the rate limits."""
    return (
        22 + 1.5 * np.sign(np.sin(0.35 * time_s)),
        0.15 * np.sign(np.sin(0.8 * time_s)),
        100 + 4 * np.sin(0.25 * time_s),
    )


class Watched:
    """An estimator that gets `hz` samples per second, and the largest mismatch that it has found."""

    def __init__(self, hz, models, history, telemetry_hz, law_hz, *, in_use):
        self.of = TimeConstantEstimator(models, history, hz, law_hz, in_use=in_use)
        self.most, self._apart = np.zeros((3, len(models))), round(telemetry_hz / hz)

    def add_sample(self, column, stamp, motion):
        if round(stamp * 1e-9 / TICK_S) % self._apart == 0:
            self.of.add_sample(column, stamp, motion)

    def update(self, learning):
        self.of.update(learning)
        self.most = np.maximum(self.most, self.of.mismatch)


def flown(
    ratios,
    seconds=30,
    tell=wander,
    *,
    learning=True,
    noise=(0, 0, 0),
    seed=1,
    true=None,
    in_use=True,
    silent_s=(0, 0),
    lifted_m=None,
    kind: Any = TimeConstantEstimator,
):
    """Return the estimator of a `kind` after a flight of vehicles whose lags are `ratios` times the assumed ones.

    `lifted_m`: by how much the air lifts them, tick by tick.
    """
    true, count = true or models(ratios), len(ratios)
    history = SetpointHistory(1 / TICK_S)
    assumed = tables.models(models(np.ones((count, 4))))
    lags = kind(assumed, history, 1 / TICK_S, 1 / TICK_S, in_use=in_use)
    rows = np.array([0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0])
    state, random = FlightStates(*np.repeat(rows[:, None], count, axis=1)), np.random.default_rng(seed)
    tick_ns, acting = round(TICK_S * 1e9), []
    for tick in range(round(seconds / TICK_S)):
        commands = np.repeat(np.array(tell(tick * TICK_S), dtype=float)[:, None], count, axis=1)
        acting.append(commands)
        acts = np.full(count, tick * tick_ns + round(DELAY_S * 1e9))
        table = state.table
        for column in range(count) if not silent_s[0] < tick * TICK_S < silent_s[1] else ():
            errors = random.normal(size=3) * noise
            if lifted_m is not None:
                errors[2] += lifted_m[tick]
            motion = table[4:6, column] + errors[:2], table[2, column] + errors[2], table[3, column]
            lags.add_sample(column, tick * tick_ns, (*motion[0].tolist(), float(motion[1]), float(motion[2])))
        lags.update([learning] * count)
        tables.send(history, acts, Setpoints.of(commands))
        # A setpoint acts 3.5 ticks after it was sent.
        for late in (4, 3):
            state = advance(state, acting[max(0, tick - late)], np.full(count, TICK_S / 2), true)
    return lags


def ratios_of(lags):
    """Return the ratios of the estimated lags to the assumed ones, (4, C)."""
    return np.exp([each.log_ratios() for each in lags.vehicles]).T


CORNERS = ((1.3, 0.7, 1.3, 0.7), (0.7, 1.3, 0.7, 1.3), (1.3, 1.3, 1.3, 1.3), (0.7, 0.7, 0.7, 0.7))


def test_time_constants_30_percent_off_are_found_each_vehicle_its_own():
    found = ratios_of(flown(CORNERS))
    assert found[:2] == pytest.approx(np.array(CORNERS).T[:2], rel=0.02)
    true_m, found_m = (np.array((1.0, 3.0)) @ ratios for ratios in (np.array(CORNERS).T[2:], found[2:]))
    assert found_m == pytest.approx(true_m, rel=0.05)  # their sum; how it is split shows less


@pytest.mark.slow
def test_time_constants_are_found_from_0_55_to_1_8_times_the_declared_ones():
    """Interpolation between few simulations costs 0.3 % in airspeed, heading, and the sum of the height's lags."""
    corners = tuple((air, air, slow, fast) for air in (0.55, 1.8) for slow in (0.55, 1.0, 1.8) for fast in (0.55, 1.8))
    found, true = ratios_of(flown(corners, 60)), np.array(corners).T
    assert found[:2] == pytest.approx(true[:2], rel=0.005)
    own_s = np.array([getattr(BELIEVED, lag) for lag in TAUS[2:]])
    assert own_s @ found[2:] == pytest.approx(own_s @ true[2:], rel=0.01)


def test_the_model_in_use_has_the_time_constants_that_were_found():
    lags = flown(CORNERS[:1])
    assert lags.vehicles[0].model.tau_v_s == pytest.approx(4.0 * 1.3, rel=0.02)
    assert lags.vehicles[0].model.tau_psi_s == pytest.approx(1.5 * 0.7, rel=0.02)


def test_white_noise_in_the_telemetry_does_not_bias_them():
    found = np.mean([ratios_of(flown(CORNERS[2:], 60, noise=(0.2, 0.01, 0.3), seed=seed)) for seed in range(3)], axis=0)
    assert found[:2] == pytest.approx(np.array(CORNERS[2:]).T[:2], rel=0.05)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_heights_that_turbulence_moves_are_not_taken_for_other_time_constants(seed):
    """Gusts displace an aircraft by 1.5 m RMS, for 5 s: many successive samples show the same gust."""
    kept, random = np.exp(-TICK_S / 5.0), np.random.default_rng(seed)
    lifted_m = [0.0]
    for _ in range(round(120 / TICK_S)):
        lifted_m.append(kept * lifted_m[-1] + 1.5 * np.sqrt(1 - kept**2) * random.normal())
    lags = flown(np.ones((1, 4)), 120, lifted_m=lifted_m)
    assert ratios_of(lags)[2:] == pytest.approx(1.0, abs=0.25)
    assert lags.mismatch[2][0] < 0.1


def test_a_gust_that_the_law_answers_is_not_taken_for_other_time_constants():
    """It sinks by 6 m and is commanded to climb as much. The mismatch was 1 while the calm flight around it counted."""

    def share(time_s, tau_s):
        rise, fall = 1.0 - np.exp(-(time_s - 40.0) / tau_s), np.exp(-(time_s - 55.0) / tau_s)
        return 0.0 if time_s < 40.0 else rise if time_s < 55.0 else fall

    lifted_m = [-6.0 * share(tick * TICK_S, 4.0) for tick in range(round(80 / TICK_S))]
    kind = partial(Watched, 1 / TICK_S)
    gone = flown(
        np.ones((1, 4)), 80, lambda at_s: (22.0, 0.0, 100.0 + 6.0 * share(at_s, 6.0)), lifted_m=lifted_m, kind=kind
    )
    assert (gone.most < TAUS_OFF_COUNTED).all()


def test_beyond_half_and_twice_the_declared_time_constants_nothing_is_taken_and_the_mismatch_tells():
    lags = flown(((3.0, 3.0, 1.0, 1.0), (0.3, 0.3, 1.0, 1.0)))
    assert ratios_of(lags)[:2] == pytest.approx(np.array(((2.0, 0.5), (2.0, 0.5))))
    assert (np.array(lags.mismatch)[:2] > 0.1).all()
    assert (np.array(flown(CORNERS).mismatch) < 0.02).all()


def test_a_model_that_is_to_stay_stays_and_its_mismatch_tells():
    lags = flown(CORNERS, in_use=False)
    assert {each.model.values() for each in lags.vehicles} == {lags.vehicles[0].model.values()}
    assert np.array(lags.mismatch)[:2] == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize("hz", [1, 2, 10 / 3])
def test_noise_is_not_taken_for_other_time_constants_however_few_samples_there_are(hz):
    """A mean and a share fit two samples exactly; the residuals then say nothing about chance.

    Of twenty vehicles that begin off their slots, up to a hundred times as far off as the lags are.
    """

    def tell(time_s):
        return 22 + 3 * np.exp(-time_s / 3), 0.2 * np.exp(-time_s / 3), 100 + 8 * np.exp(-time_s / 4)

    lags = flown(np.ones((20, 4)), 15, tell, noise=(0.2, 0.01, 0.3), kind=partial(Watched, hz))
    assert (lags.most < TAUS_OFF_COUNTED).all()
    assert min(flown(CORNERS, 25, in_use=False, kind=partial(Watched, hz)).of.mismatch[0]) > 0.15


def test_no_more_is_said_of_a_mismatch_than_that_time_constants_are_farther_off_than_simulated():
    assert flown(((1, 6, 1, 1),), 40, in_use=False).mismatch[1] == [1.0]


def test_bends_finer_than_the_assumed_resolution_teach_after_quiet_flight():
    """Of 0.001 rad, and changes of speed of 0.02 m/s; in noisier telemetry they teach nothing, and nothing wrong."""

    def tell(time_s):
        speed_mps, heading_rad, _ = wander(time_s) if time_s > 40 else CRUISE_TOLD
        return 22.0 + 0.013 * (speed_mps - 22.0), 0.007 * heading_rad, 100.0

    found = ratios_of(flown(CORNERS, 100, tell))
    assert found[:2] == pytest.approx(np.array(CORNERS).T[:2], rel=0.05)
    assert ratios_of(flown(CORNERS, 100, tell, noise=(0.2, 0.01, 0.3))) == pytest.approx(1.0, abs=0.1)


def test_straight_flight_estimates_nothing():
    lags = flown(((1.3, 1.3, 1.3, 1.3),), tell=lambda _: (22.0, 0.0, 100.0), noise=(0.02, 0.001, 0.03))
    assert ratios_of(lags) == pytest.approx(1.0, abs=0.05)


def test_what_was_estimated_stays_in_straight_flight():
    def tell(time_s):
        return wander(time_s) if time_s < 60 else (22.0, 0.0, 100.0)

    assert ratios_of(flown(CORNERS[:2], 120, tell))[:2] == pytest.approx(np.array(CORNERS[:2]).T[:2], rel=0.02)


def test_a_vehicle_that_does_not_fly_as_reported_estimates_nothing():
    assert (ratios_of(flown(CORNERS, learning=False)) == 1.0).all()


def test_flight_at_a_rate_limit_estimates_nothing():
    """A turn at a limit that is lower than assumed looks like a long lag, but the rest of the turn shows the lag."""
    right = np.ones((1, 4))
    slow = models(right)
    slow.turn_rate_max_rps[:] = 0.17
    lags = flown(right, tell=lambda time_s: (22.0, 0.6 * np.sign(np.sin(0.5 * time_s)), 100.0), true=slow)
    assert ratios_of(lags)[1] == pytest.approx(1.0, abs=0.05)


def test_nothing_is_estimated_from_the_change_over_a_gap_in_the_telemetry():
    """Somebody else flies it meanwhile: 4 s later it is 6 m/s slower."""

    def tell(time_s):
        return (22.0 if time_s < 9.0 else 16.5, 0.0, 100.0)

    right = np.ones((1, 4))
    slow = models(right * (2.5, 1, 1, 1))
    assert ratios_of(flown(right, 14, tell, true=slow, silent_s=(8.0, 13.5))) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("in_use", [True, False])
@pytest.mark.parametrize("noise", [pytest.param((0, 0, 0), marks=pytest.mark.slow), (0.2, 0.01, 0.3)])
def test_the_same_is_found_as_on_arrays(noise, in_use):
    def tell(time_s):
        """Return setpoints that sometimes reach the rate limits, with straight flight between them."""
        north, heading, height = wander(time_s)
        return (22.0, 1.5 * heading, 100.0) if time_s % 20 > 15 else (north, 4 * heading * (time_s > 12), height)

    lags, same = (
        flown(CORNERS, 40, tell, noise=noise, in_use=in_use, silent_s=(24.0, 29.0), kind=kind)
        for kind in (TimeConstantEstimator, LagsOnArrays)
    )
    assert ratios_of(lags) == pytest.approx(same.ratios, rel=1e-9)
    mismatch = np.array(lags.mismatch)
    assert mismatch == pytest.approx(same.mismatch, rel=1e-6, abs=1e-9)
    assert [each.model.values() for each in lags.vehicles] == [pytest.approx(each.values()) for each in same.models]
