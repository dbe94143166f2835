"""How near flights of two vehicles came to their limits, worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario, load_scenario
from gcs_formation.record import limits_by_truth
from gcs_formation.record.limits_by_truth import NONE, LimitSeries, Truth, began_s, limit_series
from gcs_formation.record.timeseries import PHASES, VIRTUAL_LEADER

LEADER, FOLLOWER = VehicleId(1, 1), VehicleId(1, 2)
ENDS_S = 20.0
TRUTH_S = np.round(np.arange(0.0, ENDS_S + 0.5, 0.04), 2)
TICKS_S = np.round(np.arange(2.0, ENDS_S + 0.05, 0.1), 1)
"""Ticks are recorded from 2 s on; the path begins at 5 s, the flight along it ends at 15 s."""
FLYING, LOITERING = PHASES.index("flying"), PHASES.index("loitering")
FENCE = {"corners_m": [[-100, -100], [400, -100], [400, 100], [-100, 100]], "height_min_m": 20, "height_max_m": 60}


KEYS = {"vehicles": {"count": 2}, "duration_s": 10, "path": {"waypoints_m": [[0, 0, 50], [4000, 0, 50]]}}
OPEN = load_scenario(KEYS)


def with_areas(*areas: dict[str, Any]) -> Scenario:
    """Return a scenario with a fence from -100 to 400 m north, 100 m to both sides, and 20 to 60 m high."""
    wide = [[-1000, -800], [5000, -800], [5000, 800], [-1000, 800]]
    made = load_scenario(KEYS | {"safety": {"fence": {"corners_m": wide}}})
    outer: Any = made.fence
    fence = type(outer).model_validate(FENCE | {"areas": areas})
    return made.model_copy(update={"safety": made.safety.model_copy(update={"fence": fence})})


FENCED = with_areas()


def places(column: int, time_s: Array, **changes: Any) -> dict[str, Array]:
    """Return where a vehicle is at some times, by default 50 m high and 30 m north of the one before it."""
    own = {"north_m": 30.0 * column, "east_m": 0.0, "height_m": 50.0, "airborne": 1.0}
    values = {name: changes.get(name, value) for name, value in own.items()}
    return {
        name: np.asarray(value(time_s) if callable(value) else np.full(time_s.size, value), float)
        for name, value in values.items()
    }


def reader(*vehicles: dict[str, Any]) -> Truth:
    """Return what reads the truth of vehicles with these changes."""
    each = [places(column, TRUTH_S, **own) for column, own in enumerate(vehicles)]
    whole = {name: np.stack([own[name] for own in each], axis=1) for name in each[0]} | {"time_s": TRUTH_S}

    def read(from_s: float, to_s: float) -> dict[str, Array]:
        first = max(0, int(TRUTH_S.searchsorted(from_s, side="right")) - 1)
        return {
            name: values[first : int(TRUTH_S.searchsorted(to_s, side="right")) + 1] for name, values in whole.items()
        }

    return read


def ticks(*vehicles: dict[str, Any], time_s: Array = TICKS_S) -> dict[VehicleId, dict[str, Array]]:
    """Return what the station recorded: the first leads, both are commanded until the vehicles loiter."""
    phase = np.where(time_s < 14.95, FLYING, LOITERING)
    phase = np.where(time_s < 4.95, PHASES.index("assembling"), phase)
    common = {"t_s": time_s, "mission_time_s": np.where(time_s < 4.95, np.nan, time_s - 5.0), "phase": phase}
    found = dict[VehicleId, dict[str, Array]]()
    for column, own in enumerate(vehicles):
        active = own.get("active", lambda at_s: (at_s < 14.95).astype(float))
        reported = {"leads": np.full(time_s.size, float(column == 0)), "active": np.asarray(active(time_s), float)}
        found[VehicleId(1, 1 + column)] = common | reported | places(column, time_s, **own)
    return found


def series(
    *vehicles: dict[str, Any],
    scenario: Scenario | None = None,
    pilots: Any = None,
    known: Any = None,
    seen: bool = True,
) -> LimitSeries:
    """Return the distances of a flight; `known` is what the station has other than the truth, which may be `seen`."""
    recorded = ticks(*(known or vehicles))
    truth = reader(*vehicles) if seen else None
    return limit_series(scenario or OPEN, recorded, truth, pilots or {}, ENDS_S)


def test_limits_are_judged_at_every_row_of_the_truth_from_a_second_before_the_first_tick_to_the_end() -> None:
    found = series({}, {})
    rows = TRUTH_S[(TRUTH_S >= 1.0) & (TRUTH_S <= ENDS_S)]
    np.testing.assert_array_equal(found.time_s, rows)
    expected = [int(np.flatnonzero(at_s >= TICKS_S - 1e-12)[-1]) if at_s >= 2.0 else -1 for at_s in rows]
    assert found.tick.tolist() == expected, "what a tick said holds until the next"
    assert found.separation_m == pytest.approx(30.0)
    assert (found.fence_m == 0.0).all()
    assert (found.by_pilots, found.unseen_s) == ([], [])


def test_without_truth_they_are_judged_at_the_ticks() -> None:
    found = series({}, {"height_m": 90.0}, seen=False)
    np.testing.assert_array_equal(found.time_s, TICKS_S)
    assert found.tick.tolist() == list(range(TICKS_S.size))
    assert found.separation_m == pytest.approx(50.0)
    unknown = series({}, {"north_m": np.nan}, seen=False)
    assert np.isinf(unknown.separation_m).all(), "a vehicle that isn't seen"


@pytest.mark.parametrize("seconds", [0.5, 7.3])
def test_nothing_depends_on_the_size_of_the_blocks_in_which_the_truth_is_read(
    seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The follower climbs out of the fence, comes near the leader at 10 s, and both land after the end."""
    climbs = {
        "height_m": lambda at_s: np.interp(at_s, [0.0, 4.0, 8.0, 12.0, 16.0, 19.0], [0.0, 30.0, 70.0, 30.0, 30.0, 0.0]),
        "east_m": lambda at_s: np.abs(at_s - 10.0) * 3.0,
        "airborne": lambda at_s: ((at_s > 0.5) & (at_s < 18.9)).astype(float),
    }
    flown: tuple[dict[str, Any], ...] = {}, climbs
    pilots = {str(FOLLOWER): [(7.0, 7.5)]}
    whole = series(*flown, scenario=FENCED, pilots=pilots)
    monkeypatch.setattr(limits_by_truth, "ROWS_AT_ONCE", seconds * 2 * limits_by_truth.TRUTH_HZ)
    blocks = series(*flown, scenario=FENCED, pilots=pilots)
    for name in ("time_s", "tick", "separation_m", "clearance_m", "fence_m", "farthest"):
        np.testing.assert_array_equal(getattr(blocks, name), getattr(whole, name), err_msg=name)
    assert (blocks.by_pilots, blocks.unseen_s) == (whole.by_pilots, whole.unseen_s)
    np.testing.assert_array_equal(blocks.track.position_m, whole.track.position_m)
    assert whole.fence_m.max() == pytest.approx(10.0, abs=0.5)
    assert whole.by_pilots[0].outside_m == pytest.approx(4.8)
    assert np.nanmin(whole.separation_m) == pytest.approx(math.hypot(30.0, 0.0), abs=2.0)


def test_clearance_is_of_vehicles_in_flight_between_their_first_setpoint_and_their_landing() -> None:
    """The follower is commanded from 6 s on, and on the ground at the end; the leader stays aloft, higher."""
    lands = {
        "height_m": lambda at_s: np.interp(at_s, [0.0, 6.0, 16.0, 19.0], [0.0, 12.0, 12.0, 0.0]),
        "airborne": lambda at_s: ((at_s > 0.5) & (at_s < 18.9)).astype(float),
        "active": lambda at_s: ((at_s >= 5.95) & (at_s < 14.95)).astype(float),
    }
    found = series({"active": np.ones_like}, lands)
    at_s = found.time_s
    assert np.isnan(found.clearance_m[at_s < 2.0]).all(), "before the first tick nothing is known"
    assert found.clearance_m[(at_s >= 2.0) & (at_s < 6.0)] == pytest.approx(50.0)
    assert found.clearance_m[(at_s >= 6.0) & (at_s < 15.0)] == pytest.approx(12.0)
    assert found.clearance_m[at_s >= 15.0] == pytest.approx(50.0), "it lands"
    stays = series({}, lands | {"airborne": 1.0, "height_m": 12.0})
    assert stays.clearance_m[stays.time_s >= 15.0] == pytest.approx(12.0), "it is in the air to the end"


def test_height_is_that_above_the_ground_below_each() -> None:
    hill: Any = SimpleNamespace(height=lambda north_m, east_m: 0.1 * north_m + 0.2 * east_m)
    scenario = cast("Scenario", SimpleNamespace(fence=None, terrain="hill.tif", ground=hill))
    found = series({"north_m": 100.0, "east_m": 10.0}, {"north_m": 0.0, "height_m": 39.0}, scenario=scenario)
    assert found.clearance_m[found.tick >= 0] == pytest.approx(50.0 - 12.0)


@pytest.mark.parametrize(
    ("place", "outside_m", "where"),
    [
        ({"north_m": 395.0}, 0.0, 1),
        ({"north_m": 403.0}, 3.0, 1),
        ({"east_m": -104.0}, 4.0, 1),
        ({"height_m": 60.0}, 0.0, 1),
        ({"height_m": 64.0}, 4.0, 1),
        ({"height_m": 20.0}, 0.0, 1),
        ({"height_m": 15.0}, 5.0, 1),
        ({"north_m": 403.0, "height_m": 64.0}, 5.0, 1),
        ({"north_m": 403.0, "height_m": 16.0}, 5.0, 1),
    ],
)
def test_outside_the_fence_is_as_far_as_to_its_nearest_point(
    place: dict[str, float], outside_m: float, where: int
) -> None:
    """By 3-4-5. It has flown in the formation since the path began, so that the fence binds it from then on."""
    found = series({}, place, scenario=FENCED)
    bound = (found.time_s >= 5.0) & (found.time_s < 15.0)
    assert found.fence_m[bound] == pytest.approx(outside_m)
    if outside_m:
        assert (found.farthest[bound] == where).all()
    free = series({}, place, scenario=OPEN)
    assert (free.fence_m == 0.0).all(), "without a fence none is outside"


def test_each_limit_of_the_fence_binds_from_when_a_vehicle_was_first_inside_it() -> None:
    """It takes off beyond the side and below the height, and comes inside before the path begins."""
    comes = {
        "north_m": lambda at_s: np.interp(at_s, [0.0, 3.0], [430.0, 390.0]),
        "height_m": lambda at_s: np.interp(at_s, [0.0, 4.0, 12.0, 13.0], [0.0, 40.0, 40.0, 10.0]),
        "active": lambda at_s: (at_s >= 5.95).astype(float),
    }
    found = series({}, comes, scenario=FENCED)
    assert (found.fence_m[found.time_s < 12.0] == 0.0).all()
    assert found.fence_m[found.time_s >= 13.0] == pytest.approx(10.0)
    along = comes | {"height_m": lambda at_s: np.where(at_s < 12.0, 20.0, 13.0), "north_m": 390.0}
    edge = series({}, along, scenario=FENCED)
    assert edge.fence_m.max() == pytest.approx(7.0), "its edge is inside"
    never = series({}, comes | {"north_m": 430.0}, scenario=FENCED)
    assert (never.fence_m[never.time_s < 12.5] == 0.0).all(), "it doesn't fly in the formation as the path begins"
    one = series({}, comes | {"north_m": 430.0, "active": np.ones_like}, scenario=FENCED)
    assert one.fence_m[(one.time_s >= 5.0) & (one.time_s < 12.0)] == pytest.approx(30.0)


def test_the_lowest_height_of_the_fence_does_not_bind_a_landing_and_its_sides_and_top_do() -> None:
    lands = {"airborne": lambda at_s: (at_s < 18.9).astype(float)}
    low = series({}, lands | {"height_m": lambda at_s: np.where(at_s < 15.0, 50.0, 5.0)}, scenario=FENCED)
    assert (low.fence_m == 0.0).all()
    sideways = series({}, lands | {"north_m": lambda at_s: np.where(at_s < 15.0, 30.0, 407.0)}, scenario=FENCED)
    assert sideways.fence_m[(sideways.time_s >= 15.0) & (sideways.time_s < 18.8)] == pytest.approx(7.0)
    assert (sideways.fence_m[sideways.time_s > 18.95] == 0.0).all(), "a wreck on the ground isn't outside"
    high = series({}, lands | {"height_m": lambda at_s: np.where(at_s < 15.0, 50.0, 68.0)}, scenario=FENCED)
    assert high.fence_m.max() == pytest.approx(8.0)


def test_a_vehicle_that_its_pilot_flies_is_named_with_how_far_it_was_outside_and_breaks_no_limit() -> None:
    """Both ends of its pilot's time count. The one farthest outside is reported, at its farthest, and when."""
    away = {"north_m": lambda at_s: 400.0 + np.interp(at_s, [8.0, 10.0, 12.0], [0.0, 20.0, 0.0])}
    pilots = {str(FOLLOWER): [(8.0, 12.0)]}
    found = series({}, away, scenario=FENCED, pilots=pilots)
    assert (found.fence_m == 0.0).all()
    (one,) = found.by_pilots
    assert (one.vehicle, one.outside_m, one.time_s) == (FOLLOWER, pytest.approx(20.0), 10.0)
    late = series({}, away, scenario=FENCED, pilots={str(FOLLOWER): [(8.0, 9.0), (11.0, 11.4)]})
    assert late.fence_m.max() == pytest.approx(20.0)
    (one,) = late.by_pilots
    assert (one.outside_m, one.time_s) == (pytest.approx(10.0), pytest.approx(9.0, abs=0.041))
    ends = series({}, away, scenario=FENCED, pilots={str(FOLLOWER): [(9.0, 11.0)]})
    assert (ends.fence_m[np.isin(ends.time_s, [9.0, 11.0])] == 0.0).all()
    assert ends.fence_m.max() == pytest.approx(9.6)
    both = series({"height_m": 61.0}, away, scenario=FENCED, pilots={**pilots, str(LEADER): [(0.0, math.inf)]})
    assert [each.vehicle for each in both.by_pilots] == [LEADER, FOLLOWER]
    assert both.by_pilots[0].outside_m == pytest.approx(1.0)
    inside = series({}, {}, scenario=FENCED, pilots=pilots)
    assert inside.by_pilots == []


def test_the_track_is_the_commanded_leaders_in_flight_by_mission_time() -> None:
    """The second leads from 10 s on; at 12 s it is down."""
    down = {"airborne": lambda at_s: (at_s < 12.0).astype(float), "east_m": 7.0}
    recorded = ticks({}, down)
    for column, own in enumerate(recorded.values()):
        own["leads"] = np.where((TICKS_S > 9.95) == bool(column), 1.0, 0.0)
    track = limit_series(OPEN, recorded, reader({}, down), {}, ENDS_S).track
    known = np.isfinite(track.position_m).all(axis=0)
    np.testing.assert_allclose(track.mission_s[known], TRUTH_S[(TRUTH_S >= 5.0) & (TRUTH_S < 12.0)] - 5.0, atol=1e-9)
    second = known & (track.mission_s >= 5.0 - 1e-9)
    assert (track.leader[second].tolist(), track.leader[known & ~second].tolist()) == (
        [1] * int(second.sum()),
        [0] * int((known & ~second).sum()),
    )
    assert track.position_m[:, second].T.tolist() == [[30.0, 7.0, 50.0]] * int(second.sum())
    idle = ticks({"active": np.zeros_like}, {"active": np.zeros_like})
    none = limit_series(OPEN, idle, reader({}, {}), {}, ENDS_S).track
    assert np.isnan(none.position_m).all(), "none is commanded"


def test_a_virtual_leaders_track_is_where_the_station_had_it_at_ticks_that_command_anybody() -> None:
    recorded = ticks({}, {})
    for own in recorded.values():
        own["leads"] = np.zeros(TICKS_S.size)
        own["active"] = ((TICKS_S > 6.95) & (TICKS_S < 14.95)).astype(float)
        own |= dict(
            zip(VIRTUAL_LEADER, (TICKS_S * 20.0, TICKS_S * 0.0, TICKS_S * 0.0 + 50.0, TICKS_S * 0), strict=True)
        )
    recorded[LEADER]["active"] = np.zeros(TICKS_S.size)
    track = limit_series(OPEN, recorded, reader({}, {}), {}, ENDS_S).track
    known = np.isfinite(track.position_m).all(axis=0)
    np.testing.assert_allclose(track.mission_s, recorded[LEADER]["mission_time_s"])
    np.testing.assert_allclose(track.position_m[0, known], TICKS_S[(TICKS_S > 6.95) & (TICKS_S < 14.95)] * 20.0)
    assert (track.leader == NONE).all()


@pytest.mark.parametrize(("gap_s", "unseen"), [(0.9, False), (1.0, False), (1.1, True)])
def test_longer_than_a_second_without_a_position_is_not_seen(gap_s: float, *, unseen: bool) -> None:
    """Between the first flight and the end, the end included; at the ticks, as there is no truth."""
    for begin_s in (9.0, ENDS_S - gap_s):
        since_s = TICKS_S - begin_s
        time_s = TICKS_S[(since_s <= 1e-9) | (since_s >= gap_s - 1e-9)]
        time_s = time_s[time_s < ENDS_S] if begin_s > 10.0 else time_s
        found = limit_series(OPEN, ticks({}, {}, time_s=time_s), None, {}, ENDS_S)
        expected = [(pytest.approx(begin_s), pytest.approx(begin_s + gap_s))]
        assert found.unseen_s == (expected if unseen else [])
    grounded = {"airborne": lambda at_s: (at_s > 12.0).astype(float)}
    late_s = TICKS_S[(TICKS_S < 9.0) | (TICKS_S > 11.0)]
    before = limit_series(OPEN, ticks(grounded, grounded, time_s=late_s), None, {}, ENDS_S)
    assert before.unseen_s == [], "before the first flight there is nothing to see"
    never = limit_series(OPEN, ticks({"airborne": 0.0}, {"airborne": 0.0}), None, {}, ENDS_S + 60.0)
    assert never.unseen_s == []


@pytest.mark.parametrize("seen", [True, False])
def test_a_flight_without_a_tick_has_no_distance(*, seen: bool) -> None:
    recorded = ticks({}, {}, time_s=TICKS_S[:0])
    found = limit_series(FENCED, recorded, reader({}, {}) if seen else None, {}, 3.0)
    assert (found.tick == -1).all()
    assert (found.time_s.tolist() == TRUTH_S[TRUTH_S <= 3.0].tolist()) is seen
    assert np.isnan(found.clearance_m).all()
    ended = limit_series(FENCED, recorded, None, {}, -1.0)
    assert (ended.time_s.size, ended.by_pilots, ended.unseen_s) == (0, [], [])


def test_the_path_begins_when_mission_time_does() -> None:
    common = ticks({})[LEADER]
    assert began_s(common) == pytest.approx(5.0)
    assert math.isnan(began_s({"t_s": common["t_s"], "mission_time_s": common["t_s"] * np.nan}))
