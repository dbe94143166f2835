"""What `check` says about links: asymmetric delays, too little telemetry, and the holding pattern after a missed start.

A round trip doesn't tell how it is split, so half of it is assumed each way. If a vehicle's uplink takes d longer than
its downlink, its clock is mapped d/2 too early, and it is kept where it should have been d/2 ago. What leader and
follower have in common cancels; the rest, (d_follower - d_leader)/2, is a distance along the path. A vehicle whose
clock is mapped by UTC has no such error.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from airlink import mavlink as m
from airlink.messages import KINDS
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario import Scenario, Vehicle
from formation_scenario.mean_delays import mean_delays_s, since
from formation_scenario.wind_triangle import drift
from gcs_formation.fleet.heartbeats import PROBE_S
from gcs_formation.from_scenario import autopilot_for, leader_guidance
from gcs_formation.guidance.join_route import JoinRoute
from gcs_formation.guidance.leader_guidance import DECISION_S, LeaderGuidance
from gcs_formation.link.utc_slack import UTC_SLACK_S

PLANES_MAX_HZ = 40.0
"""Four fifths of SCHED_LOOP_RATE; ArduPilot denies MAV_CMD_SET_MESSAGE_INTERVAL beyond that."""
MIN_M = 0.05
"""Smallest error that a warning is given for."""
FRAME_BYTES = 12
"""Size of a MAVLink 2 frame without its payload."""
GAP = 2.5
"""Periods of telemetry from one state to the next if a message is lost in between."""


def split_errors(scenario: Scenario) -> Iterator[str]:
    """Yield each follower's largest constant error along the path, from `MIN_M` on."""
    times_s = sorted({step.at_s for vehicle in scenario.vehicles for step in scenario.link_steps(vehicle)})
    leader_s = _early_s(scenario, scenario.leader, times_s)
    for vehicle in scenario.followers:
        early_s = _early_s(scenario, vehicle, times_s)
        errors_m = [scenario.path.begin_mps * (own - leads) for own, leads in zip(early_s, leader_s, strict=True)]
        error_m = max(errors_m, key=abs)
        at_s = times_s[errors_m.index(error_m)]
        if abs(error_m) >= MIN_M:
            leaders = f", the leader's {_split(scenario, scenario.leader, at_s)}," if scenario.leader else ""
            yield (
                f"vehicle {vehicle.vehicle_id}: {_split(scenario, vehicle, at_s)}{leaders} leave a "
                f"constant error of {abs(error_m):.2f} m along the path ({'behind' if error_m > 0 else 'ahead of'} its "
                f"slot{since(at_s, ',')}): round trips don't tell how a delay is split, "
                f"{_what_does(scenario, vehicle)}"
            )


def _what_does(scenario: Scenario, follower: Vehicle) -> str:
    """Return what would tell how a delay is split, or which vehicles' UTC can't be used for that."""
    if not scenario.telemetry.by_utc:
        return "telemetry.clock: gnss does"
    without = (each for each in (scenario.leader, follower) if each is not None and not _by_utc(scenario, each))
    return f"and the UTC of vehicle {', '.join(str(each.vehicle_id) for each in without)} can't be used (clock)"


def _by_utc(scenario: Scenario, vehicle: Vehicle) -> bool:
    """Return whether a vehicle's clock is mapped by its UTC. UTC that contradicts causality isn't used.

    Nothing arrives before it was sent, over the link as it is when the flight begins.
    """
    up_s, down_s = mean_delays_s(scenario, scenario.link_steps(vehicle)[0])
    known = vehicle.clock.utc and -up_s - UTC_SLACK_S <= vehicle.clock.utc_error_s <= down_s + UTC_SLACK_S
    return scenario.telemetry.by_utc and known


def narrow_links(scenario: Scenario) -> Iterator[str]:
    """Yield links whose `rate_kbps` is less than their traffic."""
    for vehicle in scenario.vehicles:
        each = scenario.link_steps(vehicle)
        if not any(step.uplink.rate_kbps or step.downlink.rate_kbps for step in each):
            continue
        for name, needed_kbps in zip(("uplink", "downlink"), traffic_kbps(scenario, vehicle), strict=True):
            rates = [(rate, step.at_s) for step in each if (rate := getattr(step, name).rate_kbps)]
            rate_kbps, at_s = min(rates, default=(math.inf, 0.0))
            if rate_kbps < needed_kbps:
                yield (
                    f"vehicle {vehicle.vehicle_id}: its {name} carries {rate_kbps:g} kbit/s{since(at_s)}, and up to "
                    f"{needed_kbps:.1f} go over it: messages wait for each other, and are lost where they wait too long"
                )


def traffic_kbps(scenario: Scenario, vehicle: Vehicle) -> tuple[float, float]:
    """Return the largest traffic up and down, kbit/s: setpoints, telemetry, and the answers to requests.

    At most a setpoint is sent and acknowledged at every tick.
    """
    autopilot, telemetry = autopilot_for(vehicle, scenario), scenario.telemetry
    rates_hz = autopilot.rates_hz(telemetry.rate_hz, utc=telemetry.by_utc)
    setpoints = autopilot.setpoint(Setpoint(scenario.path.begin_mps, 0.0, 0.0), FlightState(*[0.0] * 8))
    asked = _bits(m.MAVLINK_MSG_ID_TIMESYNC) / PROBE_S
    up = asked + scenario.law.rate_hz * sum(_bits(each.kind().message_id) for each in setpoints)
    acks_hz = scenario.law.rate_hz * min(len(setpoints), len(autopilot.setpoint_commands))
    down = asked + acks_hz * _bits(m.MAVLINK_MSG_ID_COMMAND_ACK)
    down += sum(rate_hz * _bits(message_id) for message_id, rate_hz in rates_hz.items())
    return up / 1e3, down / 1e3


def _bits(message_id: int) -> float:
    """Return the size of a message's frame."""
    return 8.0 * (KINDS[message_id].base_length + FRAME_BYTES)


def _early_s(scenario: Scenario, vehicle: Vehicle | None, times_s: list[float]) -> list[float]:
    """Return by how much a vehicle's clock is mapped too early, s, at each of some times from 0 on, in order.

    It is 0 for a virtual leader, which uses our clock.
    """
    if vehicle is None or _by_utc(scenario, vehicle):
        return [0.0] * len(times_s)
    steps = scenario.link_steps(vehicle)
    begins_s, delays = [step.at_s for step in steps], [mean_delays_s(scenario, step) for step in steps]
    found = (delays[bisect_right(begins_s, at_s) - 1] for at_s in times_s)
    return [(up_s - down_s) / 2 for up_s, down_s in found]


def _delays_at_s(scenario: Scenario, vehicle: Vehicle, at_s: float) -> tuple[float, float]:
    """Return the mean delays of a vehicle's link at a time."""
    return mean_delays_s(scenario, [step for step in scenario.link_steps(vehicle) if step.at_s <= at_s][-1])


def _split(scenario: Scenario, vehicle: Vehicle, at_s: float) -> str:
    if _by_utc(scenario, vehicle):
        return "clock by UTC"
    up_s, down_s = _delays_at_s(scenario, vehicle, at_s)
    return f"{1e3 * up_s:g} ms up and {1e3 * down_s:g} ms down"


class HoldingPattern(NamedTuple):
    """The holding pattern that the leader flies if the formation isn't assembled in time."""

    lap_s: float
    lap_radius_m: float


def holding_pattern(scenario: Scenario) -> HoldingPattern:
    """Return the holding pattern before a scenario's path."""
    leads, speed_mps = leader_guidance(scenario), scenario.path.begin_mps
    flown, start = _pattern(scenario, leads), leads.path.at(0.0)
    end = flown.at(flown.length_m)
    straight_m = math.hypot(start.north_m - end.north_m, start.east_m - end.east_m)
    return HoldingPattern((flown.length_m + straight_m) / speed_mps, _pattern_radius_m(scenario, leads))


def _pattern(scenario: Scenario, leads: LeaderGuidance) -> JoinRoute:
    """Return the leader's route from where it turns off before its path to the straight that leads to the path."""
    air = drift(scenario)
    return leads.holding_pattern(leads.path.at(-DECISION_S * air.speed_mps), air.north_mps, air.east_mps)


def _pattern_radius_m(scenario: Scenario, leads: LeaderGuidance) -> float:
    return leads.hold_radius_m(*scenario.drift_mps)


def cramped_pattern(scenario: Scenario) -> str | None:
    """Return where the fence leaves too little room for a holding pattern before the path; None if there is enough."""
    leads = leader_guidance(scenario)
    if leads.fence is None:
        return None
    positions_m, lack_m = leads.fence.lack(_pattern(scenario, leads), drift(scenario))
    worst = np.unravel_index(int(lack_m.argmax()), lack_m.shape)
    if lack_m[worst] == 0.0:
        return None
    (north_m, east_m), radius_m = positions_m[worst].tolist(), _pattern_radius_m(scenario, leads)
    key = leads.fence.areas.nearest(positions_m[worst]).key
    return (
        f"{key}: found no room for a holding pattern before the path (turns of {radius_m:.0f} m): at "
        f"north {north_m:.0f}, east {east_m:.0f} vehicles are turned away; {math.ceil(lack_m[worst])} m more are needed"
    )


def nothing_comes(scenario: Scenario) -> str | None:
    """Return whose link carries nothing as the flight begins, so that the formation can't assemble; None if none."""
    firsts = [(vehicle, scenario.link_steps(vehicle)[0][1:]) for vehicle in scenario.vehicles]
    deaf = [str(each.vehicle_id) for each, own in firsts if any(one.outage or one.loss >= 1.0 for one in own)]
    if not deaf:
        return None
    return f"links: nothing comes over that of vehicle {', '.join(deaf)} at the start: the formation can't assemble"


def no_time_for_a_pattern(scenario: Scenario) -> str | None:
    """Return that the start times out before the leader passes the path's start a second time; None if it doesn't.

    The leader's first pass is over after its run-in, and a holding pattern follows.
    """
    if scenario.hovers:
        return None
    lap_s, run_in_s, found_s = holding_pattern(scenario).lap_s, scenario.start.run_in_s, scenario.start.timeout_s
    if found_s >= run_in_s + lap_s or not scenario.followers:
        return None
    min_s = math.ceil(run_in_s + lap_s)
    return (
        f"start.timeout_s: found {found_s:g}; the leader's first pass comes {run_in_s:g} s after it sets out, a "
        f"holding pattern takes {lap_s:.0f} s: that ends before the next pass, so the path then begins whether or not "
        f"all are in their slots; {min_s} or more wait"
    )


def too_old(scenario: Scenario) -> str | None:
    """Return whose telemetry exceeds `law.max_age_s` before the next comes, even without loss; None if none does."""
    max_s, between_s = scenario.law.max_age_s, 1.0 / scenario.telemetry.rate_hz
    ages_s = [
        (mean_delays_s(scenario, step)[1] + between_s, step.at_s, vehicle)
        for vehicle in scenario.vehicles
        for step in scenario.link_steps(vehicle)
    ]
    old = [each for each in ages_s if each[0] > max_s]
    if not old:
        return None
    who = ", ".join(dict.fromkeys(str(vehicle.vehicle_id) for *_, vehicle in old))
    from_s, oldest_s = min(at_s for _, at_s, _ in old), max(age_s for age_s, *_ in old)
    never = any(at_s == 0.0 and scenario.leader in (None, vehicle) for _, at_s, vehicle in old)
    return (
        f"law.max_age_s: found {max_s:g}; telemetry of vehicle {who} gets {oldest_s:.4g} s old (the delay down its "
        f"link, and 1/telemetry.rate_hz){since(from_s)}: beyond that it isn't flown in "
        f"the formation{', which may never set out' if never else ''}"
    )


def too_old_after_a_loss(scenario: Scenario) -> str | None:
    """Return whose telemetry exceeds `law.max_age_s` once a message is lost; None if none does.

    Position, attitude and airspeed are sent at different times, so the next state is known up to half a period later.
    """
    max_s, rate_hz = scenario.law.max_age_s, scenario.telemetry.rate_hz
    lossy = [
        (vehicle, step.downlink.loss, mean_delays_s(scenario, step)[1])
        for vehicle in scenario.vehicles
        for step in scenario.link_steps(vehicle)
        if step.downlink.loss > 0.0 and mean_delays_s(scenario, step)[1] + GAP / rate_hz > max_s
    ]
    if not lossy or too_old(scenario) is not None:
        return None
    who, share = ", ".join(dict.fromkeys(str(each.vehicle_id) for each, *_ in lossy)), max(each[1] for each in lossy)
    min_hz = math.ceil(10.0 * GAP / (max_s - max(delay_s for *_, delay_s in lossy))) / 10.0
    return (
        f"telemetry.rate_hz: found {rate_hz:g}; once a message is lost, as up to {share:.1%} are, what is known of "
        f"vehicle {who} gets older than law.max_age_s, {max_s:g}: it is commanded to loiter, among the others; "
        f"{min_hz:g} Hz or more"
    )


def refused_rate(scenario: Scenario) -> str | None:
    """Return that a real ArduPlane with default parameters refuses the telemetry rate; None if it doesn't."""
    planes = [str(each.vehicle_id) for each in scenario.vehicles if each.autopilot == "arduplane"]
    rate_hz = scenario.telemetry.rate_hz
    if not planes or rate_hz <= PLANES_MAX_HZ:
        return None
    return (
        f"telemetry.rate_hz: found {rate_hz:g}; a real ArduPlane (vehicle {', '.join(planes)}) refuses more than "
        f"{PLANES_MAX_HZ:g} with SCHED_LOOP_RATE 50, its default"
    )


def bursts_of_nothing(scenario: Scenario) -> str | None:
    """Return that `mean_burst` is set where `loss` is 0; None otherwise."""
    for vehicle in scenario.vehicles:
        for directions in zip(*(step[1:] for step in scenario.link_steps(vehicle)), strict=True):
            bursts = [each.mean_burst for each in directions if each.mean_burst is not None]
            if bursts and not any(each.loss > 0.0 for each in directions):
                link = f"mean_burst: found {bursts[0]:g} with a loss of 0 (vehicle {vehicle.vehicle_id})"
                return f"links: {link}, which does nothing; loss says how much is lost"
    return None
