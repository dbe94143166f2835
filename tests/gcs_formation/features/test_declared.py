"""What features declare of themselves is what they do."""

from __future__ import annotations

import re
from pathlib import Path
from typing import cast

import pytest

from gcs_formation.core.cycle import Cycle
from gcs_formation.core.feature import features, only_one, resumed_beginning, take_endings
from gcs_formation.errors import RunAbortedError
from gcs_formation.mission.past_flight import PastFlight
from tests.control_cycle import PAGE, page

FOLDERS = Path(__file__).parents[3] / "gcs_formation" / "features"
RECORDED = re.compile(r'(?:log_event\(\s*[\w.]*now|Event\(\s*[\w.]*now),\s*"(\w+)"')


@pytest.mark.parametrize("name", tuple(features()))
def test_the_events_that_a_feature_records_are_declared(name: str) -> None:
    sources = "".join(each.read_text() for each in (FOLDERS / name).glob("*.py"))
    assert set(RECORDED.findall(sources)) == set(features()[name].events)


def test_the_page_of_the_control_cycle_is_that_of_the_code() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "write it again: python -m tests.control_cycle"


def test_every_folder_is_a_feature() -> None:
    assert list(features()) == sorted(each.name for each in FOLDERS.iterdir() if (each / "__init__.py").is_file())


def test_of_two_features_that_would_end_flights_none_silently_takes_the_others_place() -> None:
    """The last one imported would win, and the other's endings be missing without a word."""
    assert only_one({"separation": None, "ending": 1}, "ends flights") == 1
    assert only_one({"separation": None}, "ends flights") is None
    with pytest.raises(RunAbortedError, match="found features ending, other, each of which ends flights; allowed: one"):
        only_one({"ending": 1, "other": 2}, "ends flights")


@pytest.mark.parametrize(("what", "does"), [("ends", "ends flights"), ("resumes", "resumes flights")])
def test_a_second_feature_that_takes_the_same_place_stops_the_run_before_it_begins(
    monkeypatch: pytest.MonkeyPatch, what: str, does: str
) -> None:
    there = features()
    owner = next(each for each in there.values() if getattr(each, what) is not None)
    monkeypatch.setattr("gcs_formation.core.feature.features", lambda: {**there, "another": owner})
    with pytest.raises(RunAbortedError, match=f"another, each of which {does}"):
        take_endings(cast("Cycle", None)) if what == "ends" else resumed_beginning(
            cast("Cycle", None), cast("PastFlight", None)
        )
