"""Which follower of a flight is to take over from its leader."""

from __future__ import annotations

import pytest

from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from gcs_formation.features.succession import stages
from gcs_formation.features.succession.stages import successor
from tests.flights.in_memory import World

APART = {"shape": "custom", "slots_m": {2: [-20, 90, 0], 3: [-20, -20, 0], 4: [-20, 40, 0]}}


def test_the_nearest_follower_that_does_not_sink_takes_over_unless_none_is_to() -> None:
    """They fly 30, 45 and 92 m away from it, far from the origin; nearer ones aren't much nearer than a spacing."""
    path = {"speed_mps": 22, "waypoints_m": [[500, -700, 100], [4000, -700, 100]]}
    world = World(duration_s=10, vehicles={"count": 4}, formation=APART, path=path)
    world.run(1.5)
    cycle = world.station.cycle
    assert cycle.controller.plan.leader == 0
    sinking = cycle.findings.sinking
    found = list[int | None]()
    for number in (3, 4, 2, None):
        found.append(successor(cycle))
        if number is not None:
            sinking.add(VehicleId(1, number))
    assert found[0] in {2, 3}
    assert found[1:] == [3, 1, None]


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_a_distance_is_that_of_two_places_in_space(scale: float) -> None:
    one, other = (FlightState(n, e, up, 0.0, 22.0, 0.0, 0.0, 0.0) for n, e, up in ((1, 2, 3), (4, 6, 15)))
    one.north_m, one.east_m, one.height_m = 4.0 - 3.0 * scale, 6.0 - 4.0 * scale, 15.0 - 12.0 * scale
    assert stages._distance_m(one, other) == 13.0
