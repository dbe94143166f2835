"""What radios reported, in the record."""

from __future__ import annotations

import numpy as np

from airlink.clock import Instant, after
from gcs_formation.link.radio_reports import RadioReport
from gcs_formation.record.radio import figures, with_radio

REPORTS = [
    RadioReport(after(Instant(0), at_s), 130, 255, 40, 41, txbuf, errors, 2)
    for at_s, txbuf, errors in ((1.0, 90, 65530), (2.0, 10, 65534), (3.0, 50, 4))
]


def test_each_tick_has_the_newest_report_unless_it_is_old() -> None:
    time_s = np.array([[0.5, 0.5], [1.0, 1.0], [2.9, 2.9], [8.0, 8.0], [8.1, 8.1]])
    (block,) = with_radio(iter([{"t_s": time_s}]), [REPORTS, []])
    nan = np.nan
    np.testing.assert_array_equal(block["radio_txbuf_percent"][:, 0], [nan, 90, 10, 50, nan])
    np.testing.assert_array_equal(block["radio_rssi"][:, 0], [nan, 130, 130, 130, nan])
    assert np.isnan(block["radio_remrssi"]).all()
    assert np.isnan(block["radio_txbuf_percent"][:, 1]).all()


def test_a_vehicle_alone_has_its_radios_reports_too() -> None:
    (block,) = with_radio(iter([{"t_s": np.array([[1.0], [2.0]])}]), [REPORTS])
    assert block["radio_txbuf_percent"].tolist() == [[90.0], [10.0]]


def test_without_a_report_the_series_stays_as_it_is() -> None:
    (block,) = with_radio(iter([{"t_s": np.zeros((3, 2))}]), [[], []])
    assert list(block) == ["t_s"]
    assert figures([]) is None


def test_figures_are_of_all_reports_and_counts_that_begin_again_go_on() -> None:
    found = figures(REPORTS)
    assert found is not None
    assert (found["reports"], found["rxerrors"], found["fixed"]) == (3, 65540, 2)
    assert found["txbuf_percent"] == {"p50": 50.0, "min": 10.0, "max": 90.0}
    assert found["remrssi"] == {"p50": None, "min": None, "max": None}
