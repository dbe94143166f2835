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
