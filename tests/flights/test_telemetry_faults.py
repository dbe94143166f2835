"""Telemetry that can't be true, in flight: found, said, and flown around; nobody comes near anybody by truth."""

import json

import pytest

from formation_scenario import ScenarioError, load_scenario
from gcs_formation import Flight, run

AT_S = 5.0
SCENARIO = {
    "duration_s": 25.0,
    "start": {"in_air": True},
    "finish": {"loiter_s": 0},
    "vehicles": {"count": 4},
    "formation": {"shape": "diamond", "spacing_m": 30},
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [500, 0, 100], [1100, 300, 110]]},
}


@pytest.fixture
def fly(tmp_path):
    """Return a flight with one fault of telemetry: its summary, and its events after the fault began."""

    def flown(who, quantity, effect, amount=None, **keys):
        fault = {"at_s": AT_S, "vehicles": who, "kind": "telemetry", "quantity": quantity, "effect": effect}
        fault |= {} if amount is None else {"amount": amount}
        summary = run(SCENARIO | {"faults": [fault]} | keys, clock="virtual", out=tmp_path / "run").to_dict()
        events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
        begun_s = next(each["t_s"] for each in events if each["kind"] == "fault")
        return summary, [each | {"after_s": each["t_s"] - begun_s} for each in events if each["t_s"] >= begun_s]

    return flown


def health(events):
    return [(each["vehicle"], each["quantity"], each["healthy"]) for each in events if each["kind"] == "health"]


def test_a_frozen_position_is_found_within_a_second_and_not_chased(fly):
    summary, events = fly([3], "position", "freeze")
    assert health(events)[0] == ("3", "position", False)
    left = next(each for each in events if each["kind"] == "member")
    assert "doesn't move by its velocity" in left["text"]
    assert left["after_s"] < 1.0
    assert summary["safety"]["min_separation_m"] > 25.0
    assert all(summary["followers"][who]["error_x_m"]["max"] < 0.2 for who in ("2", "4"))


def test_a_leader_whose_position_is_frozen_is_replaced(fly):
    summary, events = fly([1], "position", "freeze")
    assert any("leads the formation" in each["text"] for each in events)
    assert summary["safety"]["min_separation_m"] > 15.0


@pytest.mark.slow
@pytest.mark.parametrize("vehicles", [[3], "all"])
@pytest.mark.parametrize("amount", [14.0, -20.0])
def test_a_height_that_jumps_changes_no_height_by_truth(fly, vehicles, amount):
    summary, events = fly(vehicles, "height", "offset", amount)
    assert ("3", "height", False) in health(events)
    assert summary["safety"]["min_clearance_m"] > 90.0
    assert summary["path"]["leader"]["height_m"]["max"] < 1.0
    assert summary["followers"]["3"]["error_z_m"]["max"] < 1.0


@pytest.mark.parametrize(
    ("quantity", "effect", "amount"),
    [
        pytest.param("velocity", "zero", None, marks=pytest.mark.slow),
        pytest.param("airspeed", "nan", None, marks=pytest.mark.slow),
        pytest.param("attitude", "nan", None, marks=pytest.mark.slow),
        pytest.param("attitude", "offset", 0.5, marks=pytest.mark.slow),
        pytest.param("stamps", "offset", 0.5, marks=pytest.mark.slow),
        ("position", "offset", [0, 20, 0]),
    ],
)
def test_what_the_other_quantities_carry_is_flown_without(fly, quantity, effect, amount):
    summary, events = fly([3], quantity, effect, amount)
    assert all(each["kind"] != "member" for each in events)
    assert summary["followers"]["3"]["error_x_m"]["max"] < 0.5
    assert summary["followers"]["3"]["error_y_m"]["max"] < 0.5
    if quantity != "airspeed":  # of which `sensor` tells
        assert ("3", quantity, False) in health(events)


@pytest.mark.slow
def test_a_vehicle_comes_back_once_it_is_consistent_again(fly):
    fault = {"at_s": AT_S, "for_s": 5.0, "vehicles": [3], "kind": "telemetry"}
    fault |= {"quantity": "position", "effect": "drift", "amount": [0, 6, 0]}
    _, events = fly([3], "position", "duplicate", faults=[fault])
    assert [each["text"] for each in events if each["kind"] == "member"][-1] == "flying in formation"
    assert health(events)[-1] == ("3", "position", True)


COPTERS = {
    "vehicles": [
        {"id": i, "role": "follower" if i > 1 else "leader", "autopilot": "arducopter", "model": "arducopter"}
        for i in (1, 2, 3, 4)
    ],
    "formation": {"shape": "diamond", "spacing_m": 20},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [500, 0, 60]]},
}


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "amount"), [("scale", 0.5), ("sign", None)])
def test_a_multirotors_velocity_is_compared_with_what_was_commanded(fly, effect, amount):
    summary, events = fly([1], "velocity", effect, amount, **COPTERS)
    assert health(events) == [("1", "velocity", False)]
    assert all(each["kind"] != "member" for each in events)
    assert summary["safety"]["min_separation_m"] > 20.0


@pytest.mark.slow
@pytest.mark.parametrize("vehicles", [[1], "all"])
def test_a_multirotors_heading_that_jumps_turns_no_slot(fly, vehicles):
    """The leader hovers at its path's end: where its nose points, slots lie."""
    path = {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [60, 0, 60]]}
    summary, events = fly(vehicles, "attitude", "offset", 0.5, **COPTERS | {"path": path})
    assert health(events)[0] == ("1", "attitude", False)
    assert events[1]["after_s"] < 2.0
    assert all(each["kind"] != "member" for each in events)
    assert summary["safety"]["min_separation_m"] > 27.0


@pytest.mark.slow
def test_a_multirotor_that_brakes_without_a_position_is_kept_clear_of(fly):
    summary, events = fly([1], "position", "missing", duration_s=22.0, **COPTERS)
    assert any("leads the formation" in each["text"] for each in events)
    assert summary["safety"]["min_separation_m"] > 10.0


@pytest.mark.slow
def test_where_a_multirotor_stopped_is_kept_clear_of_half_a_minute_later_too(fly):
    """It says neither its position nor its mode any more; the others end their flight around it."""
    faults = [
        {"at_s": at_s, "vehicles": [1], "kind": "telemetry", "quantity": quantity, "effect": "missing"}
        for at_s, quantity in ((23.7, "heartbeat"), (24.2, "position"))
    ]
    path = {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [120, 0, 60], [240, 60, 65], [500, 60, 65]]}
    keys = COPTERS | {"path": path, "seed": 5, "duration_s": 51.7, "faults": faults}
    summary, _ = fly([1], "position", "missing", **keys)
    assert summary["safety"]["min_separation_m"] > 10.0


@pytest.mark.slow
@pytest.mark.parametrize("vehicles", [[3], "all"])
def test_multirotors_whose_positions_scatter_keep_their_slots(fly, vehicles):
    summary, events = fly(vehicles, "position", "noise", 10.0, **COPTERS)
    assert ("3", "position", False) in health(events)
    assert all(each["kind"] != "member" for each in events)
    assert summary["safety"]["min_separation_m"] > 18.0


@pytest.mark.slow
def test_stamps_that_run_too_fast_for_a_while_displace_none(fly):
    fault = {"at_s": AT_S, "for_s": 4.0, "vehicles": [3], "kind": "telemetry"}
    fault |= {"quantity": "stamps", "effect": "drift", "amount": 0.3}
    _, events = fly([3], "position", "duplicate", faults=[fault])
    assert ("3", "stamps", False) in health(events)
    assert all("has jumped" not in each["text"] for each in events)
    assert all(each["kind"] != "member" for each in events)


@pytest.mark.slow
@pytest.mark.parametrize(("slot_m", "leaves"), [([-30, 30, 0], False), ([-32, 0, 40], True)])
def test_a_height_known_by_its_climb_rate_is_flown_with_unless_slots_lie_above_one_another(fly, slot_m, leaves):
    slots = {2: [-30, 0, 0], 3: slot_m, 4: [-70, 0, 0]}
    formation = {"shape": "custom", "slots_m": slots}
    _, events = fly([3], "height", "drift", 3.0, formation=formation, duration_s=14.0)
    assert health(events)[0] == ("3", "height", False)
    assert any(each["kind"] == "member" for each in events) is leaves


@pytest.mark.slow
def test_a_flight_without_faults_has_no_event_of_health(fly):
    _, events = fly([3], "position", "duplicate", links={"default": {"delay_ms": 300, "jitter_ms": 20, "loss": 0.05}})
    assert health(events) == []


@pytest.mark.slow
def test_a_program_injects_them_too():
    reported = list[str]()
    with Flight(SCENARIO | {"duration_s": 12.0}, clock="virtual") as flight:
        for tick in flight:
            if abs(tick.mission_time_s - 3.0) < 1e-6:
                flight.inject("telemetry", vehicle=3, quantity="position", effect="freeze", for_s=5)
            reported += [each.text for each in tick.events if each.kind == "health"]
    assert "position not believed" in reported[0]


@pytest.mark.parametrize(
    ("keys", "place"),
    [
        ({"kind": "telemetry", "quantity": "position"}, "faults.0.effect"),
        ({"kind": "telemetry", "effect": "freeze"}, "faults.0.quantity"),
        ({"kind": "telemetry", "quantity": "height", "effect": "offset"}, "faults.0.amount"),
        ({"kind": "freeze", "quantity": "height"}, "faults.0.quantity"),
        ({"kind": "freeze", "for_s": 3, "until_s": 8}, "faults.0.for_s"),
        ({"kind": "crash", "for_s": 3}, "faults.0.for_s"),
    ],
)
def test_keys_that_make_no_fault_are_refused_where_they_stand(keys, place):
    with pytest.raises(ScenarioError, match=place):
        load_scenario(SCENARIO | {"faults": [{"at_s": AT_S, **keys}]})
