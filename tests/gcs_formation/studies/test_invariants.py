"""Each invariant detects its violation in a valid record that was tampered with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gcs_formation
from airlink import mavlink as m
from formation_scenario import load_scenario
from gcs_formation.studies.invariants import FlightRecord, broken, read_record
from tests.flights.conftest import scenario

Tamper = Callable[[FlightRecord], FlightRecord]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> FlightRecord:
    plan = load_scenario(scenario(duration_s=20))
    out = tmp_path_factory.mktemp("flight") / "run"
    gcs_formation.run(plan, clock="virtual", out=out)
    return read_record(out, plan)


def with_column(flown: FlightRecord, name: str, row: int, value: float) -> FlightRecord:
    """Return a record with one value changed, in a row of the path."""
    column = flown.columns[name].copy()
    column[np.flatnonzero(flown.flying)[row]] = value
    return replace(flown, columns={**flown.columns, name: column})


def collided(flown: FlightRecord) -> FlightRecord:
    columns = dict(flown.columns)
    for name in ("true_north_m", "true_east_m", "true_height_m"):
        columns[name] = np.repeat(columns[name][::3], 3)
    return replace(flown, columns=columns)


def too_fast(flown: FlightRecord) -> FlightRecord:
    index = next(i for i, c in enumerate(flown.sent) if c.command == m.MAV_CMD_GUIDED_CHANGE_SPEED)
    return replace(flown, sent=(*flown.sent[:index], flown.sent[index].but(param2=28.1)))


def without_a_tick(flown: FlightRecord) -> FlightRecord:
    kept = np.ones(flown.columns["t_s"].size, dtype=bool)
    kept[30:33] = False
    return replace(flown, columns={name: values[kept] for name, values in flown.columns.items()})


def with_a_frame_more(flown: FlightRecord) -> FlightRecord:
    received = flown.summary["received"]
    return replace(flown, summary={**flown.summary, "received": received | {"frames": received["frames"] + 1}})


def unacknowledged(flown: FlightRecord) -> FlightRecord:
    event = {"schema": 1, "t_s": 1.0, "kind": "unacknowledged", "text": "has not acknowledged", "vehicle": "2"}
    return replace(flown, events=(*flown.events, event))


def test_a_sound_record_breaks_nothing(sound: FlightRecord) -> None:
    assert broken(sound) == []
    assert len(sound.sent) >= 3 * 20 * 3
    # Three vehicles, commanded speed, height and heading at least once a second for more than twenty seconds.


@pytest.mark.parametrize(
    ("tamper", "said"),
    [
        (collided, "separation: vehicles 1 and 2 were 0 m apart before the path (connecting)"),
        (too_fast, "was sent 28.100 m/s; allowed: 16 to 28"),
        (lambda flown: with_column(flown, "setpoint_heading_rad", -1, np.nan), "setpoint_heading_rad isn't a number"),
        (lambda flown: with_column(flown, "true_north_m", 5, np.inf), "true_north_m isn't a number in 1 rows"),
        (unacknowledged, "acknowledged: 2: has not acknowledged"),
        (lambda flown: replace(flown, frames=flown.frames - 1), "recorded: the log has"),
        (with_a_frame_more, "recorded: 1 frames more than were taken or refused came in"),
        (without_a_tick, "ticks 0.200 s apart, not 0.1"),
        (lambda flown: with_column(flown, "error_y_m", -1, -1.5), "regained: vehicle 3 was 1.50 m from its slot"),
    ],
)
def test_what_is_broken_is_named(sound: FlightRecord, tamper: Tamper, said: str) -> None:
    assert said in "\n".join(broken(tamper(sound)))


def test_a_vehicle_that_a_delay_of_seconds_keeps_unheard_in_the_calm_need_not_be_in_its_slot(
    sound: FlightRecord,
) -> None:
    keys = scenario(duration_s=20, links={"changes": [{"at_s": 10, "distribution": "normal"}]})
    off = replace(with_column(sound, "error_y_m", -1, -1.5), scenario=load_scenario(keys))
    of_the_last = off.columns["vehicle"] == 3

    def with_delay(sent_s: float, mean_s: float) -> FlightRecord:
        late = of_the_last & (off.columns["mission_time_s"] > sent_s)
        row = int(np.argmax(late[off.flying]))
        return with_column(off, "injected_delay_s", row, mean_s)

    assert broken(with_delay(9.0, 2.0)) == []
    for received in (with_delay(9.0, 0.4), with_delay(3.0, 2.0), with_delay(11.0, 2.0)):
        assert "regained: vehicle 3" in "\n".join(broken(received))


def test_a_flight_may_end_before_its_time_at_its_path_s_end_alone(sound: FlightRecord) -> None:
    def flown_of(**keys: Any) -> str:
        return "\n".join(broken(replace(sound, scenario=load_scenario(scenario(duration_s=30, **keys)))))

    leads = sound.flying & (sound.columns["leads"] > 0)
    north_m = float(sound.columns["true_north_m"][leads][-1])
    assert "recorded: the flight ends at 20.0 s of 30" in flown_of()
    assert flown_of(path={"speed_mps": 22, "waypoints_m": [[0, 0, 100], [north_m, 0, 100]]}) == ""
