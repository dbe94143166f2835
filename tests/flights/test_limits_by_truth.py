"""Limits of `safety` and distances from the path, against recomputation from the vehicles' own truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formation_scenario import load_scenario
from gcs_formation.app.result_text import summary_text
from gcs_formation.report import load_run, page_parts
from tests.flights.conftest import Fly, scenario

LIFT = {"at_s": 3, "vehicles": "all", "velocity_mps": [0, 0, -3.5]}
"""Air that rises faster than anybody can sink."""
BENDS = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [500, 0, 100], [1000, 350, 108], [1600, 350, 108]]}


def begun_s(tmp_path: Path) -> float:
    lines = (tmp_path / "run" / "events.jsonl").read_text().splitlines()
    events = [json.loads(line) for line in lines]
    return float(next(event["t_s"] for event in events if event["kind"] == "phase" and event["text"] == "flying"))


@pytest.mark.slow
def test_separation_is_the_vehicles_whatever_the_station_s_ticks_did(fly: Fly, kept_truth):
    """Two vehicles pass each other between two ticks, 2 s apart."""
    gust = {"at_s": 5, "until_s": 6.5, "vehicles": [2], "velocity_mps": [0, 15, 0]}
    summary = fly(law={"rate_hz": 0.5}, disturbances=[gust], duration_s=14).to_dict()
    (truth,) = kept_truth
    places = np.stack([truth[name] for name in ("north_m", "east_m", "height_m")])
    distance_m = [np.linalg.norm(places[..., i] - places[..., j], axis=0).min() for i in range(3) for j in range(i)]
    assert summary["safety"]["min_separation_m"] == pytest.approx(min(distance_m), abs=2e-3)
    assert summary["safety"]["unseen_s"] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("virtual", [False, True])
def test_the_leader_s_distance_from_its_path_is_that_of_its_true_places(fly: Fly, tmp_path: Path, virtual: bool):
    """The nearest of points 0.05 m apart, and where the planned speed puts it; the column of a virtual leader."""
    import pyarrow.parquet as pq  # noqa: PLC0415

    keys: dict[str, Any] = {"path": BENDS, "duration_s": 50}
    keys |= {"vehicles": [{"id": 1}, {"id": 2}]} if virtual else {}
    gust = {"at_s": 20, "until_s": 23, "vehicles": "all", "velocity_mps": [0, 6, -1]}
    wanted = [{"metric": "path_across_m.max", "from_s": 10, "to_s": 30, "below": 100}]
    summary = fly(**keys, disturbances=[gust], expect=wanted)
    rows = pq.read_table(tmp_path / "run" / "timeseries.parquet")
    of = {name: rows.column(name).to_numpy() for name in rows.column_names}
    own = (of["vehicle"] == 1) & (rows.column("phase").to_numpy() == "flying")
    names = ("leader_north_m", "leader_east_m", "leader_height_m") if virtual else (
        "true_north_m", "true_east_m", "true_height_m")  # fmt: skip
    mission_s, (north_m, east_m, height_m) = of["mission_time_s"][own], (of[name][own] for name in names)
    at_m = np.arange(-10.0, 1300.0, 0.05)
    point = load_scenario(scenario(**keys)).leader_path.at(at_m)
    near = [int(np.hypot(point.north_m - n, point.east_m - e).argmin()) for n, e in zip(north_m, east_m, strict=True)]
    across_m = np.hypot(point.north_m[near] - north_m, point.east_m[near] - east_m)
    expected = {
        "across_m": across_m,
        "along_m": at_m[near] - 22.0 * mission_s,
        "height_m": point.height_m[near] - height_m,
    }
    found = summary.to_dict()["path"]["leader"]
    for name, values in expected.items():
        assert found[name]["max"] == pytest.approx(np.abs(values).max(), abs=0.03), name
        assert found[name]["rms"] == pytest.approx(np.sqrt(np.mean(values**2)), abs=0.03), name
    window = (mission_s >= 10) & (mission_s <= 30)
    assert summary.verdicts[0].value == pytest.approx(across_m[window].max(), abs=0.03)


@pytest.mark.parametrize(("allowed_m", "safe"), [pytest.param(50, True, marks=pytest.mark.slow), (10, False)])
def test_a_leader_off_its_path_for_10_s_is_unsafe(fly: Fly, allowed_m: float, safe: bool):
    step = {"at_s": 3, "vehicles": "all", "velocity_mps": [0, 8, 0]}
    summary = fly(disturbances=[step], duration_s=30, safety={"path_distance_m": allowed_m})
    figures = summary.to_dict()
    assert 25.0 < figures["path"]["leader"]["across_m"]["max"] < 45.0
    assert figures["path"]["centre"]["across_m"]["max"] == pytest.approx(
        figures["path"]["leader"]["across_m"]["max"], rel=0.05
    )
    assert (figures["safety"]["violations"] == 0, summary.held is not False) == (safe, safe)
    said = " ".join(figures["unsafe"])
    assert safe or ("off its path" in said and "safety.path_distance_m" in said)


@pytest.mark.slow
def test_who_takes_the_lead_beside_the_path_may_be_as_far_from_it_until_it_has_come_near(fly: Fly):
    """A follower 90 m aside leads from 4 s on: it flies to the path, as ordered, which takes longer than 10 s."""
    formation = {"shape": "custom", "slots_m": {2: [-30, 90, 0], 3: [-30, -40, 0]}}
    orders = [{"at_s": 4, "order": "leader 2"}]
    summary = fly(formation=formation, orders=orders, duration_s=40, safety={"path_distance_m": 20})
    figures = summary.to_dict()
    assert figures["path"]["leader"]["across_m"]["max"] > 80.0
    assert figures["unsafe"] == []


def test_steps_that_the_scenario_adds_to_its_setpoints_lead_off_the_path_as_planned(fly: Fly):
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
    path["steps"] = [{"at_s": 3, "for_s": 14, "height_m": 30}]
    summary = fly(path=path, duration_s=30, safety={"path_distance_m": 10})
    assert summary.to_dict()["path"]["leader"]["height_m"]["max"] > 20.0
    assert summary.to_dict()["unsafe"] == []


def test_what_is_printed_and_shown_says_over_what_a_figure_is_taken(fly: Fly, tmp_path: Path):
    """The whole flight's clearance stands apart from a window's, the start's error from that after settling."""
    summary = fly(duration_s=4)
    text, cards = summary_text(summary, tmp_path), page_parts.cards(load_run(tmp_path / "run"))
    assert "steady x" in text
    assert "max and rms from t = 0 on, steady: from 30 s after settling on" in text
    assert "from take-off to the end: least separation" in text
    assert "from the path, rms/max m: the leader across 0.00/0.00" in text
    assert cards.count("whole flight, take-off and end included") == 2
    assert "Leader from its path" in cards
    assert "Formation&#x27;s centre" in page_parts.from_path(summary.to_dict())
