"""Mean delays of a scenario's links, and from when on they count."""

from __future__ import annotations

from formation_scenario.links import Impairment, LinkStep
from formation_scenario.model import Scenario


def mean_delays_s(scenario: Scenario, step: LinkStep) -> tuple[float, float]:
    """Return the mean delays up and down, s; recorded delays are added to the constant one."""

    def mean_s(impairment: Impairment) -> float:
        trace = impairment.recording
        recorded_ms = 0.0 if trace is None else scenario.recorded_delays(trace).mean_ms
        return (impairment.delay_ms + recorded_ms) / 1e3

    return mean_s(step.uplink), mean_s(step.downlink)


def since(at_s: float, comma: str = "") -> str:
    """Return in words from when on a link's step counts, after `comma`; "" from the beginning."""
    return f"{comma} from {at_s:g} s on" if at_s else ""
