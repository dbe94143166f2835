"""What vehicles tell of their own limits: geofences around their homes, and speeds, rates and climbs."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.features.preflight import read_limits
from gcs_formation.features.preflight.own_fences import OwnFences
from gcs_formation.features.preflight.read_limits import ReadLimits
from gcs_formation.vehicle.own_fence import OwnFence
from tests.flights.conftest import scenario

CLIMBING = {"speed_mps": 22, "waypoints_m": [[0, 0, 90.5], [1500, 2000, 115.5], [3000, 4000, 140.5]]}
"""3-4-5: its end is 5 km from its begin."""
SLOTS = {"shape": "custom", "slots_m": {2: [-30, 40, -6], 3: [-60.5, 0, 9]}}
"""The first is 50 m from the leader, the second 60.5 m; one is below it, one above."""
CLIMBS = load_scenario(scenario(path=CLIMBING, formation=SLOTS))
PLAIN = load_scenario(scenario())
NAMES = ("LOW", "HIGH", "ROUND")
ANYWHERE = OwnFence(-math.inf, math.inf, math.inf, NAMES)


def fenced(fence: OwnFence | None, *, home_up_m: float = 0.0, home_m: Any = (0.0, 0.0), **keys: Any) -> Any:
    """Return what is judged of the second vehicle, which stands 7 m north of the origin, and the vehicle."""
    loaded = load_scenario(scenario(**{"path": CLIMBING, "formation": SLOTS} | keys)) if keys else CLIMBS
    motion = SimpleNamespace(north_m=7.0, east_m=0.0, height_m=home_up_m + 3.0, above_home_m=3.0)
    vehicle: Any = SimpleNamespace(
        identity=VehicleId(1, 2),
        telemetry=SimpleNamespace(motion=motion, home_m=home_m),
        autopilot=SimpleNamespace(heights_m=None),
    )
    fences = OwnFences(loaded)
    fences.apply(vehicle, fence)
    fences.settle()
    return fences, vehicle


@pytest.mark.parametrize(
    ("index", "value", "words"),
    [
        (0, 82.4, ""),
        (0, 82.5, ""),
        (0, 82.6, "LOW: found 82.6; allowed: 82 m or less, or another path.waypoints_m"),
        (1, 181.6, ""),
        (1, 181.5, ""),
        (1, 181.4, "HIGH: found 181.4; allowed: 182 m or more, for path, slots and the circles at the end"),
        (2, 5062.6, ""),
        (2, 5062.4, "ROUND: found 5062.4; allowed: 5063 m or more, for path and slots, or another path.waypoints_m"),
    ],
)
@pytest.mark.parametrize("home_up_m", [0.0, 10.0])
def test_path_and_slots_must_be_two_metres_inside(index: int, value: float, words: str, home_up_m: float) -> None:
    """The lowest slot at 90.5 - 6 m, the highest at 140.5 + 9 m, and 30 m for circles; the farthest at 5060.5 m."""
    limits = [-math.inf, math.inf, math.inf]
    limits[index] = value if index == 2 else value - home_up_m
    fences, _ = fenced(OwnFence(limits[0], limits[1], limits[2], NAMES), home_up_m=home_up_m)
    assert len(fences.unflyable) == bool(words)
    if words and not home_up_m:
        assert fences.unflyable[0].startswith(f"vehicle 2: {words}")


def test_commanded_heights_are_bounded_two_metres_inside_above_home() -> None:
    _, vehicle = fenced(OwnFence(30.0, 250.0, math.inf, NAMES), home_up_m=12.0)
    assert vehicle.autopilot.heights_m == (44.0, 260.0)


def test_slots_above_the_leader_do_not_lower_the_lowest_and_those_below_it_do_not_raise_the_highest() -> None:
    up = {"shape": "custom", "slots_m": {2: [-30, 0, 20], 3: [-60, 0, 5]}}
    down = {"shape": "custom", "slots_m": {2: [-30, 0, -20], 3: [-60, 0, -5]}}
    for formation, lowest_m, highest_m in ((up, 88.5, 192.5), (down, 68.5, 172.5)):
        fences, _ = fenced(OwnFence(lowest_m + 0.1, highest_m - 0.1, math.inf, NAMES), formation=formation)
        allowed = [f"allowed: {math.floor(lowest_m)} m or less", f"allowed: {math.ceil(highest_m)} m or more"]
        assert all(words in said for words, said in zip(allowed, fences.unflyable, strict=True))


@pytest.mark.parametrize(
    ("up_m", "lowest_m", "highest_m"), [((20, 5, 0.5), 90.5, 160.5), ((-20, -5, -0.5), 70.5, 140.5)]
)
def test_the_path_of_a_virtual_leader_must_be_inside_too(
    up_m: tuple[float, float, float], lowest_m: float, highest_m: float
) -> None:
    """All slots are above it, or all below; circles at the end take 30 m more."""
    slots = {number: [-30 * number, 0, each] for number, each in enumerate(up_m, 1)}
    keys: dict[str, Any] = {
        "vehicles": [{"id": number, "role": "follower"} for number in slots],
        "formation": {"shape": "custom", "slots_m": slots},
    }
    for off_m, count in ((0.1, 2), (-0.1, 0)):
        fence = OwnFence(lowest_m - 2.0 + off_m, highest_m + 32.0 - off_m, math.inf, NAMES)
        assert len(fenced(fence, **keys)[0].unflyable) == count


def test_multirotors_hover_at_the_end_and_need_no_circles() -> None:
    vehicles = {"count": 3, "model": "arducopter"}
    keys: dict[str, Any] = {"vehicles": vehicles, "path": CLIMBING | {"speed_mps": 5}}
    assert fenced(OwnFence(-math.inf, 151.6, math.inf, NAMES), **keys)[0].unflyable == []
    assert len(fenced(OwnFence(-math.inf, 151.4, math.inf, NAMES), **keys)[0].unflyable) == 1


def test_a_home_that_is_not_known_is_where_the_vehicle_stands() -> None:
    """7 m north: the path's end is 2993 m north and 4000 m east of it."""
    away_m = math.hypot(2993.0, 4000.0) + 60.5 + 2.0
    assert fenced(ANYWHERE._replace(radius_m=away_m + 0.1), home_m=None)[0].unflyable == []
    assert len(fenced(ANYWHERE._replace(radius_m=away_m - 0.1), home_m=None)[0].unflyable) == 1


@pytest.mark.parametrize(("home_m", "away_m"), [((6000.0, 8000.0), 10_000.0), ((-3000.0, -4000.0), 10_000.0)])
def test_the_whole_path_counts_from_its_begin_to_its_end(home_m: tuple[float, float], away_m: float) -> None:
    """3-4-5: homes 5 km beyond the end and 5 km before the begin."""
    for off_m, count in ((0.2, 0), (-0.2, 1)):
        fence = ANYWHERE._replace(radius_m=away_m + 60.5 + 2.0 + off_m)
        assert len(fenced(fence, home_m=home_m)[0].unflyable) == count


def test_nothing_is_settled_before_the_position_is_known_and_then_once() -> None:
    fences, vehicle = fenced(ANYWHERE)
    assert fences.settled
    assert fenced(None)[0].settled
    other: Any = SimpleNamespace(
        identity=VehicleId(1, 3),
        telemetry=SimpleNamespace(motion=None, home_m=(0.0, 0.0)),
        autopilot=SimpleNamespace(heights_m=None),
    )
    fences.apply(other, OwnFence(-50.0, 250.0, 10.0, NAMES))
    fences.settle()
    assert not fences.settled
    other.telemetry.motion = vehicle.telemetry.motion
    fences.settle()
    assert fences.settled
    assert [each[:11] for each in fences.unflyable] == ["vehicle 3: "]
    other.telemetry.motion = SimpleNamespace(north_m=0.0, east_m=0.0, height_m=500.0, above_home_m=0.0)
    fences.settle()
    assert other.autopilot.heights_m == (-48.0, 248.0)


DENSITY = 1.25
"""True over indicated airspeed."""


class Reported:
    """Limits that the second vehicle tells, whose airspeeds are as indicated."""

    def __init__(self) -> None:
        self.given = PLAIN.vehicles[1].model
        self.speeds_mps: tuple[float, float] | None = None
        self.bounds: tuple[int, float, float, float] | None = None
        self.autopilot = SimpleNamespace(
            commanded_airspeed=lambda true_mps: true_mps / DENSITY,
            true_airspeed=lambda shown_mps: shown_mps * DENSITY,
            bound_speeds=self._bound_speeds,
            turn_rate_max_rps=math.nan,
        )
        self.limits = ReadLimits(PLAIN, self._bound)
        self.vehicle: Any = SimpleNamespace(identity=VehicleId(1, 2), index=1, autopilot=self.autopilot)

    def _bound_speeds(self, slowest_mps: float, fastest_mps: float) -> None:
        self.speeds_mps = slowest_mps, fastest_mps

    def _bound(self, index: int, accel_mps2: float, turn_rps: float, climb_mps: float) -> None:
        self.bounds = index, accel_mps2, turn_rps, climb_mps

    def model(self, *bounds: tuple[str, float]) -> Any:
        """Return the model after these were reported, None if there are no news."""
        self.limits.apply(self.vehicle, [(key, value, f"{key} as reported") for key, value in bounds])
        news = self.limits.take_news()
        return None if news is None else news[1].model


@pytest.mark.parametrize("key", ["accel_max_mps2", "turn_rate_max_rps", "climb_max_mps"])
def test_the_narrower_of_model_and_parameters_bounds_it(key: str) -> None:
    """Climb and descent bound one key: the smaller of several counts, in any order."""
    for shares, share in (((0.8, 0.6), 0.6), ((0.6, 0.8), 0.6), ((1.5,), 1.0)):
        reported = Reported()
        own = getattr(reported.given, key)
        model = reported.model(*((key, each * own) for each in shares))
        assert getattr(model, key) == pytest.approx(share * own)
        others = {"accel_max_mps2", "turn_rate_max_rps", "climb_max_mps", "speed_min_mps", "speed_max_mps"} - {key}
        assert all(getattr(model, each) == pytest.approx(getattr(reported.given, each)) for each in others)
        assert reported.bounds == (1, model.accel_max_mps2, model.turn_rate_max_rps, model.climb_max_mps)
        assert reported.autopilot.turn_rate_max_rps == model.turn_rate_max_rps
    assert reported.limits.take_news() is None, "they are no news twice"


@pytest.mark.parametrize(("key", "sign"), [("speed_min_mps", 1.0), ("speed_max_mps", -1.0)])
def test_speeds_are_reported_as_indicated_and_only_narrow_those_of_the_model(key: str, sign: float) -> None:
    for off_mps in (1.0, -1.0):
        reported = Reported()
        own_mps = getattr(reported.given, key)
        model = reported.model((key, own_mps / DENSITY + sign * off_mps), (key, own_mps / DENSITY + sign * off_mps / 2))
        assert getattr(model, key) == pytest.approx(own_mps + (sign * DENSITY if off_mps > 0.0 else 0.0))
        assert reported.speeds_mps == pytest.approx((model.speed_min_mps / DENSITY, model.speed_max_mps / DENSITY))


@pytest.mark.parametrize("left_mps", [0.0, -1.0])
def test_where_no_speed_is_left_nothing_is_bounded(left_mps: float) -> None:
    reported = Reported()
    slowest_mps = reported.given.speed_min_mps / DENSITY + 3.0
    assert reported.model(("speed_min_mps", slowest_mps), ("speed_max_mps", slowest_mps + left_mps)) is None
    assert reported.speeds_mps is None
    assert reported.model() is None


def test_what_cannot_be_flown_within_them_is_named_with_who_tells_it() -> None:
    """A path at 22 m/s, and an aircraft that flies 18 m/s at most."""
    reported = Reported()
    assert reported.limits.unflyable() == []
    assert reported.model(("speed_max_mps", 27.0 / DENSITY)) is not None
    assert reported.limits.unflyable() == []
    reported.model(("speed_max_mps", 18.0 / DENSITY))
    (said,) = reported.limits.unflyable()
    assert said.startswith("what vehicles tell (vehicle 2: speed_max_mps as reported) isn't enough for ")
    assert "path.speed_mps: " in said
    assert "; allowed: " in said


@pytest.mark.parametrize(("count", "more"), [(2, ""), (3, ""), (4, "; and 1 more"), (7, "; and 4 more")])
def test_of_what_cannot_be_flown_three_are_named_and_the_others_counted(
    count: int, more: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [SimpleNamespace(key=("path", number), found=f"found {number}", allowed="less") for number in range(count)]
    monkeypatch.setattr(read_limits, "check", lambda _: found)
    reported = Reported()
    reported.model(("climb_max_mps", 1.0))
    (said,) = reported.limits.unflyable()
    each = "; ".join(f"path.{number}: found {number}; allowed: less" for number in range(min(count, 3)))
    assert said == f"what vehicles tell (vehicle 2: climb_max_mps as reported) isn't enough for {each}{more}"
