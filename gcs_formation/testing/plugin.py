"""The pytest plugin. All sessions of its users import it, so it imports what flies only in the fixture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from gcs_formation.testing.flight_plan import Formation


@pytest.fixture
def formation(request: pytest.FixtureRequest, tmp_path: Path) -> Formation:
    """Return the planner of flights: `formation("scenario.yaml").with_link(vehicle=3, delay_ms=300).fly(until=60)`.

    A relative path is searched beside the test's file, then from pytest's root directory. Flights are recorded in
    the test's `tmp_path`.
    """
    from gcs_formation.testing.flight_plan import Formation  # noqa: PLC0415 - see the module's docstring

    return Formation((request.path.parent, request.config.rootpath), tmp_path)
