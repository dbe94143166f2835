"""The effect of orders up to the end of a record."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.record.run_directory import FLUSH_S, RunDirectory
from gcs_formation.record.unfinished import epoch_us, formation_of, nearest_to, read_past, recorded_speedup
from gcs_formation.recorder import Event

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
