"""Gains are reduced as a loop's delay nears its margin, in whole flights under the virtual clock."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcs_formation.testing.flight_plan import Formation
from gcs_formation.testing.flown_flight import FlownFlight

Fly = Callable[..., FlownFlight]
PAPER = Path(__file__).parents[4] / "configs" / "paper.yaml"


def delayed(delay_ms: float) -> list[dict[str, Any]]:
    """Return changes of the links: a delay each way from 2 s to 42 s."""
    return [{"at_s": 2, "delay_ms": delay_ms}, {"at_s": 42, "delay_ms": 0}]


BEYOND = delayed(700)
"""A loop delay of 1.5 s: the x loop loses stability at 0.87 s."""


@pytest.fixture
def fly(tmp_path: Path) -> Fly:
    """Fly a leader and a follower that begins off its slot, without prediction, with these changes of the links."""

    def run(changes: list[dict[str, Any]], duration_s: float = 60, **law: Any) -> FlownFlight:
        plain: dict[str, Any] = {
            "duration_s": duration_s,
            "vehicles": {"count": 2},
            "start": {"in_air": True, "run_in_s": 10, "offset_m": [2, 1, 1]},
            "finish": {"loiter_s": 0},
            "formation": {"shape": "line", "spacing_m": 30},
            "law": {"delay_compensation": False} | law,
            "links": {"changes": changes},
            "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [8800, 0, 100]]},
        }
        return Formation((), tmp_path)(plain).fly()

    return run


def gains_events(flown: FlownFlight) -> list[dict[str, Any]]:
    lines = (flown.directory / "events.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if event["kind"] == "gains"]


@pytest.mark.slow
@pytest.mark.parametrize(("law", "delay_ms"), [("fuzzy_pid", 700), ("consensus", 900)])
def test_beyond_the_margin_the_formation_diverges_unless_gains_come_down(fly: Fly, law: str, delay_ms: float) -> None:
    """The consensus of two loses stability at 1.38 s."""
    warned, degraded = (fly(delayed(delay_ms), type=law, on_delay=way) for way in ("warn", "degrade"))
    with pytest.raises(AssertionError, match="more than 1 m"):
        warned.stays_within(1.0, from_s=32, to_s=42)
    degraded.stays_within(1.0, from_s=32)
    assert not gains_events(warned)


@pytest.mark.slow
def test_gains_come_down_until_the_margin_holds_and_return_with_the_delay(fly: Fly) -> None:
    steps = [{"at_s": 2, "delay_ms": 700}, {"at_s": 27, "delay_ms": 0}]
    flown = fly(steps, duration_s=44, type="pid", on_delay="degrade", speed={"kp": 3.0})
    lowered, *_, restored = gains_events(flown)
    assert lowered["used"] < 0.9
    assert lowered["bandwidth_speed"] < 1.0
    assert [restored[f"bandwidth_{channel}"] for channel in ("speed", "heading", "height")] == [1.0, 1.0, 1.0]
    series = flown.series(2)
    share = series["kp_speed"] / 3.0
    time_s = series["mission_time_s"]
    assert share[(time_s > 20) & (time_s < 27)].max() < 0.7
    assert share[time_s > 43.0].min() > 0.99


@pytest.mark.slow
def test_no_setpoint_jumps_as_gains_move_over_a_second(fly: Fly) -> None:
    series = fly(BEYOND, type="pid", on_delay="degrade").series(2)
    for gain in ("kp_speed", "ki_speed", "kd_speed"):
        values = series[gain][np.isfinite(series[gain])]
        assert np.abs(np.diff(values)).max() < 0.15 * np.ptp(values)


@pytest.mark.slow
def test_nothing_comes_down_in_flights_that_are_well_inside(tmp_path: Path) -> None:
    """The paper's flight, without prediction over 150 ms, and with it over 500 ms and a scatter of 10 ms."""
    paper = Formation((), tmp_path)(PAPER).with_keys(law__on_delay="degrade")
    plain = paper.with_keys(law__delay_compensation=False).with_link(delay_ms=150)
    predicted = paper.with_link(delay_ms=500, jitter_ms=10, loss=0.02)
    for plan in (plain, predicted):
        flown = plan.fly(until=40)
        assert not gains_events(flown)
        assert flown.figures["stability"]["margin_used"] < 0.8


@pytest.mark.slow
def test_a_follower_beyond_its_margin_loiters_where_that_is_asked_for_and_comes_back_with_the_delay(fly: Fly) -> None:
    """The delay is the mean of the last 4 s of round trips; the margin is checked once a second."""
    flown = fly([{"at_s": 2, "delay_ms": 700}, {"at_s": 12, "delay_ms": 0}], duration_s=40, on_delay="hold")
    events = [json.loads(line) for line in (flown.directory / "events.jsonl").read_text().splitlines()]
    (begun_s,) = [event["t_s"] for event in events if event["text"] == "flying"]
    near, clear = (event["t_s"] - begun_s for event in events if event["kind"] == "delay_margin")
    assert 2.0 < near < 8.0
    (reported_s,) = [event["t_s"] - begun_s for event in events if event["text"] == "told to loiter"]
    assert near <= reported_s < 8.0
    assert 12.0 < clear < 18.0
    assert events[-1]["text"] == "done"
    last = [event["text"] for event in events if event["kind"] == "member" and event.get("vehicle") == "2"][-1]
    assert last == "flying in formation"


@pytest.mark.slow
def test_a_hold_that_lasts_is_bounded_and_its_follower_comes_back_with_lower_gains(fly: Fly) -> None:
    """It used to circle to the end, the leader flying on: 916 m in a minute."""
    flown = fly([{"at_s": 2, "delay_ms": 700}], duration_s=200, on_delay="hold")
    events = [json.loads(line) for line in (flown.directory / "events.jsonl").read_text().splitlines()]
    (begun_s,) = [event["t_s"] for event in events if event["text"] == "flying"]
    (reported_s,) = [event["t_s"] - begun_s for event in events if event["text"] == "told to loiter"]
    (back_s,) = [
        event["t_s"] - begun_s for event in events if event["text"].startswith("was held for 20 s by its dela")
    ]
    assert back_s - reported_s == pytest.approx(20.0, abs=1.5)
    assert gains_events(flown)
    flown.stays_within(1.0, from_s=190)
