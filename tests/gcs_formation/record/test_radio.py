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


def test_every_field_of_a_report_has_its_own_column_and_a_level_of_255_is_not_known() -> None:
    """A count of 255 is one."""
    report = RadioReport(after(Instant(0), 1.0), 11, 12, 13, 14, 15, 255, 17)
    unknown = RadioReport(after(Instant(0), 2.0), *(255,) * 4, 99, 300, 255)
    (block,) = with_radio(iter([{"t_s": np.array([[1.5], [2.5]])}]), [[report, unknown]])
    names = ("rssi", "remrssi", "noise", "remnoise", "txbuf_percent", "rxerrors", "fixed")
    np.testing.assert_array_equal(
        [block[f"radio_{name}"][:, 0] for name in names],
        [*[[level, np.nan] for level in (11, 12, 13, 14)], [15, 99], [255, 300], [17, 255]],
    )
    found = figures([report, unknown])
    assert found is not None
    assert found["noise"] == {"p50": 13.0, "min": 13.0, "max": 13.0}
    assert found["txbuf_percent"] == {"p50": 57.0, "min": 15.0, "max": 99.0}
    assert (found["reports"], found["rxerrors"], found["fixed"]) == (2, 300, 255)


def test_a_count_that_stays_or_begins_again_adds_what_came_since() -> None:
    """It is of 16 bits; what had been counted before the first report was counted, too."""
    counts = (65535, 65535, 0, 0, 65535)
    reports = [RadioReport(Instant(at), 1, 1, 1, 1, 1, count, count) for at, count in enumerate(counts)]
    found = figures(reports)
    assert found is not None
    assert found["rxerrors"] == 65535 + 0 + 1 + 0 + 65535
