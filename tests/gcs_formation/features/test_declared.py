"""What features declare of themselves is what they do."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gcs_formation.core.feature import features
from tests.control_cycle import PAGE, page

FOLDERS = Path(__file__).parents[3] / "gcs_formation" / "features"
RECORDED = re.compile(r'(?:note\(\s*[\w.]*now|Event\(\s*[\w.]*now),\s*"(\w+)"')


@pytest.mark.parametrize("name", tuple(features()))
def test_the_events_that_a_feature_records_are_declared(name: str) -> None:
    sources = "".join(each.read_text() for each in (FOLDERS / name).glob("*.py"))
    assert set(RECORDED.findall(sources)) == set(features()[name].events)


def test_the_page_of_the_control_cycle_is_that_of_the_code() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "write it again: python -m tests.control_cycle"


def test_every_folder_is_a_feature() -> None:
    assert list(features()) == sorted(each.name for each in FOLDERS.iterdir() if (each / "__init__.py").is_file())
