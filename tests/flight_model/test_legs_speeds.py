"""Speeds by leg: where they change, how fast, and what becomes of a leg that is too short."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.legs.speeds import SpeedChanges, speed_profile

LIMITS = SpeedChanges(accel_mps2=0.5, wind_mps=0.0, min_s=8.0)
STRAIGHTS = [(0, 0.0, 1000.0), (1, 1200.0, 2200.0), (2, 2400.0, 3400.0)]


def test_each_leg_is_flown_at_its_speed_and_turns_at_that_of_the_leg_before() -> None:
    profile, short = speed_profile(STRAIGHTS, [22.0, 18.0, 25.0], LIMITS)
    assert short == {}
    for distance_m, speed_mps in ((0.0, 22.0), (1200.0, 22.0), (2200.0, 18.0), (2400.0, 18.0), (3400.0, 25.0)):
        assert profile.at(distance_m)[0] == pytest.approx(speed_mps)


def test_the_acceleration_stays_inside_its_limit_and_neither_it_nor_the_speed_jumps() -> None:
    profile, _ = speed_profile(STRAIGHTS, [22.0, 18.0, 25.0], LIMITS)
    at_m = np.linspace(0.0, 3400.0, 34_001)
    speed_mps, slope_1ps = np.array([profile.at(each) for each in at_m.tolist()]).T
    accel_mps2 = speed_mps * slope_1ps
    assert 0.8 * 0.5 < np.abs(accel_mps2).max() <= 0.5 + 1e-9
    assert np.abs(np.diff(speed_mps)).max() < 0.005
    assert np.abs(np.diff(accel_mps2)).max() < 0.005
    assert slope_1ps == pytest.approx(np.gradient(speed_mps, at_m), abs=1e-4)
    assert profile.at_each(at_m) == pytest.approx(speed_mps)


def test_a_leg_too_short_for_its_speed_is_left_at_what_it_has_room_for() -> None:
    straights = [(0, 0.0, 1000.0), (1, 1200.0, 1450.0), (2, 2400.0, 3400.0)]
    profile, short = speed_profile(straights, [18.0, 25.0, 18.0], LIMITS)
    assert list(short) == [1]
    assert 18.0 < short[1] < 25.0
    assert profile.at(1450.0) == pytest.approx((short[1], 0.0), abs=1e-3)
    assert profile.at(3400.0)[0] == pytest.approx(18.0)


def test_distances_by_time_are_those_of_the_speeds_along_the_path() -> None:
    profile, _ = speed_profile(STRAIGHTS, [22.0, 18.0, 25.0], LIMITS)
    at_m = np.linspace(0.0, 3400.0, 34_001)
    slowness = 1.0 / profile.at_each(at_m)
    took_s = float(((slowness[1:] + slowness[:-1]) / 2.0 * np.diff(at_m)).sum())
    assert profile.later_m(0.0, took_s) == pytest.approx(3400.0, abs=0.5)


def test_positions_are_distinguished_by_their_speed_and_those_of_a_change_belong_to_both() -> None:
    profile, _ = speed_profile(STRAIGHTS, [22.0, 18.0, 22.0], LIMITS)
    at_m = np.array([100.0, 1210.0, 2100.0, 3300.0])
    assert profile.near(at_m, 22.0).tolist() == [True, True, False, True]
    assert profile.near(at_m, 18.0).tolist() == [False, True, True, False]
