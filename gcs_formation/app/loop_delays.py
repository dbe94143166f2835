"""Delays of the law's loops over a scenario's links: by delay and by losses."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation_scenario import Scenario
from formation_scenario.links import Impairment, LinkStep
from formation_scenario.mean_delays import mean_delays_s
from formation_scenario.slot_assignment import planned_slots
from gcs_formation.control.laws import law_kind

NO_LOSS = 0.5
"""Mean age of the newest periodic message, in periods, without loss."""


def message_age(link: Impairment) -> tuple[float, float]:
    """Return mean and variance of the newest message's age, in periods, over a lossy link, without its delay.

    Messages are lost by Gilbert's two-state channel; both are infinite where nothing arrives.
    Let N be the periods from one message that arrives to the next. The age has the mean E[N^2]/(2 E[N]) and the mean
    square E[N^3]/(3 E[N]). With the probability g = loss/(b (1 - loss)) a run of losses follows an arrival; its length
    is geometric with the mean b, so that E[N] = 1 + g b, E[N^2] = 1 + g (b + 2 b^2) and E[N^3] = 1 + g (b + 6 b^3).
    With independent losses b = 1/(1 - loss), and the mean is (1 + loss)/(2 (1 - loss)). Without loss: 1/2 and 1/12.
    """
    if link.outage or link.loss >= 1.0:
        return math.inf, math.inf
    odds = link.loss / (1.0 - link.loss)
    b = 1.0 + odds if link.mean_burst is None else max(link.mean_burst, odds, 1.0)
    mean = 1.0 + odds
    square, cube = (1.0 + odds / b * each for each in (b + 2.0 * b**2, b + 6.0 * b**3))
    mean_age = square / (2.0 * mean)
    return mean_age, cube / (3.0 * mean) - mean_age**2


class Hold(NamedTuple):
    """How long a setpoint is held on average until the next one comes, s."""

    mean_s: float
    ticks: float
    loss: float
    """Share of the setpoints that are lost."""

    def __str__(self) -> str:
        lossy = f" ({self.loss:.0%} of them are lost)" if self.loss else ""
        return f"setpoints are held for {self.mean_s:.3g} s on average{lossy}"


def configured_loop_delay_s(scenario: Scenario, *, lossy: bool = False) -> float:
    """Return the longest loop delay, s, that the scenario's links cause at any time of the run.

    Under a mutual law every loop waits for the latest state of all vehicles. `lossy` adds the mean age that losses
    cause; links on which nothing arrives are left out.
    """
    sample_s, tick_s = 1.0 / scenario.telemetry.rate_hz, 1.0 / scenario.law.rate_hz
    delays = [(NO_LOSS * tick_s, NO_LOSS * sample_s)]
    for step in commanded_steps(scenario):
        (up_s, down_s), (held, age) = mean_delays_s(scenario, step), _mean_ages(step) if lossy else (NO_LOSS, NO_LOSS)
        if math.isfinite(held + age):
            delays.append((up_s + held * tick_s, down_s + age * sample_s))
    if law_kind(scenario).mutual:
        return max(up_s for up_s, _ in delays) + max(down_s for _, down_s in delays)
    return max(up_s + down_s for up_s, down_s in delays)


def longest_hold(scenario: Scenario) -> Hold:
    """Return the longest mean hold of a setpoint over any link of a vehicle that the law commands."""
    holds = [Hold(NO_LOSS / scenario.law.rate_hz, NO_LOSS, 0.0)]
    for step in commanded_steps(scenario):
        held, _ = _mean_ages(step)
        if math.isfinite(held):
            holds.append(Hold(held / scenario.law.rate_hz, held, step.uplink.loss))
    return max(holds)


def commanded_steps(scenario: Scenario) -> list[LinkStep]:
    """Return the link steps of all vehicles that the law commands."""
    mutual = law_kind(scenario).mutual
    following = {} if mutual else planned_slots(scenario)
    flown = (vehicle for vehicle in scenario.vehicles if mutual or vehicle.vehicle_id in following)
    return [step for vehicle in flown for step in scenario.all_link_steps(vehicle)]


def _mean_ages(step: LinkStep) -> tuple[float, float]:
    return message_age(step.uplink)[0], message_age(step.downlink)[0]
