"""What a fault of telemetry makes of a vehicle's messages: each quantity by each effect, and nothing else."""

import math

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, GlobalPositionInt, LocalPositionNed, VfrHud
from airlink.telemetry_faults import EFFECTS, OF_HEARTBEATS, OF_STAMPS, QUANTITIES, refusal
from airlink.telemetry_faults.altering import EARTH_M, TelemetryFault

BEGAN = Instant(7 * NANOSECONDS)


def position(time_s=10.0, north_m=0.0):
    lat_rad = 0.6 + north_m / EARTH_M
    return GlobalPositionInt(time_s, lat_rad, 2.0, 130.0, 100.0, 20.0, 5.0, -1.0, 0.3)


HUD = VfrHud(22.0, 21.0, 0.3, 50, 130.0, 1.0)
TILTED = Attitude(10.0, 0.1, 0.02, 0.3, 0.0, 0.0, 0.05)
LOCAL = LocalPositionNed(10.0, 500.0, 40.0, -100.0, 20.0, 5.0, -1.0)


def altered(quantity, effect, amount, *messages, elapsed_s=0.0):
    fault = TelemetryFault(quantity, effect, amount, np.random.default_rng(1), BEGAN)
    now = Instant(BEGAN + round(elapsed_s * NANOSECONDS))
    return [fault.sent(each, now) for each in messages][-1]


def one(*given, **keys):
    ((later_s, message),) = altered(*given, **keys)
    assert later_s == 0.0
    return message


def test_a_position_is_offset_by_metres_north_east_and_down():
    moved = one("position", "offset", (30.0, 40.0, -5.0), position())
    assert (moved.lat_rad - 0.6) * EARTH_M == pytest.approx(30.0)
    assert (moved.lon_rad - 2.0) * EARTH_M * math.cos(0.6) == pytest.approx(40.0)
    assert moved.alt_m == pytest.approx(135.0)
    assert moved.relative_alt_m == pytest.approx(105.0)
    assert (moved.vx_mps, moved.time_boot_s, moved.hdg_rad) == (20.0, 10.0, 0.3)


def test_a_drift_grows_with_the_time_since_the_fault_began():
    moved = one("position", "drift", 3.0, position(), elapsed_s=4.0)
    assert (moved.lat_rad - 0.6) * EARTH_M == pytest.approx(12.0)
    assert one("height", "drift", -2.0, HUD, elapsed_s=4.0).alt_m == pytest.approx(122.0)


def test_what_is_frozen_keeps_its_first_value_while_stamps_go_on():
    held = one("position", "freeze", None, position(10.0), position(11.0, north_m=22.0))
    assert held.lat_rad == position().lat_rad
    assert held.time_boot_s == 11.0
    stopped = one("stamps", "freeze", None, position(10.0), position(11.0, north_m=22.0))
    assert stopped.time_boot_s == 10.0
    assert stopped.lat_rad == position(north_m=22.0).lat_rad


@pytest.mark.parametrize(
    ("effect", "amount", "expected"),
    [("scale", 0.5, (10.0, 2.5, -0.5)), ("sign", None, (-20.0, -5.0, 1.0)), ("zero", None, (0.0, 0.0, 0.0))],
)
def test_a_velocity_is_scaled_turned_round_or_left_empty(effect, amount, expected):
    found = one("velocity", effect, amount, position())
    assert (found.vx_mps, found.vy_mps, found.vz_mps) == pytest.approx(expected)
    assert (found.lat_rad, found.alt_m) == (0.6, 130.0)
    local = one("velocity", effect, amount, LOCAL)
    assert (local.vx_mps, local.vy_mps, local.vz_mps) == pytest.approx(expected)


def test_heights_above_sea_and_home_change_alike_in_every_message():
    found = one("height", "offset", 14.0, position())
    assert (found.alt_m, found.relative_alt_m) == (144.0, 114.0)
    assert one("height", "offset", 14.0, LOCAL).z_m == -114.0
    assert one("height", "offset", 14.0, HUD).alt_m == 144.0
    noisy = one("height", "noise", 3.0, position())
    assert noisy.alt_m - 130.0 == pytest.approx(noisy.relative_alt_m - 100.0) != 0.0


def test_noise_has_the_standard_deviation_asked_for():
    fault = TelemetryFault("airspeed", "noise", 2.0, np.random.default_rng(3), BEGAN)
    read = [fault.sent(HUD, BEGAN)[0][1].values()["airspeed_mps"] for _ in range(4000)]
    assert np.std(read) == pytest.approx(2.0, rel=0.05)
    assert np.mean(read) == pytest.approx(22.0, abs=0.15)


def test_one_attitude_angle_can_be_turned_and_all_be_not_a_number():
    assert one("attitude", "offset", 0.5, TILTED).values() == pytest.approx(TILTED.but(yaw_rad=0.8).values())
    assert math.isnan(one("attitude", "nan", None, TILTED).roll_rad)
    assert one("attitude", "offset", (0.2, 0.0, 0.0), TILTED).roll_rad == pytest.approx(0.3)


def test_messages_are_late_doubled_or_missing_as_they_are():
    assert altered("position", "late", 0.7, position()) == [(0.7, position())]
    assert altered("position", "duplicate", None, position()) == [(0.0, position()), (0.0, position())]
    assert altered("heartbeat", "missing", None, Heartbeat(1, 3)) == []
    assert altered("heartbeat", "missing", None, position()) == [(0.0, position())]


def test_a_frozen_heartbeat_says_the_first_mode():
    assert one("heartbeat", "freeze", None, Heartbeat(1, 3, 81, 15), Heartbeat(1, 3, 81, 12)).custom_mode == 15


def test_stamps_jump_in_every_message_that_has_one():
    for message in (position(), TILTED, LOCAL):
        assert one("stamps", "offset", -0.5, message) == message.but(time_boot_s=9.5)
    assert one("stamps", "offset", -0.5, HUD) == HUD


def test_each_quantity_takes_the_effects_that_it_can_have():
    for quantity in QUANTITIES:
        allowed = {"heartbeat": OF_HEARTBEATS, "stamps": OF_STAMPS}.get(quantity, EFFECTS)
        for effect in EFFECTS:
            amount = 1.0 if effect in {"offset", "drift", "noise", "scale", "late"} else None
            refused = refusal(quantity, effect, amount)
            assert (refused is None) == (effect in allowed)
            if refused is None:
                altered(quantity, effect, amount, position(), TILTED, HUD, LOCAL, Heartbeat(1, 3))


@pytest.mark.parametrize(
    ("quantity", "effect", "amount", "key"),
    [
        ("position", "offset", None, "amount"),
        ("position", "freeze", 3.0, "amount"),
        ("height", "offset", (0.0, 0.0, 3.0), "amount"),
        ("position", "late", (1.0, 1.0, 1.0), "amount"),
        ("position", "noise", -1.0, "amount"),
        ("heartbeat", "offset", 3.0, "effect"),
        ("stamps", "nan", None, "effect"),
    ],
)
def test_what_makes_no_sense_is_refused_by_key(quantity, effect, amount, key):
    refused = refusal(quantity, effect, amount)
    assert refused is not None
    assert refused[0] == key
