"""Missions as people fly them are planned along their legs, at their heights."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.legs.path import LegsPath
from formation_scenario import ScenarioError, load_scenario
from tests.missions import FLOWN, REFUSED, keys_of

HZ = 25.0


@pytest.mark.parametrize("name", FLOWN)
def test_a_mission_is_planned_along_its_legs_at_its_heights(name: str) -> None:
    scenario = load_scenario(keys_of(name))
    path, waypoints = scenario.written_path, np.array(scenario.path.waypoints_m)
    assert isinstance(path, LegsPath)
    at_m = np.arange(-scenario.run_in_m, path.length_m, scenario.path.begin_mps / HZ)
    points = path.at(at_m)

    # Outside turns on its leg; those before and after circles are tangents of these.
    circled = {each.waypoint for each in scenario.path.circles}
    for straight, begin_m, end_m in path.straights_m:
        on = (at_m >= begin_m) & (at_m <= end_m)
        if on.any() and not {straight, straight + 1} & circled:
            ahead = complex(*(waypoints[straight + 1] - waypoints[straight])[:2])
            off = points.north_m[on] + 1j * points.east_m[on] - complex(*waypoints[straight][:2])
            assert np.abs((off * np.conj(ahead)).imag / abs(ahead)).max() < 0.01

    flown = at_m >= 0.0
    leg = np.clip(np.searchsorted(path.waypoints_at_m, at_m[flown], side="right") - 1, 0, len(waypoints) - 2)
    lower, upper = (
        np.minimum(waypoints[leg, 2], waypoints[leg + 1, 2]),
        np.maximum(waypoints[leg, 2], waypoints[leg + 1, 2]),
    )
    assert (points.height_m[flown] - upper).max() < 0.05
    assert (lower - points.height_m[flown]).max() < 0.05
    assert path.at(path.waypoints_at_m).height_m == pytest.approx(waypoints[:, 2], abs=1.0)


@pytest.mark.parametrize("name", REFUSED)
def test_a_mission_with_a_leg_too_steep_is_refused_for_that_alone(name: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys_of(name))
    (problem,) = refused.value.problems
    assert REFUSED[name] in str(problem)
