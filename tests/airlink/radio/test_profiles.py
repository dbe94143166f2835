"""Radios by name, against the figures that they are taken from."""

from __future__ import annotations

import numpy as np
import pytest

from airlink.cli.radio_option import parse_radio
from airlink.endpoint import ImpairmentError
from airlink.impairment import UNIMPAIRED, Impairment
from airlink.radio.profiles import PROFILES
from airlink.radio.settings import RadioSettings


def test_a_sik_radio_has_its_firmwares_timing() -> None:
    """64 kbit/s: 144 us a byte, 2.08 ms an empty packet, 246 bytes in a packet; with Golay's code 288 us, 114 bytes."""
    plain, ecc = PROFILES["sik_915"], PROFILES["sik_433_ecc"]
    assert plain.downlink_bps == pytest.approx(8 * 246 / (2.08e-3 + 246 * 144e-6))
    assert (plain.turnaround_s, plain.window_s) == (pytest.approx(4.16e-3), pytest.approx(0.1125, abs=1e-4))
    assert ecc.downlink_bps == pytest.approx(8 * 114 / (3.232e-3 + 114 * 288e-6))
    assert ecc.downlink_bps < 0.5 * plain.downlink_bps
    assert plain.half_duplex
    assert plain.window_s < 0.131


@pytest.mark.parametrize(("name", "share", "round_trip_s"), [("lte", 0.80, 0.150), ("satellite_leo", 0.95, 0.050)])
def test_round_trips_of_networks_are_as_often_short_as_measured(name: str, share: float, round_trip_s: float) -> None:
    """Measured on UAVs: 80 % of cellular round trips below 150 ms, 95 % of Starlink's below 50 ms."""
    air, random = PROFILES[name].air, np.random.default_rng(1)
    up_s, down_s = (np.array([air.delays.quantile_s(float(each)) for each in random.random(4000)]) for _ in range(2))
    found = float(np.mean(up_s + down_s < round_trip_s))
    assert found == pytest.approx(share, abs=0.03)


def test_the_proxy_takes_a_profile_and_the_keys_of_a_scenario() -> None:
    assert parse_radio("sik_915") == PROFILES["sik_915"]
    assert parse_radio("sik_915, loss=0.2").air.loss == 0.2
    assert parse_radio("rate_kbps=57.6,duplex=half,turnaround_ms=5") == RadioSettings(
        57.6e3, 57.6e3, turnaround_s=0.005
    )
    wanted = RadioSettings(
        9e3,
        30e3,
        False,
        0.002,
        999,
        "first_come",
        0.04,
        Impairment(0.01, 0.002, "uniform", 0.1, 4.0, reorder=True),
        False,
    )
    text = "rate_kbps=30,uplink_rate_kbps=9,duplex=full,turnaround_ms=2,buffer_bytes=999,arbitration=first_come"
    more = "window_ms=40,delay_ms=10,jitter_ms=2,distribution=uniform,loss=0.1,mean_burst=4,radio_status=false"
    assert parse_radio(f"{text},{more}") == wanted
    assert parse_radio("rate_kbps=30,loss=0").air == UNIMPAIRED


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("sik", "found 'sik'; allowed: [sik_433|"),
        ("loss=0.1", "found no rate_kbps"),
        ("rate_kbps=0", "rate_kbps: found '0'; allowed: 0.001 to 1000000"),
        ("rate_kbps=9,duplex=simplex", "duplex: found 'simplex'; allowed: half, full"),
        ("rate_kbps=9,buffer_bytes=9.5", "buffer_bytes: found '9.5'; allowed: a whole number, 300 to"),
        ("rate_kbps=9,loss=nan", "loss: found 'nan'; allowed: 0 to 1"),
        ("rate_kbps=9,sik_915", "found 'sik_915'"),
    ],
)
def test_what_is_no_radio_is_refused(text: str, found: str) -> None:
    with pytest.raises(ImpairmentError) as refused:
        parse_radio(text)
    assert found in str(refused.value)
