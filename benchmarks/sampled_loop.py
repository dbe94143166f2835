"""Delay margins of the sampled laws, as flown, beside those computed in continuous time.

The linear loop along the path around one follower, exactly sampled: plant (7) between ticks in closed form, setpoints
held, and a delay from the state that a tick uses until its setpoint acts. The margin is the delay at which an
eigenvalue of the step from tick to tick leaves the unit circle; half a tick is added, as `loop_delay_s` counts it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from flight_model.arrays import Array
from formation_scenario import Scenario, load_scenario
from gcs_formation.control.fuzzy_pid import PidGains
from gcs_formation.control.laws import gain_range, nominal_gains
from gcs_formation.control.setpoint import Mixer
from gcs_formation.stability import consensus_delay_margin
from gcs_formation.stability.pid_margins import SMALL_SIGNAL, forward_plant, loop_margin
from gcs_formation.studies.markdown import markdown

RATES_HZ = (2.5, 5.0, 5.1, 10.0, 20.0, 50.0)
LONGEST_S = 2.0
KEYS = {"vehicles": {"count": 3}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}


class SampledLaw(NamedTuple):
    """A law's step at a tick, for w = (forward error, airspeed, setpoint in effect), the latter two minus the leader's.

    With a memory m of any size, the setpoint is u = says_kept . m + says . w, and the memory m' = kept m + takes w.
    """

    kept: Array
    takes: Array
    says_kept: Array
    says: Array


def pid(gains: PidGains, mixer: Mixer, tau_s: float, tick_s: float, filter_keeps: float) -> SampledLaw:
    """Return the law of `control.follower`, at frozen gains; m = (filtered rate, integral)."""
    error = np.array((mixer.k_x, -mixer.k_v, 0.0))
    # The rate at which (7) moves at the end of the tick, under the setpoint in effect.
    effective_tau_s = -tick_s / math.expm1(-tick_s / tau_s) - tick_s
    slope = np.array((0.0, mixer.k_v / effective_tau_s - mixer.k_x, -mixer.k_v / effective_tau_s))
    new = (1.0 - filter_keeps) * slope
    return SampledLaw(
        np.diag((filter_keeps, 1.0)),
        np.stack((new, gains.ki * tick_s * error)),
        np.array((gains.kd * filter_keeps, 1.0)),
        gains.kp * error + gains.kd * new,
    )


def consensus(scenario: Scenario, tau_s: float) -> SampledLaw:
    """Return protocol (3) in the mode of its largest eigenvalue; it has no memory."""
    law, weights = scenario.law.consensus, scenario.adjacency
    largest = float(np.linalg.eigvals(np.diag(weights.sum(axis=1)) - weights).real.max())
    says = tau_s * np.array((largest * law.k1, 1.0 / tau_s - law.k3 - largest * law.k2, 0.0))
    return SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), says)


def radius(law: SampledLaw, tau_s: float, tick_s: float, delay_s: float) -> float:
    """Return the largest eigenvalue of the step from tick to tick, of plant, memory and setpoints in transit."""
    whole = int(delay_s // tick_s)
    memory, waiting = len(law.kept), whole + 1
    size = 2 + memory + waiting
    each = np.eye(size)
    plant, kept, sent = each[:2], each[2 : 2 + memory], each[2 + memory :]  # the last setpoint first
    acts = sent[whole]
    seen = np.stack((*plant, acts))
    says = law.says_kept @ kept + law.says @ seen
    late_s = delay_s - whole * tick_s
    fresh = says if whole == 0 else sent[whole - 1]
    moved = _fly(_fly(plant, acts, tau_s, late_s), fresh, tau_s, tick_s - late_s)
    step = np.concatenate((moved, law.kept @ kept + law.takes @ seen, says[None], sent[:-1]))
    return float(np.abs(np.linalg.eigvals(step)).max())


def _fly(state: Array, setpoint: Array, tau_s: float, time_s: float) -> Array:
    """Return forward error and airspeed after a setpoint was held for a time, as combinations of the loop's states."""
    rates = np.array(((0.0, -1.0, 0.0), (0.0, -1.0 / tau_s, 1.0 / tau_s), (0.0, 0.0, 0.0)))
    return expm(rates * time_s)[:2] @ np.stack((*state, setpoint))


def margin(law: SampledLaw, tau_s: float, tick_s: float) -> float:
    """Return the delay at which the loop becomes unstable, counted as the station does."""
    beyond: Callable[[float], float] = lambda delay_s: radius(law, tau_s, tick_s, delay_s) - 1.0  # noqa: E731
    tried = np.arange(0.0, LONGEST_S, 0.02)
    first = next(i for i, delay_s in enumerate(tried) if beyond(float(delay_s)) > 0.0)
    return float(brentq(beyond, tried[first - 1], tried[first])) + tick_s / 2.0


def main() -> None:
    """Print the table."""
    fuzzy = load_scenario(KEYS)
    mutual = load_scenario(KEYS, ("law.type=consensus",))
    model, mixer = fuzzy.vehicles[0].model, Mixer(**fuzzy.law.mixer.model_dump())
    nominal = nominal_gains(fuzzy)[0]
    gains = gain_range(fuzzy).gains(nominal, SMALL_SIGNAL)
    computed = loop_margin(nominal, forward_plant(mixer, model), gain_range(fuzzy))
    protocol = mutual.law.consensus
    agreed = consensus_delay_margin(mutual.adjacency, protocol.k1, protocol.k2, protocol.k3)
    rows: list[list[str]] = []
    for rate_hz in RATES_HZ:
        tick_s = 1.0 / rate_hz
        flown = math.exp(-tick_s / gains.filter_s)
        as_continuous = gains.filter_s / (gains.filter_s + tick_s)
        laws = [pid(gains, mixer, model.tau_v_s, tick_s, keeps) for keeps in (flown, as_continuous)]
        found = [margin(law, model.tau_v_s, tick_s) for law in (*laws, consensus(mutual, model.tau_v_s))]
        rows.append([f"{rate_hz:g}", *(f"{each:.3f}" for each in (computed, *found[:2], agreed, found[2]))])
    heads = [
        "law, Hz", "fuzzy PID: computed, s", "in ticks, s", "and its filter lagging as continuous, s",
        "consensus, star of three: computed, s", "in ticks, s",
    ]  # fmt: skip
    print(markdown(heads, rows))


if __name__ == "__main__":
    main()
