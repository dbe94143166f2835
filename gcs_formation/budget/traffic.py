"""What goes over one vehicle's link: bytes a second by message, up and down."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from airlink import mavlink as m
from airlink.endpoint import VehicleId
from airlink.messages import KINDS
from airlink.radio.profiles import PROFILES
from airlink.radio.settings import RadioSettings
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario import Scenario
from formation_scenario.channels import Channel
from gcs_formation.budget.levels import LEVELS, MIN_HZ, Level
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.command_delivery import REPEAT_S

FRAME_BYTES: Final = 12
"""Size of a MAVLink 2 frame without its payload."""
NEWS_HZ: Final = 2.5
"""Setpoints of each quantity in turns and climbs: of the quickstart's, 1.6 a second on average and 2.3 in its turns."""
STREAM_HZ: Final = 10.0
"""Setpoints of a family that takes them as a stream, in turns and climbs."""
STEADY_PROBE_S: Final = 0.5
"""Period of TIMESYNC requests over a link whose round trips are all alike."""
IN_FLIGHT_HZ: Final = 0.1
"""Rate of messages that are read before take-off only."""
ATTITUDE: Final = m.MAVLINK_MSG_ID_ATTITUDE
ATTITUDE_HZ: Final = 5.0
"""Attitudes have a turn rate, and positions a heading: half as many attitudes as positions are enough, but no fewer
than this, if positions come faster."""
BITS: Final = 8.0
BYTES_PER_KBIT: Final = 125.0
USABLE: Final = 0.8
"""Share of a radio's rate that may be used: the rest goes with turning it round, answers to commands, and bursts."""
HEARTBEAT_HZ: Final = 1.0


class Flow(NamedTuple):
    """One kind of message on a vehicle's link."""

    message_id: int
    up: bool
    rate_hz: float

    @property
    def name(self) -> str:
        """Its name in MAVLink."""
        return KINDS[self.message_id].name

    @property
    def frame_bytes(self) -> int:
        """Size of its longest frame."""
        return KINDS[self.message_id].base_length + FRAME_BYTES

    @property
    def bytes_per_s(self) -> float:
        """What it takes of the link."""
        return self.rate_hz * self.frame_bytes


def flows(autopilot: Autopilot, rates_hz: Mapping[int, float], level: Level, law_hz: float) -> Iterator[Flow]:
    """Yield what goes over a vehicle's link in flight, in turns and climbs."""
    probe_hz = 1.0 / max(STEADY_PROBE_S, level.probe_s)
    at_most_hz = min(law_hz, 1.0 / level.setpoint_s if level.setpoint_s > 0.0 else law_hz)
    setpoints = autopilot.setpoint(Setpoint(20.0, 0.0, 0.0), FlightState(*[0.0] * 8))
    news_hz = NEWS_HZ if autopilot.setpoint_commands else STREAM_HZ
    for message_id in dict.fromkeys(each.kind().message_id for each in setpoints):
        count = sum(each.kind().message_id == message_id for each in setpoints)
        yield Flow(message_id, up=True, rate_hz=count * max(1.0 / REPEAT_S, min(news_hz, at_most_hz)))
    yield Flow(m.MAVLINK_MSG_ID_TIMESYNC, up=True, rate_hz=probe_hz)
    yield Flow(m.MAVLINK_MSG_ID_HEARTBEAT, up=True, rate_hz=HEARTBEAT_HZ)
    yield Flow(m.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT, up=True, rate_hz=HEARTBEAT_HZ)
    acks = min(len(setpoints), len(autopilot.setpoint_commands))
    if acks:
        acks_hz = acks * max(1.0 / REPEAT_S, min(news_hz, at_most_hz))
        yield Flow(m.MAVLINK_MSG_ID_COMMAND_ACK, up=False, rate_hz=acks_hz)
    yield Flow(m.MAVLINK_MSG_ID_TIMESYNC, up=False, rate_hz=probe_hz)
    for message_id, rate_hz in rates_hz.items():
        yield Flow(message_id, up=False, rate_hz=rate_hz)


def bytes_per_s(autopilot: Autopilot, rates_hz: Mapping[int, float], level: Level, law_hz: float = 10.0) -> float:
    """Return what all messages together take of a vehicle's link."""
    return sum(each.bytes_per_s for each in flows(autopilot, rates_hz, level, law_hz))


def flight_hz(autopilot: Autopilot, level: Level, all_hz: Mapping[int, float]) -> dict[int, float]:
    """Return the rates of a vehicle's messages in flight: what is read before take-off only comes rarely.

    `all_hz`: those that its start-up asks for over a link with room.
    """
    rates_hz = thinned(autopilot, level, all_hz)
    for each in autopilot.start_up_messages:
        rates_hz[each] = IN_FLIGHT_HZ
    if ATTITUDE in rates_hz:
        rates_hz[ATTITUDE] = max(rates_hz[ATTITUDE] / 2.0, min(rates_hz[ATTITUDE], ATTITUDE_HZ))
    return rates_hz


def thinned(autopilot: Autopilot, level: Level, rates_hz: Mapping[int, float]) -> dict[int, float]:
    """Return rates with a level's share of those of motion."""
    fast, share = autopilot.fast_messages, level.telemetry_share
    return {
        each: max(share * rate_hz, min(rate_hz, MIN_HZ)) if each in fast else rate_hz
        for each, rate_hz in rates_hz.items()
    }


class Rates(NamedTuple):
    """What a radio carries, bytes a second."""

    up: float
    down: float
    half_duplex: bool

    def used(self, each: Iterable[Flow]) -> float:
        """Return the share of the radio's time that flows take; in full duplex that of the busier direction."""
        flows_up_and_down = list(each)
        up = sum(flow.bytes_per_s for flow in flows_up_and_down if flow.up) / self.up
        down = sum(flow.bytes_per_s for flow in flows_up_and_down if not flow.up) / self.down
        return up + down if self.half_duplex else max(up, down)


def rates_of(channel: Channel) -> Rates | None:
    """Return what a scenario says that a channel carries, by its keys or else its profile; None if it doesn't say."""
    profile = None if channel.profile is None else PROFILES[channel.profile]
    if profile is None and channel.rate_kbps is None:
        return None
    given = None if channel.rate_kbps is None else BYTES_PER_KBIT * channel.rate_kbps
    up, down, half = (0.0, 0.0, True) if profile is None else _carried(profile)
    up, down = (up, down) if given is None else (given, given)
    if channel.uplink_rate_kbps is not None:
        up = BYTES_PER_KBIT * channel.uplink_rate_kbps
    return Rates(up, down, half if channel.duplex is None else channel.duplex == "half")


def _carried(profile: RadioSettings) -> Rates:
    return Rates(profile.uplink_bps / BITS, profile.downlink_bps / BITS, profile.half_duplex)


def fitting_level(rates: Rates, at_each: Iterable[Iterable[Flow]]) -> int:
    """Return the first of `LEVELS` whose flows, `at_each`, fit; the last if none do."""
    fits = (level for level, needed in enumerate(at_each) if rates.used(needed) <= USABLE)
    return next(fits, len(LEVELS) - 1)


class Stated(NamedTuple):
    """What a scenario says that one vehicle's part of a radio carries."""

    level: int
    """The first of `LEVELS` that fits."""
    bytes_per_s: float


UNSTATED: Final = Stated(0, 0.0)


def stated_by(scenario: Scenario, autopilots: Mapping[VehicleId, Autopilot]) -> dict[VehicleId, Stated]:
    """Return what the scenario states of each vehicle that is reached by a radio with a rate."""
    found = dict[VehicleId, Stated]()
    for index, vehicles in scenario.channel_members():
        rates = rates_of(scenario.links.channels[index])
        if rates is None or not vehicles:
            continue
        ours = [autopilots[each.vehicle_id] for each in vehicles]
        level = fitting_level(rates, [flows_of(scenario, ours, each) for each in LEVELS])
        share = Stated(level, rates.down / len(vehicles))
        found |= {each.vehicle_id: share for each in vehicles}
    return found


def flows_of(scenario: Scenario, autopilots: Iterable[Autopilot], level: Level) -> Iterator[Flow]:
    """Yield what goes over the links of some vehicles in flight, at a scenario's rates."""
    telemetry = scenario.telemetry
    for each in autopilots:
        all_hz = each.rates_hz(telemetry.rate_hz, utc=telemetry.by_utc)
        yield from flows(each, flight_hz(each, level, all_hz), level, scenario.law.rate_hz)
