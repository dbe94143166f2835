"""Keys of radios that vehicles share."""

import pytest

from airlink.radio.profiles import PROFILES
from gcs_formation.app.shared_radios import radios_of, settings_of


@pytest.mark.parametrize(
    ("channels", "expected"),
    [
        ("[{duplex: half}]", "links.channels.0: found a channel without a data rate; rate_kbps or profile"),
        ("[{rate_kbps: 0}]", "links.channels.0.rate_kbps: found 0; a number >= 0.001"),
        ("[{rate_kbps: 9, buffer_bytes: 100}]", "links.channels.0.buffer_bytes: found 100; a whole number from 300"),
        ("[{rate_kbps: 9, vehicles: [9]}]", "links.channels.0.vehicles.0: found 9; 1, 2, 3, 4"),
        (
            "[{rate_kbps: 9, vehicles: [1, 2]}, {rate_kbps: 9, vehicles: [2, 3]}]",
            "links.channels.1.vehicles: found vehicles that another channel has too: 2; each vehicle in one channel",
        ),
        ("[{rate_kbps: 9, loss: 0.8, mean_burst: 2}]", "links.channels.0.mean_burst: found 2 with a loss of 0.8; 4"),
        ("[{rate_kbps: 9, duplex: simplex}]", "links.channels.0.duplex: found 'simplex'"),
        ("[{profile: sik_951}]", "links.channels.0.profile: found 'sik_951'; sik_433, sik_915, "),
    ],
)
def test_channels_that_cannot_be_are_refused(refusal, channels, expected):
    (line,) = refusal(f"links.channels={channels}")
    assert expected in line


def test_a_channel_is_one_radio_for_all_for_some_or_one_for_each(load):
    def radios(channels):
        return radios_of(load(f"links.channels={channels}"))

    assert len({id(radio) for radio in radios("[{rate_kbps: 9}]").values()}) == 1
    assert len({id(radio) for radio in radios("[{rate_kbps: 9, vehicles: each}]").values()}) == 4
    assert sorted(identity.system for identity in radios("[{rate_kbps: 9, vehicles: [2, 3]}]")) == [2, 3]
    assert radios("[]") == {}


def test_keys_that_are_left_out_are_a_sik_radios_without_delay_or_loss(load):
    (channel,) = load("links.channels=[{rate_kbps: 57.6}]").links.channels
    settings = settings_of(channel)
    assert (settings.uplink_bps, settings.downlink_bps, settings.half_duplex) == (57_600.0, 57_600.0, True)
    assert (settings.buffer_bytes, settings.window_s, settings.turnaround_s) == (1850, 0.131, 0.0)
    assert settings.air.transparent
    assert settings.reports


def test_every_profile_is_a_radio_whose_figures_other_keys_change(load):
    for name, radio in PROFILES.items():
        (channel,) = load(f"links.channels=[{{profile: {name}}}]").links.channels
        assert settings_of(channel) == radio
        (channel,) = load(f"links.channels=[{{profile: {name}, rate_kbps: 30, loss: 0.2}}]").links.channels
        changed = settings_of(channel)
        assert (changed.uplink_bps, changed.downlink_bps, changed.air.loss) == (30e3, 30e3, 0.2)
        assert (changed.air.delay_s, changed.buffer_bytes) == (radio.air.delay_s, radio.buffer_bytes)


def test_every_key_of_a_channel_reaches_its_radio(load):
    keys = (
        "rate_kbps: 100, uplink_rate_kbps: 20, duplex: full, turnaround_ms: 3, buffer_bytes: 999, window_ms: 40, "
        "arbitration: first_come, delay_ms: 10, jitter_ms: 2, distribution: uniform, loss: 0.1, mean_burst: 4, "
        "radio_status: false"
    )
    (channel,) = load(f"links.channels=[{{{keys}}}]").links.channels
    settings, air = settings_of(channel), settings_of(channel).air
    assert (settings.uplink_bps, settings.downlink_bps, settings.half_duplex) == (20e3, 100e3, False)
    assert (settings.turnaround_s, settings.buffer_bytes, settings.window_s) == (0.003, 999, 0.04)
    assert (settings.arbitration, settings.reports) == ("first_come", False)
    assert (air.delay_s, air.jitter_s, air.distribution, air.loss, air.mean_burst) == (0.01, 0.002, "uniform", 0.1, 4.0)


def test_a_vehicles_whole_link_has_its_channels_air_and_its_own_link_has_not(load):
    scenario = load(
        "links.channels=[{rate_kbps: 9, vehicles: [2], delay_ms: 100, jitter_ms: 30, loss: 0.5, mean_burst: 2}]",
        "links.default={delay_ms: 10, jitter_ms: 40, loss: 0.2}",
    )
    one, two, *_ = scenario.vehicles
    assert scenario.link_steps(one) == scenario.own_link_steps(one)
    (step,), (own,) = scenario.link_steps(two), scenario.own_link_steps(two)
    assert own.uplink.delay_ms == 10.0
    for direction in (step.uplink, step.downlink):
        assert (direction.delay_ms, direction.jitter_ms, direction.mean_burst) == (110.0, 50.0, 2.0)
        assert direction.loss == pytest.approx(0.6)
