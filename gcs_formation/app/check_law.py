"""What `check` says of what the law makes of links: followers held for their jitter, and places that are late."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from airlink.endpoint import VehicleId
from formation_scenario import Scenario
from formation_scenario.links import LinkStep
from formation_scenario.slot_assignment import planned_slots
from gcs_formation.app.check_links import LEAST_M, ways_s
from gcs_formation.control.laws import law_kind
from gcs_formation.fleet.margin_watch import NEAR
from gcs_formation.stability import LoopDelay, Usage, law_loops, loop_delay_s
from gcs_formation.stability.mismatch import DEVIATIONS


class _Held(NamedTuple):
    """How much of its margin a vehicle's loop uses over a link, and by what."""

    used: float
    vehicle: VehicleId
    at_s: float
    loop: str
    scatter_s: float
    margin_s: float
    delay_s: float


def held_by_links(scenario: Scenario) -> str | None:
    """Return that followers will be told to loiter for the links' delay or jitter; None where they won't be.

    What is measured of a scatter is uncertain, so that some are from `NEAR` of the margin on.
    """
    if scenario.law.on_delay != "hold":
        return None
    near = [each for each in _uses(scenario) if each.used >= NEAR]
    if not near:
        return None
    found = max(near, key=lambda each: each.used)
    since = f" from {found.at_s:g} s on" if found.at_s else ""
    share = f"{found.used:.0%} of what loop {found.loop} stands" if math.isfinite(found.used) else "more than any delay"
    who = f"vehicle {', '.join(dict.fromkeys(str(each.vehicle) for each in near))} will be told to loiter"
    if scenario.law.delay_compensation:
        used = f"round trips scatter by {1e3 * found.scatter_s:.0f} ms{since}, {share} about {found.delay_s:.2f} s"
        enough = f"{1e3 * found.margin_s / DEVIATIONS:.0f} ms or less is enough; law.on_delay: warn flies on"
    else:
        used = f"the loop's delay is {found.delay_s:.3f} s{since}, {share}"
        enough = f"{found.margin_s:.3f} s or less is enough; law.delay_compensation predicts over it"
    when = "again and again" if found.used >= 1.0 else "now and then"
    return f"law.on_delay: found hold; {used}: {who} {when}, among the others; {enough}"


def _uses(scenario: Scenario) -> Iterator[_Held]:
    rates_hz = scenario.telemetry.rate_hz, scenario.law.rate_hz
    predicted, following = scenario.law.delay_compensation, planned_slots(scenario)
    for vehicle in scenario.vehicles:
        if vehicle.vehicle_id not in following and not law_kind(scenario).mutual:
            continue
        for loop, loops in law_loops(scenario).get(vehicle.vehicle_id, {}).items():
            usage = Usage(loops, predicted=predicted)
            for step in scenario.link_steps(vehicle):
                delay = LoopDelay(loop_delay_s(*ways_s(step), *rates_hz), _scatter_s(step))
                margin_s = usage.margin_s(delay.mean_s)
                each = vehicle.vehicle_id, step.at_s, loop, delay.scatter_s, margin_s, delay.mean_s
                yield _Held(usage.of(delay), *each)


def _scatter_s(step: LinkStep) -> float:
    """Return the standard deviation of round trips."""
    return 1e-3 * math.hypot(step.uplink.jitter_ms, step.downlink.jitter_ms)


def ahead_of_virtual(scenario: Scenario) -> str | None:
    """Return how far ahead of their slots followers of a virtual leader fly where nothing is predicted; None if not.

    Their places are as old as telemetry is, the leader's isn't: it is the station's own. Of a real leader both are.
    """
    if scenario.leader is not None or scenario.law.delay_compensation or law_kind(scenario).mutual:
        return None
    steps = [(ways_s(step)[1], step.at_s, each) for each in scenario.followers for step in scenario.link_steps(each)]
    down_s, at_s, vehicle = max(steps, key=lambda step: step[0])
    speed_mps, between_s = scenario.path.speed_mps, 1.0 / scenario.telemetry.rate_hz
    least_m, most_m = speed_mps * down_s, speed_mps * (down_s + between_s)
    if most_m < LEAST_M:
        return None
    since = f" from {at_s:g} s on" if at_s else ""
    why = "the delay down its link and up to 1/telemetry.rate_hz"
    age = f"{down_s:.3g} to {down_s + between_s:.3g} s old{since} ({why})"
    ahead = f"{least_m:.2g} to {most_m:.2g} m ahead of its slot at {speed_mps:g} m/s"
    return (
        "law.delay_compensation: found false, with a virtual leader, whose place is of now; that of vehicle "
        f"{vehicle.vehicle_id} is {age}, so it flies {ahead}: true predicts over that, and a real leader's is as old"
    )
