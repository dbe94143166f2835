"""What `check` says about recorded delays: longer than telemetry may be old, and without times."""

from __future__ import annotations

from collections.abc import Iterator

from formation_scenario import Scenario
from formation_scenario.traces.keys import Trace


def recorded_delays(scenario: Scenario) -> Iterator[str]:
    """Yield records with delays beyond `law.max_age_s`, with the constant delay, and those that don't say when."""
    constant_ms = dict[Trace, float]()
    for vehicle in scenario.vehicles:
        for step in scenario.link_steps(vehicle):
            for each in (step.uplink, step.downlink):
                if each.recording is not None:
                    constant_ms[each.recording] = max(each.delay_ms, constant_ms.get(each.recording, 0.0))
    for trace, delay_ms in constant_ms.items():
        found, max_s = scenario.recorded_delays(trace), scenario.law.max_age_s
        delays_s = [(each + delay_ms) / 1e3 for each in found.arrived_ms]
        share = sum(each > max_s for each in delays_s) / len(delays_s)
        if share > 0.0:
            yield (
                f"{trace.file}: {share:.1%} of its delays are longer than law.max_age_s, {max_s:g} s, up to "
                f"{max(delays_s):.3g} s: a vehicle whose telemetry is that old isn't flown in the formation"
            )
        if not found.timed:
            yield (
                f"{trace.file}: doesn't say when each delay was measured; {found.period_s:g} s from one to the next is "
                f"assumed (trace: {{file: …, period_s: …}})"
            )
