"""What is public in Python is listed, documented, and stays as it is listed."""

import importlib

import pytest

from tests.api_reference import MODULES, ROOT, public, reference


def test_the_reference_is_that_of_the_sources():
    written = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    assert written == reference(), "python -m tests.api_reference > docs/api.md, and a line in the changelog"


@pytest.mark.parametrize("module", MODULES)
def test_what_is_public_can_be_imported_and_says_what_it_is(module):
    found = importlib.import_module(module)
    for name in public(module):
        made = getattr(found, name)
        assert (made.__doc__ or "").strip(), f"{module}.{name}"


def test_names_that_scripts_rely_on_are_listed():
    names = {module: set(public(module)) for module in MODULES}
    assert "consensus_delay_margin" in names["gcs_formation.stability"] & names["gcs_formation.library"]
    assert "FuzzyGainScheduler" in names["gcs_formation.control"] & names["gcs_formation.library"]
    assert {"run", "study", "tell", "Flight", "load_scenario"} <= names["gcs_formation"]
