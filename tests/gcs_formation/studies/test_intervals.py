"""Intervals of shares by clusters of flights: what the clusters are, and how often the interval covers the share."""

from typing import Any

import numpy as np
import pytest
from scipy.special import betaincinv

from gcs_formation.studies.campaign import judge
from gcs_formation.studies.ended_flights import flights_of
from gcs_formation.studies.intervals import SIDE, Chance, by_cluster, clusters_of, share_interval
from gcs_formation.studies.plan import Plan, samples
from gcs_formation.studies.preparation import load_study

SCENARIO: Any = {"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
DELAY, LOSS = "links.default.delay_ms", "links.default.loss"
FAR: Any = {"metric": "min_separation_m", "above": 10, "share": 0.5}
DRAWN = {"parameters": {DELAY: {"uniform": [0, 300]}}, "design": "latin_hypercube", "samples": 8}
CONFIDENCE = 0.95


def study(**keys):
    return load_study({"base": SCENARIO, "metrics": ["min_separation_m"], "expect": [FAR], **keys})[0]


def rows_of(planned, kept):
    """Return rows of a study's flights, of which those keep the bound that `kept` says, by sample and seed."""
    found, each = [], planned.seeds.count
    for planned_flight in Plan(planned).first_flights():
        sample, seed = divmod(planned_flight.flight, each)
        far = 20.0 if kept(sample, seed) else 0.0
        found.append({"flight": planned_flight.flight, "seed": planned_flight.seed, **planned_flight.parameters,
                      "min_separation_m": far, "exit": 0, "digest": f"{sample}-{seed}"})  # fmt: skip
    return found


def test_seeds_of_a_drawn_sample_that_agree_say_as_much_as_one_flight():
    """80 flights, of which 70 keep the bound: all seeds of one sample of eight break it."""
    planned = study(**DRAWN, seeds={"count": 10})
    rows = rows_of(planned, lambda sample, _: sample > 0)
    verdict = judge(planned, planned.expect[0], rows)
    eight = share_interval([(1, 1)] * 7 + [(0, 1)], CONFIDENCE)
    assert verdict.interval == pytest.approx(eight, abs=0.03)
    independent = share_interval([(1, 1)] * 70 + [(0, 1)] * 10, CONFIDENCE)
    assert independent[0] - eight[0] > 0.2
    assert "70 of 80 flights (95% confidence, by 8 samples: " in str(verdict)
    entry = verdict.to_dict()
    assert (entry["interval_of"]["by"], entry["interval_of"]["clusters"]) == ("sample", 8)
    assert "same seeds" in entry["interval_of"]["method"]


def test_seeds_of_a_sample_that_differ_by_chance_alone_say_nearly_as_much_as_independent_flights():
    random = np.random.default_rng(1).random((40, 10)) < 0.8
    planned = study(**{**DRAWN, "samples": 40}, seeds={"count": 10})
    verdict = judge(planned, planned.expect[0], rows_of(planned, lambda sample, seed: random[sample, seed]))
    kept = int(random.sum())
    low, high = share_interval([(1, 1)] * kept + [(0, 1)] * (400 - kept), CONFIDENCE)
    assert verdict.interval is not None
    assert high - low < verdict.interval[1] - verdict.interval[0] < 1.4 * (high - low)


@pytest.mark.parametrize(
    ("keys", "unit", "clusters"),
    [
        ({"parameters": {DELAY: [0, 100, 200]}, "seeds": {"count": 5}}, "seed", 5),
        (
            {"parameters": {DELAY: [0, 100], LOSS: [0, 0.1]}, "design": "one_at_a_time", "seeds": {"count": 4}},
            "seed",
            4,
        ),
        ({"parameters": {DELAY: {"uniform": [0, 9]}}, "seeds": {"count": 6}}, "seed", 6),
        ({"parameters": {DELAY: {"uniform": [0, 9]}, LOSS: [0, 0.1]}}, "flight", 2),
        ({**DRAWN, "seeds": {"count": 3}}, "sample", 8),
        ({"parameters": {DELAY: [0, 100]}, "design": "random", "samples": 6, "seeds": {"count": 2}}, "sample", 6),
        ({"base": {}, "random": "usual", "seeds": {"count": 7}}, "seed", 7),
    ],
)
def test_what_is_random_is_what_flights_are_clustered_by(keys: dict[str, Any], unit: str, clusters: int):
    planned = study(**keys)
    rows = rows_of(planned, lambda *_: True)
    chance = Chance.of(planned, rows)
    assert (chance.unit, chance.exact) == (unit, "")
    assert len(np.unique(clusters_of(planned, rows))) == clusters
    assert len(judge(planned, planned.expect[0], rows).clusters) == clusters
    assert np.array_equal(flights_of(planned, rows).clusters, clusters_of(planned, rows))


def test_each_step_of_a_search_is_in_its_sample_s_cluster():
    search = {"parameter": LOSS, "low": 0, "high": 0.5, "tolerance": 0.1, "metric": "min_separation_m", "above": 1}
    planned = study(**{**DRAWN, "samples": 2}, seeds={"count": 2}, bisect=search)
    steps = planned.flights_of_a_sample
    rows: Any = [{"flight": flight, "seed": 1} for flight in (0, 1, steps - 1, steps, 2 * steps - 1)]
    assert clusters_of(planned, rows).tolist() == [0, 0, 0, 1, 1]
    assert len(samples(planned)) == 2


def test_drawn_samples_have_an_interval_even_if_seeds_change_nothing():
    planned = study(**DRAWN, seeds={"count": 3})
    rows = [{**row, "digest": str(row[DELAY])} for row in rows_of(planned, lambda *_: True)]
    low, high = judge(planned, planned.expect[0], rows).interval or (0.0, 0.0)
    assert low == pytest.approx(share_interval([(1, 1)] * 8, CONFIDENCE)[0], abs=0.15)
    assert high == 1.0


def test_clusters_of_one_are_between_clopper_and_pearson_s_interval_and_jeffreys():
    """Both by their beta quantiles: x and n - x + 1, or x + 1/2 and n - x + 1/2; ours lies at SIDE."""
    for kept, flights in ((7, 8), (50, 100), (396, 400)):
        low, high = share_interval([(1, 1)] * kept + [(0, 1)] * (flights - kept), CONFIDENCE)
        lows = [float(betaincinv(kept + one, flights - kept + 1 - one, 0.025)) for one in (0, SIDE, 0.5)]
        highs = [float(betaincinv(kept + 1 - one, flights - kept + one, 0.975)) for one in (0.5, SIDE, 0)]
        assert lows[0] < low < lows[2]
        assert highs[0] < high < highs[2]
        assert (low, high) == pytest.approx((lows[1], highs[1]), abs=2e-3)


def test_an_interval_of_nothing_or_of_all_goes_to_the_end():
    assert share_interval([(3, 3)] * 8, CONFIDENCE)[1] == 1.0
    assert share_interval([(0, 3)] * 8, CONFIDENCE)[0] == 0.0
    assert share_interval([(0, 3)] * 8, CONFIDENCE)[1] == pytest.approx(1 - share_interval([(3, 3)] * 8, 0.95)[0])


def test_clusters_may_have_any_size():
    assert by_cluster(np.array([True, False, True, True]), np.array([7.0, 3.0, 7.0, 3.0])) == [(1, 2), (2, 2)]
    low, high = share_interval([(1, 1), (2, 2), (5, 9), (0, 1), (900, 1000)], CONFIDENCE)
    assert 0.0 < low < 0.9 < high < 1.0


def coverage(count: int, size: int, share: float, correlation: float, *, flown: int, like: str = "beta") -> float:
    """Return how often the interval covers the share, of `count` clusters of `size` flights, `flown` times.

    `like`: how flights of a cluster agree: by a share of their own (beta), or because some are copies of one (copies).
    """
    random = np.random.default_rng([count, size, int(1000 * share), int(1000 * correlation)])
    if correlation == 0.0:
        kept = random.binomial(size, share, (flown, count))
    elif correlation == 1.0:
        kept = size * random.binomial(1, share, (flown, count))
    elif like == "beta":
        own = random.beta(share * (1 / correlation - 1), (1 - share) * (1 / correlation - 1), (flown, count))
        kept = random.binomial(size, own)
    else:
        copies = random.binomial(size, np.sqrt(correlation), (flown, count))
        kept = copies * (random.random((flown, count)) < share) + random.binomial(size - copies, share)
    outcomes, times = np.unique(np.sort(kept, axis=1), axis=0, return_counts=True)
    ends = np.array([share_interval([(each, size) for each in row], CONFIDENCE) for row in outcomes.tolist()])
    return float(times[(ends[:, 0] <= share) & (share <= ends[:, 1])].sum() / flown)


SHARES = 0.02, 0.1, 0.5, 0.8, 0.95, 0.99
"""Near 0 and 1, and in between."""


@pytest.mark.parametrize("correlation", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("count", [8, pytest.param(100, marks=pytest.mark.slow)])
def test_nominal_95_percent_covers_92_to_98(count, correlation):
    """Over shares, for at one share alone few outcomes are possible: of 50 alike, 0.95 is covered in 91 or 99 %."""
    each = [coverage(count, 10, share, correlation, flown=2000) for share in SHARES]
    assert 0.92 <= np.mean(each) <= 0.982, "8 clusters of independent flights: 98.1 %, as their correlation isn't known"
    assert min(each) >= 0.91


@pytest.mark.slow
@pytest.mark.parametrize("like", ["beta", "copies"])
@pytest.mark.parametrize("size", [2, 10])
@pytest.mark.parametrize("count", [8, 12, 20, 50, 100])
def test_coverage_at_each_share(count, size, like):
    """Flights that copy one of their cluster aren't beta-binomial; rare ones may look independent in 100 clusters."""
    for correlation in (0.0, 0.5) if like == "beta" else (0.5,):
        each = [coverage(count, size, share, correlation, flown=2000, like=like) for share in SHARES]
        assert (0.925 if like == "beta" else 0.84) <= min(each)
        assert max(each) <= 0.998
        assert 0.92 <= np.mean(each) <= 0.985
    all_alike = [coverage(count, size, share, 1.0, flown=2000) for share in (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)]
    assert min(all_alike) >= 0.89
    assert 0.92 <= np.mean(all_alike) <= 0.98
