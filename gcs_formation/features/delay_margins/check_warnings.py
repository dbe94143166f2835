"""What `check` says about `law.on_delay`: laws for which it does nothing, and followers that links will have held."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

from airlink.endpoint import VehicleId
from formation_scenario.links import LinkStep
from formation_scenario.mean_delays import mean_delays_s, since
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import planned_slots
from gcs_formation.control.laws import law_kind
from gcs_formation.features.delay_margins.keys import DelayMarginKeys
from gcs_formation.stability import LoopDelay, Usage, law_loops, law_usages, loop_delay_s
from gcs_formation.stability.mismatch import DEVIATIONS, NEAR


def without_margins(scenario: Scenario) -> Iterator[str]:
    """Yield that `law.on_delay` does nothing, of a law that states no margin, or whose gains can't be lowered."""
    on_delay = DelayMarginKeys.of(scenario).on_delay
    if on_delay == "warn" or law_kind(scenario).has_margins:
        return
    asked = f"found {on_delay}; it does nothing: law {scenario.law.type}"
    if not any(law_usages(scenario).values()):
        yield f"law.on_delay: {asked} has no delay margin of its own"
    elif on_delay == "degrade":
        yield f"law.on_delay: {asked} has no gains that could be lowered"


class _Held(NamedTuple):
    """How much of its margin a vehicle's loop uses over a link, and the figures that this follows from."""

    used: float
    vehicle: VehicleId
    at_s: float
    loop: str
    sigma_s: float
    margin_s: float
    delay_s: float


def held_by_links(scenario: Scenario) -> Iterator[str]:
    """Yield that followers will be commanded to loiter because of delay or jitter of their links.

    The standard deviation is known by measurement only, so some are commanded to when `NEAR` of the margin is in use.
    """
    if DelayMarginKeys.of(scenario).on_delay != "hold":
        return
    near = [each for each in _uses(scenario) if each.used >= NEAR]
    if not near:
        return
    found = max(near, key=lambda each: each.used)
    onwards = since(found.at_s)
    share = (
        f"{found.used:.0%} of what loop {found.loop} tolerates" if math.isfinite(found.used) else "more than any delay"
    )
    who = f"vehicle {', '.join(dict.fromkeys(str(each.vehicle) for each in near))} will be commanded to loiter"
    if scenario.law.delay_compensation:
        used = f"round trips scatter by {1e3 * found.sigma_s:.0f} ms{onwards}, {share} about {found.delay_s:.2f} s"
        enough = f"{1e3 * found.margin_s / DEVIATIONS:.0f} ms or less is enough; law.on_delay: warn flies on"
    else:
        used = f"the loop's delay is {found.delay_s:.3f} s{onwards}, {share}"
        enough = f"{found.margin_s:.3f} s or less is enough; law.delay_compensation predicts over it"
    when = "again and again" if found.used >= 1.0 else "now and then"
    yield f"law.on_delay: found hold; {used}: {who} {when}, among the others; {enough}"


def _uses(scenario: Scenario) -> Iterator[_Held]:
    rates_hz = scenario.telemetry.rate_hz, scenario.law.rate_hz
    predicted, following = scenario.law.delay_compensation, planned_slots(scenario)
    for vehicle in scenario.vehicles:
        if vehicle.vehicle_id not in following and not law_kind(scenario).mutual:
            continue
        for loop, loops in law_loops(scenario).get(vehicle.vehicle_id, {}).items():
            usage = Usage(loops, predicted=predicted)
            for step in scenario.all_link_steps(vehicle):
                delay = LoopDelay(loop_delay_s(*mean_delays_s(scenario, step), *rates_hz), _sigma_s(step))
                margin_s = usage.margin_s(delay.mean_s)
                each = vehicle.vehicle_id, step.at_s, loop, delay.sigma_s, margin_s, delay.mean_s
                yield _Held(usage.of(delay), *each)


def _sigma_s(step: LinkStep) -> float:
    """Return the standard deviation of the round trip."""
    return 1e-3 * math.hypot(step.uplink.jitter_ms, step.downlink.jitter_ms)


WARNINGS: Final = without_margins, held_by_links
