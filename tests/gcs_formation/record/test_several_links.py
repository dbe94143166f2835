"""What the record has of vehicles with several links."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant
from gcs_formation.record.link_verdicts import LinkFigures
from gcs_formation.record.several_links import OneLink, number_at, together, used_s, with_several_links

USES = [(Instant(0), 1), (Instant(10 * NANOSECONDS), 2), (Instant(14 * NANOSECONDS), 1)]


def one(number: int, delay_s: float, loss: float, used: float) -> OneLink:
    probed = np.arange(0.0, 20.0) * NANOSECONDS
    delays = np.column_stack([np.full(20, delay_s), np.full((20, 2), np.nan)])
    figures = LinkFigures(
        delays, probed / NANOSECONDS, loss, 10, 20, 0, injected=(delay_s,) * 2 + (loss,) * 2, probed_ns=probed
    )
    return OneLink(number, f"udpin:127.0.0.1:{number}", used, 0.001, figures)


def test_the_time_in_use_of_each_link() -> None:
    assert used_s(USES, Instant(20 * NANOSECONDS)) == {1: 16.0, 2: 4.0}
    assert list(number_at(USES, np.array([-1.0, 9.9, 10.0, 13.9, 14.0]) * NANOSECONDS)) == [1, 1, 2, 2, 1]


def test_a_vehicle_s_figures_are_of_the_link_in_use() -> None:
    whole = together([one(1, 0.04, 0.0, 16.0), one(2, 0.4, 0.1, 4.0)], USES)
    assert list(whole["delays_s"][:, 0]) == [0.04] * 10 + [0.4] * 4 + [0.04] * 6
    assert list(whole["delay_times_s"]) == list(range(20))
    assert whole["measured_loss"] == pytest.approx(0.02)
    assert whole["injected"] == pytest.approx((0.112, 0.112, 0.02, 0.02))


def test_a_links_entry_in_the_summary_is_in_milliseconds_and_names_what_isnt_known() -> None:
    link = one(2, 0.4, 0.1, 4.0)
    entry = link.to_dict()
    assert entry["measured_delay_ms"] == {"p50": pytest.approx(400.0), "p99": pytest.approx(400.0)}
    assert (entry["measured_up_ms"], entry["measured_down_ms"]) == (None, None), "the split isn't known"
    assert [entry[f"injected_{each}_ms"] for each in ("delay", "up", "down")] == pytest.approx([400.0] * 3)
    assert (entry["link"], entry["used_s"], entry["jitter_ms"], entry["measured_loss"]) == (2, 4.0, 1.0, 0.1)
    unknown = replace(link, jitter_s=math.nan, figures=replace(link.figures, injected=None)).to_dict()
    assert (unknown["jitter_ms"], unknown["injected_delay_ms"], unknown["injected_loss"]) == (None, None, None)


def test_where_none_was_in_use_for_any_time_the_first_counts() -> None:
    whole = together([one(1, 0.04, 0.05, 0.0), one(2, 0.4, 0.1, 0.0)], USES[:1])
    assert whole["measured_loss"] == 0.05
    assert whole["injected"] == (0.04, 0.04, 0.05, 0.05)


def test_columns_are_added_only_where_a_vehicle_has_several() -> None:
    blocks = [{"t_s": np.array([[1.0, 1.0], [12.0, 12.0], [25.0, 25.0]])}]
    (same,) = with_several_links(iter(blocks), [None, None])
    assert list(same) == ["t_s"]
    probes = [np.array([[0.9e9, 0.04, 0, 0], [11.9e9, 0.05, 0, 0]]), np.array([[11.0e9, -0.01, 0, 0]])]
    (block,) = with_several_links(iter(blocks), [None, (USES, probes)])
    assert block["link"].T.tolist() == [[1, 1, 1], [1, 2, 1]]
    assert np.isnan(block["link_1_delay_s"][:, 0]).all()
    assert block["link_1_delay_s"][:2, 1].tolist() == [0.04, 0.05]
    assert np.isnan(block["link_1_delay_s"][2, 1]), "measured more than 2 s ago"
    assert block["link_2_delay_s"][1, 1] == 0.0, "a delay isn't negative"
    assert np.isnan(block["link_2_delay_s"][0, 1])


def test_a_links_entry_has_each_of_its_figures_under_its_name() -> None:
    """Up and down are apart; the delay is their mean."""
    delays_s = np.array([[0.1, 0.12, 0.2], [-0.1, 0.14, 0.3], [0.3, 0.16, 0.4]])
    figures = LinkFigures(delays_s, np.arange(3.0), 0.25, 10, 20, 30, injected=(0.1, 0.3, 0.01, 0.02))
    found = OneLink(2, "udpin:a:1", 7.0, 0.002, figures).to_dict()
    assert found == {
        "link": 2,
        "endpoint": "udpin:a:1",
        "used_s": 7.0,
        "injected_delay_ms": pytest.approx(200.0),
        "injected_up_ms": pytest.approx(100.0),
        "injected_down_ms": pytest.approx(300.0),
        "measured_delay_ms": {"p50": pytest.approx(100.0), "p99": pytest.approx(np.percentile([0, 100, 300], 99))},
        "measured_up_ms": pytest.approx(140.0),
        "measured_down_ms": pytest.approx(300.0),
        "jitter_ms": 2.0,
        "injected_loss": 0.02,
        "injected_loss_up": 0.01,
        "measured_loss": 0.25,
        "frames_in": 10,
        "frames_out": 20,
        "frames_bad": 30,
    }


def test_without_knowing_every_links_injection_that_of_the_vehicle_is_not_known() -> None:
    both = [one(1, 0.04, 0.0, 16.0), one(2, 0.4, 0.1, 4.0)]
    unknown = replace(both[1], figures=replace(both[1].figures, injected=None))
    assert together([both[0], unknown], USES)["injected"] is None
    assert together(both, USES)["each"] == tuple(both)


def test_a_use_that_ends_before_it_began_lasted_no_time() -> None:
    """The flight's end comes before the last change."""
    assert used_s(USES, Instant(12 * NANOSECONDS)) == {1: 10.0, 2: 4.0}
    assert used_s(USES[:1], Instant(12 * NANOSECONDS)) == {1: 12.0}


def test_each_links_newest_delay_stands_until_it_is_2_s_old() -> None:
    """Of a vehicle with three links beside one with one, whose link is the first."""
    time_s = np.array([1.0, 2.0, 3.0, 3.1, 20.0])
    probes = [
        np.array([[1.0e9, 0.25, 9.0, 9.0], [2.0e9, 0.5, 9.0, 9.0]]),
        np.zeros((0, 4)),
        np.array([[1.1e9, 1.0, 9.0, 9.0]]),
    ]
    (block,) = with_several_links(iter([{"t_s": np.stack((time_s, time_s), axis=1)}]), [(USES, probes), None])
    nan = np.nan
    assert list(block) == ["t_s", "link", "link_1_delay_s", "link_2_delay_s", "link_3_delay_s"]
    np.testing.assert_array_equal(block["link_1_delay_s"][:, 0], [0.25, 0.5, 0.5, 0.5, nan])
    assert np.isnan(block["link_2_delay_s"]).all()
    np.testing.assert_array_equal(block["link_3_delay_s"][:, 0], [nan, 1.0, 1.0, 1.0, nan])
    assert block["link"].tolist() == [[1.0, 1.0]] * 5
    late_s = np.array([[4.0], [4.01]])
    (late,) = with_several_links(iter([{"t_s": late_s}]), [(USES, probes)])
    np.testing.assert_array_equal(late["link_1_delay_s"][:, 0], [0.5, nan])
