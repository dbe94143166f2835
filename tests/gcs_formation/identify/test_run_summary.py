"""What a run's summary tells of its recording."""

from __future__ import annotations

import json

import pytest

from gcs_formation.identify.run_summary import delays_s, unfit
from gcs_formation.record.run_directory import SUMMARY


@pytest.mark.parametrize(("late", "is_unfit"), [(0, False), (16, False), (17, True), (331, True)])
def test_a_recording_with_more_than_one_late_tick_in_a_hundred_is_unfit(tmp_path, late, is_unfit):
    (tmp_path / SUMMARY).write_text(json.dumps({"control": {"ticks": 1640, "late_ticks": late}}))
    text = unfit(tmp_path)
    assert (text is not None) == is_unfit
    if text is not None:
        assert text.startswith(f"found {late} of 1640 control ticks late ({late / 1640:.1%}); allowed: 1%. This")


@pytest.mark.parametrize("text", ["", "{}", '{"control": {"ticks": 0, "late_ticks": 0}}', '{"control": {"ticks": []}}'])
def test_of_a_summary_that_says_nothing_of_ticks_nothing_is_said(tmp_path, text):
    (tmp_path / SUMMARY).write_text(text)
    assert unfit(tmp_path) is None
    assert delays_s(tmp_path) == {}
    assert unfit(tmp_path / "nowhere") is None
