"""The report's figure of telemetry that wasn't believed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcs_formation.features.telemetry_health.plate import has_alarms, telemetry_health
from gcs_formation.report import load_run
from gcs_formation.report.page import PLATES
from gcs_formation.report.page_parts import CAPTIONS
from tests.gcs_formation.report.conftest import make_run

__all__ = ["make_run"]


def test_telemetry_that_was_not_believed_has_a_bar_for_each_time(make_run):
    eventful = load_run(make_run())
    others = [each for each in eventful.events if each["kind"] != "health"]
    assert not has_alarms(replace(eventful, events=tuple(others)))
    told = {"kind": "health", "vehicle": "2", "quantity": "height", "text": ""}
    times = (31.0, False), (32.0, True), (34.0, False)
    events = [told | {"t_s": eventful.zero_s + at_s, "healthy": healthy} for at_s, healthy in times]
    (axes,) = telemetry_health(replace(eventful, events=(*others, *events))).axes
    assert [each.get_text() for each in axes.get_yticklabels()] == ["2: height"]
    (bars,) = axes.collections
    first, last = (path.get_extents() for path in bars.get_paths())
    assert (first.x0, first.x1, last.x0) == pytest.approx((31.0, 32.0, 34.0))
    assert last.x1 == pytest.approx(eventful.time_s[-1])


def test_a_report_shows_the_figures_that_features_bring() -> None:
    assert PLATES[telemetry_health] is has_alarms
    assert CAPTIONS["telemetry_health"]["title"] == "Telemetry that was not believed"
