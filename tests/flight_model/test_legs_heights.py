"""Heights through dense points: a run of short sections is climbed as one, within a metre of all points."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.legs.heights import Climbs, profile

CLIMBS = Climbs(slope=0.14, change_1pm=0.0005)


def test_a_short_section_with_a_small_climb_among_others_is_no_reason_to_refuse() -> None:
    at_m = np.arange(0.0, 2000.0, 18.0)
    heights_m = 100.0 + 0.02 * at_m + 0.1 * np.sin(at_m)  # digitised: centimetres of noise
    heights, steep = profile(at_m, heights_m, [CLIMBS] * (at_m.size - 1))
    assert steep == []
    along_m = np.linspace(0.0, at_m[-1], 4000)
    flown_m, slope, _ = heights.at(along_m)
    assert np.abs(heights.at(at_m)[0] - heights_m).max() <= 1.0
    assert np.abs(slope).max() <= CLIMBS.slope
    assert flown_m.min() >= heights_m[0] - 1e-9
    assert flown_m.max() <= heights_m[-1] + 1e-9


def test_long_legs_keep_every_height_beside_a_run_of_short_ones() -> None:
    at_m = np.array([0.0, 3000.0, *(3000.0 + 18.0 * np.arange(1, 40)), 7000.0])
    heights_m = np.array([100.0, 100.0, *(100.0 + 0.3 * np.arange(1, 40) + 0.05 * (-1.0) ** np.arange(39)), 150.0])
    heights, steep = profile(at_m, heights_m, [CLIMBS] * (at_m.size - 1))
    assert steep == []
    assert heights.at(np.array([1500.0, 3000.0, 7000.0]))[0] == pytest.approx([100.0, 100.0, 150.0])


def test_a_run_that_climbs_too_steeply_altogether_stays_refused() -> None:
    at_m = np.arange(0.0, 400.0, 18.0)
    _, steep = profile(at_m, 100.0 + 0.3 * at_m, [CLIMBS] * (at_m.size - 1))
    assert steep


def test_steep_climbs_are_named_by_their_own_index_when_others_are_left_out() -> None:
    at_m = np.array([*np.arange(0.0, 2000.0, 18.0), 4000.0, 4100.0, 8000.0])
    heights_m = np.array([*(100.0 + 0.1 * (-1.0) ** np.arange(at_m.size - 3)), 100.0, 200.0, 200.0])
    _, steep = profile(at_m, heights_m, [CLIMBS] * (at_m.size - 1))
    assert [each.interval for each in steep] == [at_m.size - 3]
