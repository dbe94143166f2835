"""The effect of orders up to the end of a record."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation.errors import RecordError
from gcs_formation.fleet.membership import PARTED
from gcs_formation.mission.past_flight import PastFlight
from gcs_formation.phases import Cause
from gcs_formation.record.run_directory import FLUSH_S, RunDirectory
from gcs_formation.record.unfinished import (
    epoch_us,
    formation_of,
    from_ports,
    nearest_to,
    read_past,
    recorded_events,
    recorded_speedup,
    set_before,
    without_vain_attempts,
)
from gcs_formation.recorder import Event, Tick, VehicleLink
from gcs_formation.vehicle.parameter_setting import Change

HOVERS = {
    "vehicles": {"count": 3, "autopilot": "arducopter"},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [500, 0, 30]]},
}


def ordered(*texts: str, accepted: bool = True) -> list[dict[str, Any]]:
    begun = {"kind": "phase", "text": "flying", "t_s": 20.0}
    orders = [
        {"kind": "order", "text": f"{text}: accepted", "t_s": 30.0 + place, "accepted": accepted}
        for place, text in enumerate(texts)
    ]
    return [begun, *orders]


def test_a_formation_that_was_commanded_to_hover_hovers_and_faces_where_it_was_commanded_to():
    scenario = load_scenario(HOVERS)
    assert formation_of(scenario, ordered("speed 0", "heading 90"), 40.0)[1:] == (0.0, pytest.approx(math.pi / 2))
    assert formation_of(scenario, ordered("speed 0", "heading 90", "speed 4"), 40.0)[1:] == (4.0, None)
    assert formation_of(scenario, ordered("speed 0", accepted=False), 40.0)[1:] == (5.0, None)


def test_shapes_and_leaders_are_those_that_were_ordered_last():
    arrangement, *_ = formation_of(load_scenario(HOVERS), ordered("shape line 20", "leader 2", "spacing 25"), 40.0)
    assert (arrangement.shape, arrangement.spacing_m, arrangement.leader) == ("line", 25.0, 1)


def test_who_is_as_near_to_the_leader_to_a_metre_comes_in_the_order_of_the_vehicles():
    north_m = np.array([-30.004, -30.001, 0.0, -28.0, np.nan])
    rows = {
        "network": np.ones(5, dtype=int),
        "vehicle": np.array([2, 3, 1, 4, 5]),
        "north_m": north_m,
        "east_m": np.zeros(5),
        "height_m": np.full(5, 100.0),
    }
    assert [each.system for each in nearest_to(rows, VehicleId(1, 1))] == [1, 4, 2, 3, 5]


@pytest.mark.parametrize(("clock_s", "at_s"), [(500.0, 500.0), (40.0, 90.0 + FLUSH_S), (-1e6, 90.0 + FLUSH_S)])
def test_a_flight_is_resumed_after_its_record_whatever_the_machines_clock_says(
    clock_s: float, at_s: float, tmp_path: Path
) -> None:
    """Without a battery it falls behind while the machine has no power. The last second may not be on the disk."""
    scenario = load_scenario(HOVERS)
    each = [vehicle.vehicle_id for vehicle in scenario.vehicles]
    directory = RunDirectory(tmp_path, scenario, each, 0, overwrite=True)
    for heard_s in (60.0, 90.0):
        directory.event(Event(after(Instant(0), heard_s), "mode", "GUIDED", each[0]))
    directory.close()
    past = read_past(tmp_path, scenario, after(Instant(0), clock_s), take=False)
    assert seconds_between(Instant(0), past.at) == at_s
    assert past.silent_s == pytest.approx(at_s - 90.0 + FLUSH_S)
    assert [past.vehicles[identity].mode for identity in each] == ["GUIDED", None, None]


@pytest.mark.parametrize(("details", "speedup"), [({}, 1.0), ({"speedup": 4.0}, 4.0)])
def test_a_record_says_how_much_faster_than_real_time_it_ran(
    details: dict[str, float], speedup: float, tmp_path: Path
) -> None:
    scenario = load_scenario(HOVERS)
    directory = RunDirectory(tmp_path, scenario, [each.vehicle_id for each in scenario.vehicles], 5, overwrite=True)
    for kind, more in (("mode", {}), ("recording", details), ("mode", {})):
        directory.event(Event(Instant(0), kind, "began", None, more))
    directory.close()
    assert recorded_speedup(tmp_path) == speedup
    assert epoch_us(tmp_path) == 5


SCENARIO = load_scenario(HOVERS)
EACH = [vehicle.vehicle_id for vehicle in SCENARIO.vehicles]
BEGUN_S = 20.0
"""When the path begins on the run's clock; it leads north, and is flown at 5 m/s."""


def event(at_s: float, kind: str, text: str, vehicle: int | None = None, **details: Any) -> Event:
    return Event(after(Instant(0), at_s), kind, text, None if vehicle is None else EACH[vehicle], details)


def tick(at_s: float, leader: int = 0, phase: str = "flying") -> Tick:
    """Return a tick of three copters in a row from the leader southwards, 30 m apart; the third is on the ground."""
    now, mission_s = after(Instant(0), at_s), at_s - BEGUN_S if at_s >= BEGUN_S else math.nan
    links = [VehicleLink(now) for _ in EACH]
    links[2].airborne = False
    made = Tick(now, mission_s, phase, leader, links, [0.1] * 3, [0.1] * 3, [True, True, False])
    along_m = 5.0 * max(0.0, at_s - BEGUN_S)
    made.state = [FlightState(along_m - 30.0 * (each - leader), 0.0, 30.0, *[0.0] * 5) for each in range(3)]
    made.slots_m = [(30.0 * (leader - each), 1.0, 2.0) for each in range(3)]
    made.slots_m[leader] = (math.nan,) * 3
    return made


def recorded(path: Path, events: Sequence[Event] = (), ticks: Sequence[Tick] = ()) -> Path:
    """Record an unfinished run, in place of an earlier one."""
    shutil.rmtree(path)
    directory = RunDirectory(path, SCENARIO, EACH, 5)
    for told in events:
        directory.event(told)
    for made in ticks:
        directory.tick(made)
    directory.close()
    return path


def ticks_to(end_s: float, begin_s: float = BEGUN_S, **more: Any) -> list[Tick]:
    return [tick(begin_s + 0.5 * each, **more) for each in range(round(2.0 * (end_s - begin_s)) + 1)]


HEARD = [event(1.0, "mode", "GUIDED", each) for each in range(3)]
BEGINS = event(BEGUN_S, "phase", "flying", cause="the leader has passed the start of its path")


def past(path: Path, events: Sequence[Event], ticks: Sequence[Tick], at_s: float = 100.0) -> PastFlight:
    return read_past(recorded(path, [*HEARD, *events], ticks), SCENARIO, after(Instant(0), at_s), take=True)


def test_a_flight_goes_on_from_its_last_tick(tmp_path: Path) -> None:
    """The third has parted; the second has led since 30 s, and was in BRAKE last."""
    events = [BEGINS, event(30.0, "order", "leader 2: accepted", accepted=True), event(35.0, "mode", "BRAKE", 1)]
    events.append(event(36.0, "member", f"{PARTED}its pilot", 2))
    found = past(tmp_path, events, [*ticks_to(29.5), *ticks_to(50.0, 30.0, leader=1)])
    assert (found.mission_s, found.path_began) == (30.0, after(Instant(0), BEGUN_S))
    assert (seconds_between(Instant(0), found.at), found.silent_s) == (100.0, 50.0 + FLUSH_S)
    assert [(each.mode, each.parted, each.flew) for each in found.vehicles.values()] == [
        ("GUIDED", False, True),
        ("BRAKE", False, True),
        ("GUIDED", True, False),
    ]
    assert list(found.vehicles) == EACH
    assert found.distance_m == pytest.approx(150.0)
    assert (found.speed_mps, found.heading_rad, found.arrangement.leader) == (5.0, None, 1)
    assert found.slots_m.tolist() == [[30.0, 1.0, 2.0], [0.0, 0.0, 0.0], [-30.0, 1.0, 2.0]]
    assert found.near == (EACH[1], EACH[0], EACH[2])
    assert (found.ending, found.take) == (False, True)


def test_a_distance_along_the_path_is_followed_over_an_interruption(tmp_path: Path) -> None:
    """In 12 s without a tick the leader flew on, at most at twice the planned speed; the last second is a row's."""
    found = past(tmp_path, [BEGINS], [*ticks_to(40.0), *ticks_to(60.0, 52.0)])
    assert found.distance_m == pytest.approx(200.0)
    assert past(tmp_path, [BEGINS], ticks_to(20.5)).distance_m == pytest.approx(0.0, abs=0.1)
    assert past(tmp_path, [BEGINS], ticks_to(23.0)).distance_m == pytest.approx(15.0)
    assembling = past(tmp_path, [], ticks_to(40.0, phase="assembling"))
    assert (assembling.distance_m, assembling.path_began) == (0.0, None), "before the path"


def test_a_flight_is_continued_from_before_attempts_to_resume_it_in_vain(tmp_path: Path) -> None:
    """In the first attempt a vehicle was taken over, in the others none; the last one hasn't ended."""
    begins = [event(at_s, "recording", "goes on") for at_s in (40.0, 60.0, 70.0)]
    taken = event(41.0, "takeover", "taken over, in GUIDED", 1)
    left = event(61.0, "takeover", "left as it is, in LOITER", 2)
    events = [BEGINS, begins[0], taken, begins[1], left, begins[2], event(71.0, "mode", "LAND", 0)]
    flown = [*ticks_to(39.5), *ticks_to(50.0, 42.0), *ticks_to(72.0, 62.0, phase="loitering")]
    found = past(tmp_path, events, flown)
    assert (found.mission_s, found.silent_s) == (30.0, 50.0 + FLUSH_S)
    assert [each.mode for each in found.vehicles.values()] == ["GUIDED"] * 3
    assert not found.ending
    kept, gaps_s = without_vain_attempts(recorded_events(tmp_path)[0])
    assert gaps_s == [(60.0, 70.0), (70.0, math.inf)]
    assert [each["t_s"] for each in kept] == [0.0, 1.0, 1.0, 1.0, 20.0, 40.0, 41.0]
    assert without_vain_attempts(kept[:4]) == (kept[:4], [])


@pytest.mark.parametrize(
    ("text", "kind", "parted"),
    [
        (f"{PARTED}its pilot", "member", True),
        ("joins", "member", False),
        ("left as it is, in LOITER", "takeover", True),
        ("taken over, in GUIDED", "takeover", False),
        ("in LOITER: left to its pilot", "abandoned", True),
        (f"{PARTED}its pilot", "mode", False),
    ],
)
def test_a_vehicle_has_parted_if_that_was_last_said_of_it(
    text: str, kind: str, *, parted: bool, tmp_path: Path
) -> None:
    earlier = event(30.0, "member", "joins" if parted else f"{PARTED}its failsafe", 2)
    events = [earlier, event(31.0, kind, text, 2), event(32.0, "member", f"{PARTED}its pilot", 1)]
    found = past(tmp_path, events[1:] if kind == "mode" else events, ticks_to(33.0))
    assert found.vehicles[EACH[2]].parted is parted
    assert found.vehicles[EACH[1]].parted


@pytest.mark.parametrize(
    ("phases", "recorded_phase", "ending"),
    [
        ((), "flying", False),
        ((), "ending", True),
        ((), "loitering", True),
        ((("flying", Cause.PATH_BEGUN),), "loitering", True),
        ((("ending", Cause.PATH_ENDED),), "flying", True),
        ((("ending", Cause.STOP), ("loitering", Cause.OPENED), ("done", Cause.LOITERED)), "loitering", True),
        ((("ending", Cause.FAILURE), ("loitering", Cause.OPENED), ("failed", Cause.GIVEN_UP)), "loitering", False),
        ((("failed", Cause.NOT_BEGUN),), "ending", False),
        ((("failed", Cause.GIVEN_UP),), "ending", False),
        ((("ending", Cause.FAILURE), ("flying", Cause.PATH_BEGUN), ("ending", Cause.STOP)), "flying", True),
    ],
)
def test_a_flight_was_ending_unless_it_could_not_go_on(
    phases: Sequence[tuple[str, Cause]], recorded_phase: str, *, ending: bool, tmp_path: Path
) -> None:
    """By the first of the phases of its end, or, if the record has none, by that of the last tick."""
    events = [event(40.0 + at, "phase", text, cause=cause.value) for at, (text, cause) in enumerate(phases)]
    assert past(tmp_path, events, ticks_to(38.0, phase=recorded_phase)).ending is ending


def test_of_a_flight_without_a_tick_the_start_is_known(tmp_path: Path) -> None:
    """All that could lead are as in the scenario; who was heard isn't known to have flown."""
    found = past(tmp_path, [event(2.0, "mode", "STABILIZE", 1)], [])
    assert [(each.mode, each.parted, each.flew) for each in found.vehicles.values()] == [
        ("GUIDED", False, False),
        ("STABILIZE", False, False),
        ("GUIDED", False, False),
    ]
    assert math.isnan(found.mission_s)
    assert (found.path_began, found.distance_m, found.speed_mps, found.heading_rad) == (None, 0.0, 5.0, None)
    assert (found.near, found.ending, found.take) == (tuple(EACH), False, True)
    assert found.slots_m.tolist() == [[0.0, 0.0, 0.0]] * 3
    assert found.silent_s == 98.0 + FLUSH_S
    with pytest.raises(RecordError, match=r"found no flight in .*: no vehicle had been heard"):
        read_past(recorded(tmp_path), SCENARIO, Instant(0), take=False)
    (tmp_path / "timeseries.ticks").unlink()
    with pytest.raises(RecordError, match=r"cannot read .*timeseries\.ticks"):
        read_past(tmp_path, SCENARIO, Instant(0), take=False)


def test_without_a_real_leader_none_could_lead(tmp_path: Path) -> None:
    virtual = load_scenario(HOVERS | {"vehicles": [{"id": each, "autopilot": "arducopter"} for each in (1, 2, 3)]})
    recorded(tmp_path, HEARD)
    found = read_past(tmp_path, virtual, Instant(0), take=False)
    assert (found.near, len(found.slots_m)) == ((), 4)
    made = tick(30.0)
    made.leader = -1
    recorded(tmp_path, HEARD, [made])
    found = read_past(tmp_path, virtual, Instant(0), take=False)
    assert (found.near, found.arrangement.leader, found.distance_m) == ((), 0, 0.0)
    np.testing.assert_array_equal(found.slots_m, [[0.0] * 3, [0.0] * 3, [-30.0, 1.0, 2.0], [-60.0, 1.0, 2.0]])


def test_a_flight_of_one_vehicle_behind_a_virtual_leader_goes_on(tmp_path: Path) -> None:
    alone = load_scenario(HOVERS | {"vehicles": [{"id": 1, "autopilot": "arducopter"}]})
    now = after(Instant(0), 30.0)
    made = Tick(now, 10.0, "ending", 0, [VehicleLink(now)] * 2, [0.1] * 2, [0.1] * 2, [True] * 2)
    made.slots_m = [(math.nan,) * 3, (-20.0, 0.0, 0.0)]
    directory = RunDirectory(tmp_path, alone, [None, EACH[0]], 5)
    directory.event(HEARD[0])
    directory.tick(made)
    directory.close()
    found = read_past(tmp_path, alone, now, take=False)
    assert (found.mission_s, found.ending, found.near) == (10.0, True, ())
    assert found.slots_m.tolist() == [[0.0, 0.0, 0.0], [-20.0, 0.0, 0.0]]
    assert found.vehicles[EACH[0]].flew


def test_an_unfinished_record_says_when_it_began_and_any_other_directory_is_refused(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    assert epoch_us(path) == 5
    (path / "events.jsonl").write_text('{"t_s": 0, "kind": "recording", "text": "begins", "epoch_us": "now"}\n')
    with pytest.raises(RecordError, match="found no beginning in"):
        epoch_us(path)
    (path / "events.jsonl").unlink()
    with pytest.raises(RecordError, match="found no beginning in"):
        epoch_us(path)
    (path / "summary.json").write_text("{}")
    with pytest.raises(RecordError, match="that run has come to its end"):
        epoch_us(path)
    with pytest.raises(RecordError, match=r"found no run\.yaml in"):
        epoch_us(path / "other")


def test_an_event_that_was_cut_off_is_left_out_and_said(tmp_path: Path) -> None:
    path = recorded(tmp_path, HEARD)
    assert [each["kind"] for each in recorded_events(path)[0]] == ["recording", "mode", "mode", "mode"]
    assert recorded_events(path)[1] is False
    with (path / "events.jsonl").open("a") as file:
        file.write('{"t_s": 3.0, "kind": "mode"}\n{"t_s": 4.0, "kind": "mode", "text": "AUTO"}\n{"t_s": 5')
    events, cut = recorded_events(path)
    assert ([each["t_s"] for each in events], cut) == ([0.0, 1.0, 1.0, 1.0, 4.0], True)
    assert recorded_events(path / "other") == ((), False)


def test_parameters_that_were_set_and_not_restored_are_known_as_they_were_at_first(tmp_path: Path) -> None:
    def changed(name: str, before: float, after_: float, vehicle: int = 0, **more: Any) -> Event:
        figures = {"name": name, "param_type": 9, "before": before, "after": after_}
        return event(2.0, "parameters", "set", vehicle, **figures, **more)

    events = [
        changed("A", 1.0, 2.0),
        changed("A", 2.0, 3.0),
        changed("B", 4.0, 5.0, 1),
        changed("A", 6.0, 7.0, 1),
        changed("A", 7.0, 6.0, 1, restored=True),
        event(3.0, "parameters", "read", 2, name="A"),
        event(3.0, "mode", "AUTO", 2, name="C", param_type=9, before=1.0, after=2.0),
    ]
    found = set_before(recorded(tmp_path, events))
    assert found == [("1", Change("A", 9, 1.0, 2.0)), ("2", Change("B", 9, 4.0, 5.0))]


def test_ports_at_which_vehicles_answered_are_used_again(tmp_path: Path) -> None:
    """The last one of each endpoint."""
    ports = [("udpout:a:1", 20), ("udpout:b:1", 30), ("udpout:a:1", 40)]
    events = [event(1.0, "port", "answers", endpoint=endpoint, port=port) for endpoint, port in ports]
    events.append(event(2.0, "mode", "AUTO", endpoint="udpout:c:1", port=50))
    assert from_ports(recorded(tmp_path, events)) == {"udpout:a:1": 40, "udpout:b:1": 30}


def test_planned_changes_come_in_the_order_of_time_among_orders() -> None:
    """The path began at 20 s of the run's clock: an order at 35 s comes before a change at 15.5 s of mission time."""
    changes = [{"at_s": 15.5, "shape": "echelon"}, {"at_s": 25.0, "spacing_m": 40}]
    keys = HOVERS | {"duration_s": 90, "formation": {"shape": "line", "spacing_m": 20, "changes": changes}}
    scenario = load_scenario(keys, flown=True)
    events = [{"kind": "phase", "text": "flying", "t_s": 20.0}]
    events.append({"kind": "order", "text": "shape arrow: accepted", "t_s": 35.0, "accepted": True})
    found = [formation_of(scenario, events, mission_s)[0] for mission_s in (15.4, 15.5, 24.9, 25.0)]
    assert [(each.shape, each.spacing_m) for each in found] == [
        ("arrow", 20.0),
        ("echelon", 20.0),
        ("echelon", 20.0),
        ("echelon", 40.0),
    ]
    before = formation_of(scenario, events[1:], 15.5)[0]
    assert before.shape == "echelon", "orders before the path come before its changes"
