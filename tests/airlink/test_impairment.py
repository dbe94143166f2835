import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import kstest, truncnorm

from airlink.clock import Instant, after, seconds_between
from airlink.delay_distribution import CDF, QUANTILE
from airlink.endpoint import VehicleId
from airlink.impairment import UNIMPAIRED, Direction, Impairment
from airlink.one_way_channel import Channel
from airlink.random_streams import random_stream

MANY = 100_000
VEHICLE = VehicleId(1, 2)


def channel(seed=1, vehicle=VEHICLE, direction=Direction.DOWNLINK):
    return Channel(random_stream(seed, "links", *vehicle, direction))


def passed(impairment, count, period_s=1.0, size_bytes=50, through=None):
    """Return, for each datagram, when it was sent and when its copies arrived."""
    through = through or channel()
    sent = [after(Instant(0), number * period_s) for number in range(count)]
    return [(now, through.pass_on(size_bytes, now, impairment)) for now in sent]


def delays(impairment, count=MANY):
    return np.array([seconds_between(now, out[0]) for now, out in passed(impairment, count) if out])


def arrivals(impairment, count=MANY):
    return np.array([bool(out) for _, out in passed(impairment, count)])


@given(st.floats(0.0, 600.0), st.integers(0, 10**15))
def test_without_jitter_the_delay_is_exact(delay_s, start):
    out = channel().pass_on(50, Instant(start), Impairment(delay_s=delay_s))
    assert out == [after(Instant(start), delay_s)]


def test_an_unimpaired_link_delivers_at_once():
    assert all(out == [now] for now, out in passed(UNIMPAIRED, 100))


@pytest.mark.parametrize("name", CDF)
def test_every_standard_distribution_has_mean_0_and_standard_deviation_1(name):
    quantile = QUANTILE[name]
    mean = quad(quantile, 1e-15, 1 - 1e-15, limit=500)[0]
    square = quad(lambda share: quantile(share) ** 2, 1e-15, 1 - 1e-15, limit=500)[0]
    assert mean == pytest.approx(0.0, abs=1e-6)
    assert square == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("name", CDF)
@given(share=st.floats(0.001, 0.999))
def test_the_quantile_undoes_the_share(name, share):
    assert CDF[name](QUANTILE[name](share)) == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize("name", ["normal", "uniform", "pareto"])
def test_delays_vary_about_their_mean_by_the_jitter(name):
    sample = delays(Impairment(delay_s=0.2, jitter_s=0.02, distribution=name))
    assert sample.mean() == pytest.approx(0.2, abs=4 * 0.02 / math.sqrt(MANY))
    assert kstest((sample - 0.2) / 0.02, np.vectorize(CDF[name])).pvalue > 0.01
    if name != "pareto":  # pareto has an infinite fourth moment: its sample standard deviation hardly converges
        assert sample.std() == pytest.approx(0.02, abs=4 * 0.02 / math.sqrt(2 * MANY))


def test_the_normal_distribution_is_cut_off_at_no_delay():
    sample = delays(Impairment(delay_s=0.02, jitter_s=0.04))
    expected = truncnorm(-0.5, np.inf, loc=0.02, scale=0.04)
    assert sample.min() >= 0.0
    assert sample.mean() == pytest.approx(expected.mean(), abs=4 * expected.std() / math.sqrt(MANY))
    assert sample.std() == pytest.approx(expected.std(), rel=0.015)
    assert kstest(sample, expected.cdf).pvalue > 0.01


@given(
    st.sampled_from(["normal", "uniform", "pareto"]),
    st.floats(0, 10),
    st.floats(0, 10),
    st.floats(0, 1, exclude_max=True),
)
def test_no_delay_is_negative(name, delay_s, jitter_s, share):
    delay_s = Impairment(delay_s=delay_s, jitter_s=jitter_s, distribution=name).delays.quantile_s(share)
    assert 0.0 <= delay_s < math.inf


def test_independent_losses_are_as_many_as_asked_for():
    came = arrivals(Impairment(loss=0.1))
    assert came.mean() == pytest.approx(0.9, abs=4 * math.sqrt(0.09 / MANY))
    after_a_loss = came[1:][~came[:-1]]
    assert after_a_loss.mean() == pytest.approx(0.9, abs=4 * math.sqrt(0.09 / len(after_a_loss)))


def bursts(came):
    edges = np.flatnonzero(np.diff(np.concatenate([[True], came, [True]]).astype(int)))
    return edges[1::2] - edges[::2]


@pytest.mark.parametrize(("loss", "mean_burst"), [(0.05, 1.0), (0.1, 4.0), (0.3, 10.0)])
def test_bursts_are_as_long_and_losses_as_many_as_asked_for(loss, mean_burst):
    came = arrivals(Impairment(loss=loss, mean_burst=mean_burst))
    lengths = bursts(came)
    sd = math.sqrt(mean_burst * (mean_burst - 1))  # of a geometric distribution
    assert lengths.mean() == pytest.approx(mean_burst, abs=4 * sd / math.sqrt(len(lengths)) + 1e-12)
    assert 1 - came.mean() == pytest.approx(loss, abs=4 * math.sqrt(2 * mean_burst * loss / MANY))


def test_more_than_half_lost_makes_longer_bursts_than_asked_for():
    came = arrivals(Impairment(loss=0.9, mean_burst=2.0))
    assert 1 - came.mean() == pytest.approx(0.9, abs=0.01)
    assert bursts(came).mean() == pytest.approx(9.0, rel=0.05)


@pytest.mark.parametrize(
    "impairment", [Impairment(loss=1.0), Impairment(outage=True), Impairment(loss=1.0, mean_burst=3.0)]
)
def test_nothing_comes_through_a_dead_link(impairment):
    assert not arrivals(impairment, 1000).any()


def test_duplicates_have_delays_of_their_own():
    out = [copies for _, copies in passed(Impairment(0.2, 0.02, duplicate=0.25), MANY)]
    twice = [copies for copies in out if len(copies) == 2]
    assert len(twice) / MANY == pytest.approx(0.25, abs=4 * math.sqrt(0.25 * 0.75 / MANY))
    assert all(first < second for first, second in twice)


@given(st.integers(0, 50), st.floats(0.0, 0.5))
def test_order_is_kept_where_datagrams_may_not_overtake(seed, duplicate):
    held = Impairment(0.1, 0.1, duplicate=duplicate, reorder=False)
    out = [i for _, copies in passed(held, 200, 0.01, through=channel(seed)) for i in copies]
    assert out == sorted(out)
    free = [copies[-1] for _, copies in passed(replace(held, reorder=True), 200, 0.01, through=channel(seed))]
    assert free != sorted(free)


def test_a_link_whose_delay_ends_keeps_the_order_of_what_is_under_way():
    through = channel()
    first, second = Instant(0), after(Instant(0), 0.01)
    assert through.pass_on(50, first, Impairment(0.3)) == [after(first, 0.3)]
    assert through.pass_on(50, second, Impairment()) == [after(first, 0.3)]
    assert through.pass_on(50, second, Impairment(reorder=True)) == [second]


def test_a_limited_rate_spaces_datagrams_by_their_length():
    out = [copies[0] for _, copies in passed(Impairment(rate_bps=8000.0, queue_s=1e9), 1000, 0.0, 125)]
    assert out == [after(Instant(0), 0.125 * number) for number in range(1, 1001)]


def test_a_full_queue_drops_and_the_rate_is_used_up():
    """20 datagrams of 50 bytes per second over 4000 bit/s, which carry 10 per second."""
    through = channel()
    out = passed(Impairment(delay_s=0.3, rate_bps=4000.0, queue_s=0.5), 1000, 0.05, 50, through)
    assert through.statistics.loss == pytest.approx(0.5, abs=0.01)
    delay = [seconds_between(now, copies[0]) for now, copies in out if copies]
    assert max(delay) <= 0.3 + 0.5 + 0.1 + 1e-9
    assert min(delay) == pytest.approx(0.4)
    assert delay[-1] > 0.8


def test_a_rate_that_suffices_only_adds_the_time_of_transmission():
    through = channel()
    passed(Impairment(rate_bps=57600.0), 1000, 0.1, 72, through)
    assert through.statistics.loss == 0.0
    assert through.statistics.mean_delay_s == pytest.approx(0.01)


def test_the_statistics_are_those_of_what_came_out():
    through = channel()
    out = passed(Impairment(0.2, 0.05, loss=0.1, duplicate=0.1), 5000, through=through)
    realised = [seconds_between(now, copy) for now, copies in out for copy in copies]
    assert through.statistics.datagrams == 5000
    assert through.statistics.lost == sum(not copies for _, copies in out)
    assert through.statistics.delivered == len(realised)
    assert through.statistics.mean_delay_s == pytest.approx(np.mean(realised))


def test_nothing_passed_has_no_mean_delay():
    assert math.isnan(channel().statistics.mean_delay_s)
    assert channel().statistics.loss == 0.0


JITTERY = Impairment(0.2, 0.05, loss=0.2, duplicate=0.1)


def test_the_same_seed_and_link_repeat_themselves():
    assert passed(JITTERY, 500) == passed(JITTERY, 500)


def test_every_link_and_direction_and_seed_has_numbers_of_its_own():
    links = [
        channel(),
        channel(direction=Direction.UPLINK),
        channel(seed=2),
        channel(vehicle=VehicleId(1, 3)),
        channel(vehicle=VehicleId(2, 2)),
    ]
    jitter = Impairment(delay_s=1.0, jitter_s=0.1)
    samples = np.array([[out[0] - now for now, out in passed(jitter, 4000, through=link)] for link in links])
    assert np.abs(np.corrcoef(samples) - np.eye(len(links))).max() < 4 / math.sqrt(4000)


@given(
    st.lists(
        st.sampled_from([UNIMPAIRED, JITTERY, Impairment(loss=0.5, mean_burst=3.0), Impairment(outage=True)]),
        max_size=600,
    )
)
def test_a_datagrams_random_numbers_do_not_depend_on_earlier_impairments(history):
    through, undisturbed = channel(), channel()
    for number, impairment in enumerate(history):
        through.pass_on(50, Instant(number), impairment)
        undisturbed.pass_on(50, Instant(number), UNIMPAIRED)
    now = after(Instant(0), 1000.0)
    assert through.pass_on(50, now, JITTERY) == undisturbed.pass_on(50, now, JITTERY)


def test_a_longer_delay_delays_the_same_datagrams_by_as_much_more():
    short = passed(Impairment(0.5, 0.02, loss=0.2), 1000)
    long = passed(Impairment(0.8, 0.02, loss=0.2), 1000)
    assert [len(out) for _, out in short] == [len(out) for _, out in long]
    more = [after(a[0], 0.3) - b[0] for (_, a), (_, b) in zip(short, long, strict=True) if a]
    assert max(map(abs, more)) <= 2
