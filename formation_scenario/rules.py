"""Rules between keys, for scenarios in which every key is valid by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from airlink.telemetry_faults import EFFECTS, QUANTITIES, refusal
from flight_model.earth import SEMI_MAJOR_M
from flight_model.legs.path import MIN_LEG_M
from flight_model.path import PathError
from formation_scenario import vehicle_rules
from formation_scenario.channel_rules import channels
from formation_scenario.expectation import (
    FENCE,
    FOLLOWER_METRICS,
    LINK_METRICS,
    METRICS,
    OF_FOLLOWERS,
    SEPARATION,
    WINDOWED,
    Expectation,
    pointless,
)
from formation_scenario.extensions import FAULT
from formation_scenario.fields import MAX_DISTANCE_M, FileError, Timed, VehicleSelection, distinct_texts
from formation_scenario.links import (
    DefaultLink,
    Impairment,
    ImpairmentPatch,
    LinkChange,
    Links,
    least_mean_burst,
)
from formation_scenario.model import Scenario
from formation_scenario.orders import read_order
from formation_scenario.sampled_path import WAYPOINTS
from formation_scenario.scripted import ACTS, ScriptedLink, ScriptedOrder
from formation_scenario.source import Finding, KeyPath
from formation_scenario.start_states_and_end_times import latest_end_s
from formation_scenario.surroundings import PASSING, TELEMETRY_KEYS, Disturbance, DrydenTurbulence, Fault
from formation_scenario.terrain import ALLOWED as ELEVATION_FILES
from formation_scenario.traces.keys import Trace
from formation_scenario.traces.reading import ALLOWED
from formation_scenario.vehicle_rules import one_vehicle
from formation_scenario.vehicles import Vehicle

MOST_LINK_STATES = 400_000
"""Changes of links times vehicles: `check` takes some 5 s for as many."""
MOST_SLOT_CHANGES = 10_000
"""Changes of the formation, also by orders, times vehicles and `PLANNING_VEHICLES`: the same, on `USUAL_PATH_M`."""
USUAL_PATH_M = 50e3
"""Each slot is checked all along the path."""
PLANNING_VEHICLES = 13
"""As many vehicles' slots take as long to check as a change without its vehicles."""
MAX_PATH_M = 1e6
"""Half a day's flight; a longer path would take too long to check, every few metres against every limit."""
MAX_LATITUDE_DEG = 89.0
"""Beyond this latitude a degree of longitude is less than 2 km long."""
MAX_HEIGHT_M = 30_000.0


def places(scenario: Scenario) -> Iterator[Finding]:
    """Yield the first waypoint too far from the origin, too near to a pole, or too high."""
    origin = scenario.origin
    for index, (north_m, east_m, height_m) in enumerate(scenario.path.waypoints_m):
        distance_m = math.hypot(north_m, east_m)
        latitude_deg = origin.lat_deg + math.degrees(north_m / SEMI_MAJOR_M)
        sea_m = abs(height_m + origin.alt_m)
        for size, most, found, allowed in (
            (distance_m, MAX_DISTANCE_M, f"{distance_m:.3g} m from the origin", f"{MAX_DISTANCE_M:g} m"),
            (abs(latitude_deg), MAX_LATITUDE_DEG, f"at latitude {latitude_deg:.1f}°", f"{MAX_LATITUDE_DEG:g}°"),
            (sea_m, MAX_HEIGHT_M, f"{height_m:.3g} m high", f"{MAX_HEIGHT_M:g} m above sea level"),
        ):
            if size > most:
                yield (*WAYPOINTS, index), f"found a waypoint {found}", f"up to {allowed}"
                return


def row(scenario: Scenario) -> Iterator[Finding]:
    """Yield a row in the air, or one with vehicles nearer to each other than the separation limit."""
    row_m, least_m, path = scenario.start.row_m, scenario.safety.separation_m, ("start", "row_m")
    if row_m is not None and scenario.start.in_air:
        yield path, "found a row of vehicles that begin in the air", "none with in_air: true"
    elif row_m is not None and row_m < least_m:
        yield path, f"found {row_m:g} m", f"safety.separation_m, {least_m:g} m, or more"


def fence(scenario: Scenario) -> Iterator[Finding]:
    """Yield a fence whose lowest height is above its highest, and areas that are no polygon or circle, or both."""
    limits, key = scenario.safety.fence, ("safety", "fence")
    if limits is None:
        return
    lowest_m, highest_m = limits.heights_m
    if lowest_m > highest_m:
        yield (*key, "height_min_m"), f"found {lowest_m:g} m", f"up to height_max_m, {highest_m:g} m"
    for index, area in enumerate(limits.areas):
        found = [name for name in ("corners_m", "centre_m", "radius_m") if getattr(area, name) is not None]
        if found not in (["corners_m"], ["centre_m", "radius_m"]):
            allowed = "corners_m of a polygon, or centre_m and radius_m of a circle"
            yield (*key, "areas", index), f"found {' and '.join(found) or 'neither corners nor centre'}", allowed


def wind(scenario: Scenario) -> Iterator[Finding]:
    """Yield a wind at least as fast as the slowest vehicle's highest airspeed."""
    speed_mps = scenario.wind.speed_mps
    slowest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.speed_max_mps)
    if speed_mps >= slowest.model.speed_max_mps:
        allowed = f"less than {slowest.model.speed_max_mps:g} m/s, vehicle {slowest.vehicle_id}'s speed_max_mps"
        yield ("wind", "velocity_mps"), f"found a wind of {speed_mps:.3g} m/s", allowed


def leg_speeds(scenario: Scenario) -> Iterator[Finding]:
    """Yield a list of speeds for a path without legs, or with another number of legs."""
    given, legs = scenario.path.speed_mps, len(scenario.path.waypoints_m) - 1
    if isinstance(given, tuple) and scenario.path.kind != "legs":
        yield ("path", "speed_mps"), "found a list, one a leg", "a number, or kind: legs"
    elif isinstance(given, tuple) and len(given) != legs:
        yield ("path", "speed_mps"), f"found {len(given)} speeds", f"{legs}, one a leg, or a number"


def circles(scenario: Scenario) -> Iterator[Finding]:
    """Yield circles without legs, beyond the last waypoint, or twice at one; and legs without room for theirs."""
    plan, seen = scenario.path, set[int]()
    for index, each in enumerate(plan.circles):
        key = ("path", "circles", index)
        if plan.kind != "legs":
            yield key, "found circles", "with path.kind: legs"
        elif each.waypoint >= len(plan.waypoints_m) or each.waypoint in seen:
            again = " again" if each.waypoint in seen else ""
            yield (*key, "waypoint"), f"found {each.waypoint}{again}", f"1 to {len(plan.waypoints_m) - 1}, once each"
        seen.add(each.waypoint)


def stops(scenario: Scenario) -> Iterator[Finding]:
    """Yield stops without legs, of vehicles that don't hover, at the path's ends, or twice at a waypoint."""
    plan, seen, last = scenario.path, set[int](), len(scenario.path.waypoints_m) - 2
    keys = [("path", "stops")] if plan.stops else []
    keys += [("path", "turn")] if plan.turn == "stop" else []
    for key in keys:
        if plan.kind != "legs":
            yield key, "found stops", "with path.kind: legs"
        elif not scenario.hovers:
            yield key, "found stops of vehicles that can't hover", "circles (path.circles), or vehicles that hover"
    for index, each in enumerate(plan.stops if plan.kind == "legs" and scenario.hovers else ()):
        if each.waypoint > last or each.waypoint in seen:
            again = " again" if each.waypoint in seen else ""
            allowed = f"1 to {last}, once each: the path is begun and ended in flight" if last else "a waypoint between"
            yield ("path", "stops", index, "waypoint"), f"found {each.waypoint}{again}", allowed
        seen.add(each.waypoint)


def path(scenario: Scenario) -> Iterator[Finding]:
    """Yield all waypoints through which no path leads, and paths that are too long."""
    allowed = "waypoints 1 m or more apart, without turning straight back"
    legs_m = np.hypot(*np.diff(np.array(scenario.path.waypoints_m)[:, :2], axis=0).T)
    for index in np.flatnonzero(legs_m < MIN_LEG_M).tolist():
        yield (*WAYPOINTS, index + 1), f"found a waypoint {legs_m[index]:.3g} m from the one before it", allowed
    if legs_m.min() < MIN_LEG_M:
        return
    try:
        length_m = scenario.written_path.length_m
    except PathError as error:
        yield (*WAYPOINTS, error.waypoint), str(error), allowed
    else:
        if length_m > MAX_PATH_M:
            found, most = distinct_texts(length_m, MAX_PATH_M)
            yield WAYPOINTS, f"found a path of {found} m", f"up to {most} m"


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


def traces(scenario: Scenario) -> Iterator[Finding]:
    """Yield records of delays that can't be read, in both forms, or with two sources of their times."""
    found = dict[Trace, str | None]()
    for path, patch in _link_groups(scenario):
        trace = patch.trace or (None if patch.trace_file is None else Trace(file=patch.trace_file))
        if trace is None:
            continue
        if patch.trace is not None and patch.trace_file is not None:
            yield (*path, "trace_file"), "found it beside trace", "one of them"
        if trace.time is not None and trace.period_s is not None:
            yield (*path, "trace", "period_s"), "found it beside time", "one of them"
        if trace not in found:
            found[trace] = _unreadable(scenario, trace)
        if (error := found[trace]) is not None:
            yield (*path, *(("trace", "file") if patch.trace is not None else ("trace_file",))), error, ALLOWED


def _unreadable(scenario: Scenario, trace: Trace) -> str | None:
    """Return why a record of delays can't be read; None if it can."""
    try:
        scenario.recorded_delays(trace)
    except FileError as error:
        return str(error)
    return None


def _link_groups(scenario: Scenario) -> Iterator[tuple[KeyPath, Impairment | ImpairmentPatch]]:
    """Yield every group of keys with properties of links, and its place."""
    links = scenario.links
    groups: dict[KeyPath, DefaultLink | Links | LinkChange] = {("links", "default"): links.default, ("links",): links}
    groups |= {("links", "changes", index): change for index, change in enumerate(links.changes)}
    for path, group in groups.items():
        each = {path: group, (*path, "uplink"): group.uplink, (*path, "downlink"): group.downlink}
        yield from ((at, patch) for at, patch in each.items() if isinstance(patch, Impairment | ImpairmentPatch))


def bursts(scenario: Scenario) -> Iterator[Finding]:
    """Yield bursts of losses too short for the share that is lost."""
    refused: set[KeyPath] = set()
    for vehicle, number in scenario.each_link():
        steps = scenario.own_link_steps(vehicle, number)
        for path, step in zip(_step_places(scenario, vehicle, number), steps, strict=True):
            for way, link in (("uplink", step.uplink), ("downlink", step.downlink)):
                least = least_mean_burst(link.loss)
                if link.mean_burst is not None and link.mean_burst < least and path not in refused:
                    refused.add(path)
                    whose = f"{way} of vehicle {vehicle.vehicle_id}"
                    found = f"found {link.mean_burst:g} with a loss of {link.loss:g} ({whose})"
                    allowed = f"{least:g} or more with that loss" if least < math.inf else "a loss below 1 beside it"
                    yield (*path, "mean_burst"), found, allowed


def _step_places(scenario: Scenario, vehicle: Vehicle, number: int) -> list[KeyPath]:
    """Return where each step of a vehicle's link is written; the last of several changes at the same time."""
    places: dict[float, KeyPath] = {0.0: ("links", "default")}
    for index, change in enumerate(scenario.links.changes):
        whose = change.vehicles == "all" or any(ref in change.vehicles for ref in vehicle.refs)
        if whose and change.link in (None, number):
            places[change.at_s] = ("links", "changes", index)
    return [places[at_s] for at_s in sorted(places)]


def sizes(scenario: Scenario) -> Iterator[Finding]:
    """Yield changes that are too many for so many vehicles: each is planned or checked for each vehicle."""
    count, length_m = len(scenario.vehicles), _written_m(scenario)
    whose, planned = f"with {count} vehicles", len(scenario.formation.changes)
    ordered = sum(read_order(each.order).change is not None for _, each in scenario.timed_orders)
    longer = max(1.0, length_m / USUAL_PATH_M)
    most = int(MOST_SLOT_CHANGES / longer / (count + PLANNING_VEHICLES))
    there = whose if longer == 1.0 else f"{whose} on a path of {length_m / 1e3:.0f} km"
    beside = f" beside {planned} changes" if planned else ""
    for path, found, what, allowed, more in (
        (("links", "changes"), len(scenario.links.changes), f"changes {whose}", MOST_LINK_STATES // count, ""),
        (("formation", "changes"), planned, f"changes {there}", most, ""),
        (("orders",), ordered, f"orders that change the formation {there}", max(most - planned, 0), beside),
    ):
        if found > allowed:
            yield path, f"found {found} {what}", f"up to {allowed} with so many{more}"


def _written_m(scenario: Scenario) -> float:
    """Return the path's length; 0 of one that is refused."""
    try:
        return scenario.written_path.length_m
    except PathError:
        return 0.0


def link_changes(scenario: Scenario) -> Iterator[Finding]:
    """Yield changes of links that change nothing."""
    for index, change in enumerate(scenario.links.changes):
        given = change.model_dump(exclude={"at_s", "vehicles"}, exclude_none=True)
        if all(value == {} for value in given.values()):
            keys = ", ".join(key for key in LinkChange.model_fields if key not in Timed.model_fields)
            yield ("links", "changes", index), "found a change of nothing", f"one or more of {keys}"


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
    """Return what is wrong with something that a program does to a scenario's flight; the index in its places is 0."""
    alone = scenario.model_copy(update={"orders": (act,)})
    rules = (references, disturbances, faults, acts)
    return [found for rule in rules for found in rule(alone) if found[0][0] == "orders"]


def measurable(scenario: Scenario) -> Iterator[Finding]:
    """Yield expectations of nobody: of followers if there are none, or of a single vehicle's separation."""
    for index, entry in enumerate(scenario.expect):
        path: KeyPath = ("expect", index, "metric")
        if entry.metric in OF_FOLLOWERS and not scenario.followers:
            found = f"found {entry.metric} of a formation without followers"
            yield path, found, "one or more followers, or a figure that needs none"
        elif entry.metric == SEPARATION and len(scenario.vehicles) == 1:
            yield path, f"found {entry.metric} of one vehicle", "two or more vehicles, or a figure that needs one alone"
        elif entry.metric == FENCE and scenario.safety.fence is None:
            yield path, f"found {entry.metric} without a fence", "safety.fence, or a figure that needs none"


def ranges(scenario: Scenario) -> Iterator[Finding]:
    """Yield bounds outside a figure's possible values."""
    for index, entry in enumerate(scenario.expect):
        for name, found, allowed in pointless(entry.metric, entry.below, entry.above):
            yield ("expect", index, name), found, allowed


def expectations(scenario: Scenario) -> Iterator[Finding]:
    """Yield expectations of nobody, without a bound, with a window that is never flown, or that can't be met."""
    yield from measurable(scenario)
    yield from ranges(scenario)
    end_s = _latest_end_s(scenario)
    for index, entry in enumerate(scenario.expect):
        path: KeyPath = ("expect", index)
        if entry.below is None and entry.above is None:
            yield path, "found no bound", "below, above or both"
        if entry.metric in METRICS and entry.metric not in WINDOWED:
            yield from _part_of_flight(entry, path, scenario.duration_s)
        elif entry.from_s >= entry.to_s:
            found = f"found a window from {entry.from_s:g} to {entry.to_s:g} s"
            yield (*path, "from_s"), found, "from_s before to_s"
        elif entry.from_s >= end_s:
            allowed = f"less than {end_s:.1f} s, when the flight is over at the latest"
            yield (*path, "from_s"), f"found {entry.from_s:g}", allowed
        if entry.metric not in (*FOLLOWER_METRICS, *LINK_METRICS) and entry.followers != "all":
            yield (*path, "followers"), f"found followers for {entry.metric}, a figure of the whole run", "all"
        if entry.below is not None and entry.above is not None and entry.below <= entry.above:
            yield (*path, "below"), f"found above {entry.above:g} and below {entry.below:g}", "more than above"


def _part_of_flight(entry: Expectation, path: KeyPath, duration_s: float) -> Iterator[Finding]:
    """Yield the ends of a window for a figure that has no window."""
    of = f"for {entry.metric}, a figure of the whole flight"
    if entry.from_s > 0.0:
        yield (*path, "from_s"), f"found {entry.from_s:g} {of}", "0, or nothing"
    if entry.to_s < duration_s:
        yield (*path, "to_s"), f"found {entry.to_s:g} {of}", f"duration_s, {duration_s:g}, or nothing"


def _latest_end_s(scenario: Scenario) -> float:
    if not any(entry.from_s for entry in scenario.expect):
        return scenario.duration_s
    try:
        return latest_end_s(scenario)
    except PathError:  # reported by the rule `path`
        return math.inf


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
    sizes,
    link_changes,
    traces,
    bursts,
    channels,
    vehicle_rules.slots,
    vehicle_rules.changes,
    vehicle_rules.orders,
    acts,
    vehicle_rules.consensus,
    leg_speeds,
    circles,
    stops,
    row,
    path,
    places,
    wind,
    terrain,
    vehicle_rules.avoidance,
    fence,
)
"""The rules, in the order of the scenario's keys."""


def inconsistencies(scenario: Scenario) -> list[Finding]:
    """Return every violation of a rule between keys; `expectations` are checked separately."""
    return [found for rule in RULES for found in rule(scenario)]
