"""Rules between keys, for scenarios in which every key is valid by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from airlink.telemetry_faults import EFFECTS, QUANTITIES, refusal
from formation_scenario import link_rules, path_rules, vehicle_rules
from formation_scenario.channel_rules import channels
from formation_scenario.expectation import (
    LINK_METRICS,
)
from formation_scenario.extensions import FAULT
from formation_scenario.feature_folders import brought
from formation_scenario.fields import FileError, Timed, VehicleSelection
from formation_scenario.model import Scenario
from formation_scenario.scripted import ACTS, ScriptedLink, ScriptedOrder
from formation_scenario.source import Finding, KeyPath
from formation_scenario.surroundings import PASSING, TELEMETRY_KEYS, Disturbance, DrydenTurbulence, Fault
from formation_scenario.terrain import ALLOWED as ELEVATION_FILES
from formation_scenario.vehicle_rules import one_vehicle
from formation_scenario.vehicles import Vehicle


def row(scenario: Scenario) -> Iterator[Finding]:
    """Yield a row in the air, or one with vehicles nearer to each other than the separation limit."""
    row_m, min_m, path = scenario.start.row_m, scenario.safety.separation_m, ("start", "row_m")
    if row_m is not None and scenario.start.in_air:
        yield path, "found a row of vehicles that begin in the air", "none with in_air: true"
    elif row_m is not None and row_m < min_m:
        yield path, f"found {row_m:g} m", f"safety.separation_m, {min_m:g} m, or more"


def wind(scenario: Scenario) -> Iterator[Finding]:
    """Yield a wind at least as fast as the slowest vehicle's highest airspeed."""
    speed_mps = scenario.wind.speed_mps
    slowest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.speed_max_mps)
    if speed_mps >= slowest.model.speed_max_mps:
        allowed = f"less than {slowest.model.speed_max_mps:g} m/s, vehicle {slowest.vehicle_id}'s speed_max_mps"
        yield ("wind", "velocity_mps"), f"found a wind of {speed_mps:.3g} m/s", allowed


def terrain(scenario: Scenario) -> Iterator[Finding]:
    """Yield a ground given twice, contradicting clearances, and an unreadable file."""
    terrain, clearance_m = scenario.terrain, scenario.safety.clearance_m
    if terrain is None:
        return
    if terrain.file is not None and terrain.hills:
        yield ("terrain", "hills"), "found hills beside a file", "one of them"
    if clearance_m > terrain.clearance_m:
        allowed = f"at most terrain.clearance_m, {terrain.clearance_m:g}"
        yield ("safety", "clearance_m"), f"found {clearance_m:g}", allowed
    try:
        _ = scenario.ground
    except FileError as error:
        yield ("terrain", "file"), str(error), ELEVATION_FILES


def references(scenario: Scenario) -> Iterator[Finding]:
    """Yield references of links, disturbances, faults and expectations to vehicles that don't exist."""
    groups: tuple[tuple[KeyPath, Sequence[Timed]], ...] = (
        (("links", "changes"), scenario.links.changes),
        (("disturbances",), scenario.disturbances),
        (("faults",), scenario.faults),
    )
    for path, entries in groups:
        for index, entry in enumerate(entries):
            yield from _unknown(entry.vehicles, scenario.vehicles, (*path, index, "vehicles"))
    for index, act in scenario.scripted:
        parts = {"link": act.link, "fault": act.fault, "disturbance": act.disturbance}
        for name, part in parts.items():
            if part is not None:
                yield from _unknown(part.vehicles, scenario.vehicles, ("orders", index, name, "vehicles"))
    for index, bound in enumerate(scenario.expect):
        chosen = scenario.vehicles if bound.metric in LINK_METRICS else scenario.followers
        yield from _unknown(bound.followers, chosen, ("expect", index, "followers"))


def _unknown(selection: VehicleSelection, vehicles: tuple[Vehicle, ...], path: KeyPath) -> Iterator[Finding]:
    for index, ref in enumerate(() if selection == "all" else selection):
        yield from one_vehicle(ref, vehicles, (*path, index))


def disturbances(scenario: Scenario) -> Iterator[Finding]:
    """Yield disturbances that end before they begin, and turbulence without its intensity."""
    planned: list[tuple[KeyPath, Disturbance]] = [
        (("disturbances", i), each) for i, each in enumerate(scenario.disturbances)
    ]
    scripted = ((i, act.disturbance) for i, act in scenario.scripted)
    planned += [(("orders", i, "disturbance"), each) for i, each in scripted if each is not None]
    for path, entry in planned:
        if entry.end_s <= entry.at_s:
            yield (*path, "until_s"), f"found {entry.end_s:g}", f"more than at_s, {entry.at_s:g}"
        if isinstance(entry, DrydenTurbulence):
            given = {name for name in ("wind_6m_mps", "sigma_mps", "length_m") if getattr(entry, name) is not None}
            if given not in ({"wind_6m_mps"}, {"sigma_mps", "length_m"}):
                found = f"found {', '.join(sorted(given)) or 'neither'}"
                yield path, found, "wind_6m_mps, or sigma_mps and length_m"


def faults(scenario: Scenario) -> Iterator[Finding]:
    """Yield faults with an end or keys that their kind doesn't have."""
    planned: list[tuple[KeyPath, Fault]] = [(("faults", i), each) for i, each in enumerate(scenario.faults)]
    scripted = ((i, act.fault) for i, act in scenario.scripted)
    planned += [(("orders", i, "fault"), each) for i, each in scripted if each is not None]
    for path, fault in planned:
        own = scenario.registered.get(fault.kind, FAULT)
        end = "until_s" if fault.for_s is None else "for_s"
        if fault.end_s < math.inf and not (fault.kind in PASSING if own is None else own.made.lasts):
            yield (*path, end), f"found an end of a {fault.kind}", f"only for {', '.join(PASSING)}"
        elif fault.for_s is not None and fault.until_s is not None:
            yield (*path, end), "found both until_s and for_s", "one of the two"
        elif fault.end_s <= fault.at_s:
            yield (*path, end), f"found {fault.end_s:g}", f"after at_s, {fault.at_s:g}"
        if fault.mode is not None and fault.kind != "pilot":
            yield (*path, "mode"), f"found a mode for a {fault.kind}", "only for pilot"
        yield from _of_telemetry(fault, path)


def _of_telemetry(fault: Fault, path: KeyPath) -> Iterator[Finding]:
    """Yield what is wrong with the keys of a fault of telemetry, and those keys of other faults."""
    given = [name for name in TELEMETRY_KEYS if getattr(fault, name) is not None]
    if fault.kind != "telemetry":
        yield from (((*path, name), f"found one for a {fault.kind}", "only for telemetry") for name in given)
        return
    quantity, effect = fault.quantity, fault.effect
    if quantity is None:
        yield (*path, "quantity"), "found none", ", ".join(QUANTITIES)
    if effect is None:
        yield (*path, "effect"), "found none", ", ".join(EFFECTS)
    refused = None if quantity is None or effect is None else refusal(quantity, effect, fault.amount)
    if refused is not None:
        name, found, allowed = refused
        yield (*path, name), found, allowed


def acts(scenario: Scenario) -> Iterator[Finding]:
    """Yield entries of what a program did that aren't one thing, and changes of links that change nothing."""
    for index, act in scenario.scripted:
        if len(act.given) != 1:
            yield ("orders", index), f"found {' and '.join(act.given) or 'nothing to do'}", f"one of {', '.join(ACTS)}"
        if act.link is not None and act.link.changes_nothing:
            keys = ", ".join(key for key in ScriptedLink.model_fields if key != "vehicles")
            yield ("orders", index, "link"), "found a change of nothing", f"one or more of {keys}"


def refused_act(scenario: Scenario, act: ScriptedOrder) -> list[Finding]:
    """Return what is wrong with something that a program does to a scenario's flight; the index in its keys is 0."""
    alone = scenario.model_copy(update={"orders": (act,)})
    rules = (references, disturbances, faults, acts)
    return [found for rule in rules for found in rule(alone) if found[0][0] == "orders"]


RULES = (
    vehicle_rules.identities,
    vehicle_rules.roles,
    vehicle_rules.endpoints,
    vehicle_rules.several_links,
    vehicle_rules.signing,
    vehicle_rules.speeds,
    vehicle_rules.climbing,
    vehicle_rules.hovering,
    vehicle_rules.emulators,
    references,
    disturbances,
    faults,
    link_rules.sizes,
    link_rules.link_changes,
    link_rules.traces,
    link_rules.bursts,
    channels,
    vehicle_rules.slots,
    vehicle_rules.changes,
    vehicle_rules.orders,
    acts,
    vehicle_rules.consensus,
    path_rules.leg_speeds,
    path_rules.circles,
    path_rules.stops,
    row,
    path_rules.path,
    path_rules.waypoint_positions,
    wind,
    terrain,
)
"""The rules of the core's keys, in the order of these."""


def inconsistencies(scenario: Scenario) -> list[Finding]:
    """Return every violation of a rule between keys; `expectations` are checked separately."""
    theirs = (rule for module in brought("rules") for rule in module.RULES)
    return [found for rule in (*RULES, *theirs) for found in rule(scenario)]
