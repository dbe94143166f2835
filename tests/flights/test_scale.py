"""As many vehicles as a network has ids, and ids that occur on two networks."""

from __future__ import annotations

from typing import Any

import pytest

from formation_scenario.fields import MAX_SYSTEM_ID
from tests.flights.conftest import Fly

DURATION_S = 3


def networks(*sizes: int) -> dict[str, Any]:
    """Return vehicles one behind the other, `sizes` of them on the networks; the first leads."""
    vehicles = [{"id": 1 + i, "network": 1 + network} for network, size in enumerate(sizes) for i in range(size)]
    return {
        "vehicles": [vehicles[0] | {"role": "leader"}, *vehicles[1:]],
        "formation": {"shape": "line", "spacing_m": 30},
        "start": {"in_air": True, "run_in_s": 6},
        "finish": {"loiter_s": 0},
        "duration_s": DURATION_S,
    }


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [(MAX_SYSTEM_ID,), (40, 40)])
def test_every_vehicle_is_distinguished_from_every_other_and_holds_its_slot(fly: Fly, sizes: tuple[int, ...]) -> None:
    summary = fly(**networks(*sizes)).to_dict()
    assert len(summary["links"]) == sum(sizes)
    assert len(summary["followers"]) == sum(sizes) - 1
    errors = [each[f"error_{axis}_m"]["max"] for each in summary["followers"].values() for axis in "xyz"]
    assert max(errors) < 0.05
    assert summary["safety"]["min_separation_m"] == pytest.approx(30.0, abs=0.1)
    assert all(link["frames_bad"] == link["frames_implausible"] == 0 for link in summary["links"].values())
    assert {link["measured_loss"] for link in summary["links"].values()} == {0.0}
