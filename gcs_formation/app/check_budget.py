"""What `check` says about the budget of links: bytes a second by message, vehicle and direction, and what fits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from airlink import mavlink as m
from formation_scenario import Scenario, Vehicle
from gcs_formation.budget.levels import LEVELS
from gcs_formation.budget.traffic import STEADY_PROBE_S, USABLE, Flow, Rates, fitting_level, flows_of, rates_of
from gcs_formation.fleet.heartbeats import FAILOVER_PROBE_S
from gcs_formation.from_scenario import autopilot_for

ACK: Final = m.MAVLINK_MSG_ID_COMMAND_ACK
SLOWER_HZ: Final = (20.0, 10.0, 8.0, 5.0, 4.0, 3.0, 2.0)
"""Rates of telemetry that are tried."""
SLOWER_LAW_HZ: Final = (10.0, 5.0, 2.0, 1.0)


class ChannelBudget(NamedTuple):
    """One radio: what it carries, and what its vehicles need."""

    number: int
    vehicles: tuple[Vehicle, ...]
    rates: Rates
    used: float
    """Share of its time that full rates take."""
    level: int
    """The first level of `LEVELS` that fits."""
    used_at_level: float
    fitting: tuple[float, float] | None
    """The highest rates of telemetry and law that fit by themselves, Hz; None if these are the scenario's, or none."""


def budget_report(scenario: Scenario) -> dict[str, Any]:
    """Return what `check --json` prints."""
    return {
        "vehicles": {
            str(vehicle.vehicle_id): {
                direction: {each.name: round(each.bytes_per_s, 1) for each in flows if each.up == (direction == "up")}
                for direction in ("up", "down")
            }
            for vehicle in scenario.vehicles
            for flows in [_flows(scenario, (vehicle,))]
        },
        "further_links": {
            str(vehicle.vehicle_id): dict(zip(("up", "down"), _further(scenario, vehicle), strict=True))
            for vehicle in scenario.vehicles
            if len(vehicle.endpoints) > 1
        },
        "channels": [
            {
                "channel": each.number,
                "vehicles": [str(vehicle.vehicle_id) for vehicle in each.vehicles],
                "bytes_per_s": {"up": each.rates.up, "down": each.rates.down},
                "used": round(each.used, 3),
                "fits": each.used <= USABLE,
                "level": each.level,
                "used_at_level": round(each.used_at_level, 3),
                "fitting": None
                if each.fitting is None
                else {"telemetry": {"rate_hz": each.fitting[0]}, "law": {"rate_hz": each.fitting[1]}},
            }
            for each in channel_budgets(scenario)
        ],
    }


def budget_text(scenario: Scenario) -> Iterator[str]:
    """Yield the same as lines of text; vehicles with the same traffic share theirs."""
    alike = dict[tuple[Flow, ...], list[str]]()
    for vehicle in scenario.vehicles:
        alike.setdefault(tuple(_flows(scenario, (vehicle,))), []).append(str(vehicle.vehicle_id))
    for flows, who in alike.items():
        each = ", each" if len(who) > 1 else ""
        for direction in ("up", "down"):
            those = sorted((flow for flow in flows if flow.up == (direction == "up")), key=lambda f: -f.bytes_per_s)
            parts = ", ".join(f"{flow.name} {flow.bytes_per_s:.0f}" for flow in those)
            total = sum(flow.bytes_per_s for flow in those)
            yield f"bytes a second in turns, vehicle {', '.join(who)}{each}, {direction} {total:.0f}: {parts}"
    yield from _further_text(scenario)
    for budget in channel_budgets(scenario):
        yield from _channel_text(budget)


def _further_text(scenario: Scenario) -> Iterator[str]:
    """Yield what a link takes that isn't in use, of vehicles with several."""
    alike = dict[tuple[float, float], list[str]]()
    for vehicle in scenario.vehicles:
        if len(vehicle.endpoints) > 1:
            alike.setdefault(_further(scenario, vehicle), []).append(str(vehicle.vehicle_id))
    for (up, down), who in alike.items():
        yield f"and each further link of vehicle {', '.join(who)}: up {up:.0f}, down {down:.0f}"


def _further(scenario: Scenario, vehicle: Vehicle) -> tuple[float, float]:
    """Return the bytes a second up and down of a link that isn't in use: it is kept alive and measured."""
    flows, more = _flows(scenario, (vehicle,)), STEADY_PROBE_S / FAILOVER_PROBE_S
    probes = (m.MAVLINK_MSG_ID_TIMESYNC,)
    up = sum(each.bytes_per_s for each in flows if each.up and each.message_id == m.MAVLINK_MSG_ID_HEARTBEAT)
    down = sum(each.bytes_per_s for each in flows if not each.up and each.message_id not in (*probes, ACK))
    asked = sum(each.bytes_per_s for each in flows if each.up and each.message_id in probes)
    return up + more * asked, down + more * asked


def _channel_text(budget: ChannelBudget) -> Iterator[str]:
    who = ", ".join(str(each.vehicle_id) for each in budget.vehicles)
    radio = f"links.channels.{budget.number} (vehicle {who}): {budget.used:.0%} of its time"
    if budget.used <= USABLE:
        yield f"{radio}: fits (up to {USABLE:.0%} do)"
        return
    flown = f"flown at level {budget.level} of the budget: {LEVELS[budget.level].words}, {budget.used_at_level:.0%}"
    if budget.fitting is None:
        yield f"{radio}: full; {flown}; no rates of telemetry and law fit by themselves"
        return
    yield f"{radio}: full; {flown}; what fits by itself:"
    yield f"  telemetry: {{rate_hz: {budget.fitting[0]:g}}}"
    yield f"  law: {{rate_hz: {budget.fitting[1]:g}}}"


def channel_budgets(scenario: Scenario) -> Iterator[ChannelBudget]:
    """Yield the budget of each radio that has a rate."""
    for index, vehicles in scenario.channel_members():
        rates = rates_of(scenario.links.channels[index])
        if rates is None or not vehicles:
            continue
        ours = [autopilot_for(each, scenario) for each in vehicles]
        level = fitting_level(rates, [flows_of(scenario, ours, each) for each in LEVELS])
        used = rates.used(flows_of(scenario, ours, LEVELS[0]))
        at_level = rates.used(flows_of(scenario, ours, LEVELS[level]))
        fitting = None if used <= USABLE else _fitting(scenario, rates, vehicles)
        yield ChannelBudget(index, vehicles, rates, used, level, at_level, fitting)


def _fitting(scenario: Scenario, rates: Rates, vehicles: tuple[Vehicle, ...]) -> tuple[float, float] | None:
    """Return the highest rates of telemetry and, if that isn't enough, law that fit; None if none do."""
    laws_hz = (scenario.law.rate_hz, *(each for each in SLOWER_LAW_HZ if each < scenario.law.rate_hz))
    for law_hz in laws_hz:
        law = scenario.law.model_copy(update={"rate_hz": law_hz})
        for rate_hz in (each for each in SLOWER_HZ if each <= scenario.telemetry.rate_hz):
            telemetry = scenario.telemetry.model_copy(update={"rate_hz": rate_hz})
            slower = scenario.model_copy(update={"law": law, "telemetry": telemetry})
            ours = [autopilot_for(each, slower) for each in vehicles]
            if rates.used(flows_of(slower, ours, LEVELS[0])) <= USABLE:
                return rate_hz, law_hz
    return None


def _flows(scenario: Scenario, vehicles: tuple[Vehicle, ...]) -> list[Flow]:
    return list(flows_of(scenario, [autopilot_for(each, scenario) for each in vehicles], LEVELS[0]))
