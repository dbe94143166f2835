"""What `check` says about the law: states of different times, and slow loops."""

from __future__ import annotations

import math
from collections.abc import Iterator
from operator import itemgetter
from typing import Any

import numpy as np

from flight_model.frequency_response import FREQUENCIES
from formation_scenario import Scenario
from formation_scenario.gains import AUTO, by_design, design_delay_s, designed
from formation_scenario.links import Impairment, LinkStep
from formation_scenario.mean_delays import mean_delays_s, since
from formation_scenario.planned_progress import planned_end_s
from gcs_formation.app.check_links import MIN_M, PLANES_MAX_HZ
from gcs_formation.app.loop_delays import message_age
from gcs_formation.control.laws import law_kind
from gcs_formation.stability import law_loops

UNPAIRED_M = 1.75
"""Apparent offset along the path, standard deviation, from which states of different times are worth a warning."""
SLOW_S = 30.0
"""Longest acceptable time constant of a loop's error: 14 % of an error are left after a minute."""
FASTER_HZ = 5.0, 10.0, 20.0
"""Values of law.rate_hz that are tried where gains by design are slow."""


def ahead_of_virtual(scenario: Scenario) -> str | None:
    """Return how far ahead of their slots followers of a virtual leader fly without prediction; None if not.

    Their positions are as old as their telemetry; the virtual leader's isn't, because the station computes it. A real
    leader's position is as old as theirs.
    """
    if scenario.leader is not None or scenario.law.delay_compensation or law_kind(scenario).mutual:
        return None
    steps = [
        (mean_delays_s(scenario, step)[1], step.at_s, each)
        for each in scenario.followers
        for step in scenario.link_steps(each)
    ]
    down_s, at_s, vehicle = max(steps, key=lambda step: step[0])
    speed_mps, between_s = scenario.path.begin_mps, 1.0 / scenario.telemetry.rate_hz
    min_m, max_m = speed_mps * down_s, speed_mps * (down_s + between_s)
    if max_m < MIN_M:
        return None
    lossy = any(step.downlink.loss for step in scenario.link_steps(vehicle))
    why = f"the delay down its link and up to 1/telemetry.rate_hz{', longer after a loss' if lossy else ''}"
    age = f"{down_s:.3g} to {down_s + between_s:.3g} s old{since(at_s)} ({why})"
    ahead = f"{min_m:.2g} to {max_m:.2g} m ahead of its slot at {speed_mps:g} m/s"
    return (
        "law.delay_compensation: found false, with a virtual leader, whose place is of now; that of vehicle "
        f"{vehicle.vehicle_id} is {age}, so it flies {ahead}: true predicts over that, and a real leader's is as old"
    )


def of_different_instants(scenario: Scenario) -> str | None:
    """Return the error that comes from comparing leader and follower states of different times, without prediction.

    The law then takes the newest states as they are. Their ages differ at random: each is uniform within a telemetry
    period if nothing is lost, and grows by whole periods with losses. In flights at 2 and 4 Hz formations were off by
    up to 0.4 to 1.4 such standard deviations; at 10 Hz, or with prediction, by a few tenths of a metre.
    """
    if scenario.leader is None or scenario.law.delay_compensation or law_kind(scenario).mutual:
        return None
    leads = max(_age_variance(step) for step in scenario.link_steps(scenario.leader))
    each = [(_age_variance(step), vehicle) for vehicle in scenario.followers for step in scenario.link_steps(vehicle)]
    variance, vehicle = max(each, key=lambda found: found[0], default=(0.0, None))
    rate_hz, speed_mps, periods = scenario.telemetry.rate_hz, scenario.path.begin_mps, math.sqrt(leads + variance)
    offset_m = speed_mps * periods / rate_hz
    if vehicle is None or offset_m < UNPAIRED_M:
        return None
    enough_hz = math.ceil(10.0 * speed_mps * periods / UNPAIRED_M) / 10.0
    enough = (
        f"; telemetry.rate_hz of {enough_hz:g} or more leaves {UNPAIRED_M:g} m" if enough_hz <= PLANES_MAX_HZ else ""
    )
    lossy = ", of which some is lost," if leads + variance > 2.0 * message_age(Impairment())[1] else ""
    return (
        f"law.delay_compensation: found false; at telemetry.rate_hz {rate_hz:g}{lossy} the newest states of the leader "
        f"and of vehicle {vehicle.vehicle_id} are of instants {periods / rate_hz:.2g} s apart (standard deviation), "
        f"which looks like {offset_m:.2g} m along the path at {speed_mps:g} m/s: it may be as far off; true takes both "
        f"at one instant{enough}"
    )


def _age_variance(step: LinkStep) -> float:
    """Return the variance of a state's age, in periods; 0 over a link on which nothing arrives."""
    _, variance = message_age(step.downlink)
    return variance if math.isfinite(variance) else 0.0


def slow_answer(scenario: Scenario) -> str | None:
    """Return that the law reduces errors too slowly, how much is left at the end, and what is faster; None if not.

    Time constants are those of the consensus protocol's slowest mode, or of a PID channel's crossover. Aircraft with an
    airframe model count as equation (7): they answer alike at such low frequencies.
    """
    loop, time_s = max(_answers_s(scenario), key=lambda each: each[1], default=("", 0.0))
    if not SLOW_S < time_s < math.inf:
        return None
    flown_s = planned_end_s(scenario)
    protocol, speeds = scenario.law.consensus, "consensus" if law_kind(scenario).mutual else f"loop {loop}"
    whose = f"law.{speeds}: found k1 {protocol.k1:.2g}" if law_kind(scenario).mutual else f"{speeds}"
    left = f"of an error {math.exp(-flown_s / time_s):.0%} is left when the flight is over at {flown_s:.4g} s"
    lasting = f"a speed that is 0.1 m/s off leaves {0.1 * time_s:.2g} m"
    return f"{whose}: errors take {time_s:.0f} s to get e times smaller, {left}, and {lasting}{_faster(scenario)}"


def _answers_s(scenario: Scenario) -> Iterator[tuple[str, float]]:
    """Yield each loop of the law with the time in which its error falls to 1/e; infinite if unstable."""
    found = {each for axes in law_loops(scenario).values() for each in axes.items()}
    for name, loop in ((name, loop) for name, loops in sorted(found, key=itemgetter(0)) for loop in loops):
        if law_kind(scenario).mutual:
            slowest = float(loop.open_loop().closed_loop_poles().real.max())
            yield name, -1.0 / slowest if slowest < 0.0 else math.inf
        elif name != "z":
            size = np.abs(loop.open_loop().at(FREQUENCIES))
            yield name, 1.0 / float(FREQUENCIES[size >= 1.0].max(initial=FREQUENCIES[0]))


def _faster(scenario: Scenario) -> str:
    """Return in words what would make a law with gains by design faster; "" for other gains or if nothing would."""
    law = scenario.law
    if law.gains != AUTO or designed(scenario, {}).law.consensus != law.consensus:
        return ""
    why = f"; by design, at law.rate_hz {law.rate_hz:g} and links of {1e3 * design_delay_s(scenario):.0f} ms each way"
    changes: list[tuple[str, Any]] = [("rate_hz", hz) for hz in FASTER_HZ if hz > law.rate_hz]
    for key, value in (*changes, ("type", "pid")):
        tried = designed(scenario.model_copy(update={"law": law.model_copy(update={key: value})}), {})
        time_s = max((each for _, each in _answers_s(tried)), default=math.inf)
        if time_s <= SLOW_S and getattr(law, key) != value:
            return f"{why}; law.{key} of {value} takes {time_s:.0f} s"
    return why


def has_designed_gains(scenario: Scenario) -> bool:
    """Return whether the law has PID channels whose gains' figures are known."""
    return law_kind(scenario).has_margins and by_design(scenario)
