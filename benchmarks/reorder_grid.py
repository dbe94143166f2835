"""Mean delay of datagrams that keep their order, beside those that may overtake, in one direction of a link."""

from __future__ import annotations

import numpy as np

from airlink.clock import Instant, after
from airlink.delay_distribution import Distribution
from airlink.impairment import Impairment
from airlink.one_way_channel import Channel
from gcs_formation.studies.markdown import markdown

DELAY_S = 0.150
JITTERS_S = (0.005, 0.020, 0.050)
RATES_HZ = (4.0, 40.0, 200.0)
DISTRIBUTIONS: tuple[Distribution, ...] = ("normal", "uniform", "pareto")
DURATION_S = 1000.0


def mean_s(impairment: Impairment, rate_hz: float) -> float:
    """Return the realised mean delay of datagrams sent at even intervals, s."""
    channel = Channel(np.random.Generator(np.random.Philox(1)))
    for number in range(int(DURATION_S * rate_hz)):
        channel.pass_on(50, after(Instant(0), number / rate_hz), impairment)
    return channel.statistics.mean_delay_s


def main() -> None:
    """Print the table."""
    head = ("jitter, ms", "distribution", "may overtake, ms", *(f"in order at {rate:g}/s, ms" for rate in RATES_HZ))
    rows: list[list[str]] = []
    for distribution in DISTRIBUTIONS:
        for jitter_s in JITTERS_S:
            free = Impairment(DELAY_S, jitter_s, distribution, reorder=True)
            held = Impairment(DELAY_S, jitter_s, distribution)
            means = [mean_s(free, RATES_HZ[1]), *(mean_s(held, rate_hz) for rate_hz in RATES_HZ)]
            rows.append([f"{1e3 * jitter_s:g}", distribution, *(f"{1e3 * each:.1f}" for each in means)])
    print(markdown(head, rows))


if __name__ == "__main__":
    main()
