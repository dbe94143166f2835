"""What `check` says about the law with the scenario's links and starts, against flights."""

from __future__ import annotations

import pytest

from formation_scenario import load_scenario
from formation_scenario.start_limits import starts_without_room
from gcs_formation.app.check import check_report
from gcs_formation.app.check_law import ahead_of_virtual
from tests.flights.conftest import scenario as flight

FOUR = [{"id": each} for each in range(1, 5)]


def test_followers_of_a_virtual_leader_fly_ahead_by_what_is_foretold_where_nothing_is_predicted() -> None:
    keys = {"vehicles": FOUR, "law": {"delay_compensation": False}, "links": {"default": {"delay_ms": 200}}}
    planned = load_scenario(flight(**keys))
    said = ahead_of_virtual(planned)
    assert said is not None
    assert said in check_report(planned)["warnings"]
    min_m, max_m = (22.0 * each for each in (0.2, 0.3))
    assert f"{min_m:.2g} to {max_m:.2g} m ahead" in said
    assert ahead_of_virtual(load_scenario(flight(**keys | {"law": {"delay_compensation": True}}))) is None
    assert ahead_of_virtual(load_scenario(flight(law={"delay_compensation": False}))) is None


@pytest.mark.parametrize(
    ("offset_m", "said"), [([23.0, 0.0, 0.0], True), ([12.0, 0.0, 0.0], False), ([0, 0, 0], False)]
)
def test_starts_that_leave_no_room_beyond_the_separation_are_named(offset_m: list[float], said: bool) -> None:
    shape = {"shape": "follower", "spacing_m": 28.5}
    planned = load_scenario(flight(formation=shape, start={"in_air": True, "run_in_s": 30, "offset_m": offset_m}))
    found = starts_without_room(planned, 1.0)
    assert (found is not None) == said
    if found:
        assert found == "start.offset_m: vehicle 1 and vehicle 2 begin 5.5 m apart"
        assert any(each.startswith(found) for each in check_report(planned)["warnings"])
