"""`gcs_formation.Flight`: flights that a program steps under the virtual clock."""

from __future__ import annotations

import asyncio
import math
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import yaml

import gcs_formation
from gcs_formation import Flight, OrderError, ScenarioError
from tests.flights.conftest import scenario
from tests.processes import events_of

RECORD = ("run.yaml", "flight.tlog", "timeseries.parquet", "events.jsonl")


def same(one: Path, other: Path) -> bool:
    """Return whether two runs have the same bytes, and the same figures but for those of the machine."""
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in RECORD)


def flight_orders(run: Path) -> list[dict[str, Any]]:
    """Return what run.yaml records of a program."""
    found: list[dict[str, Any]] = yaml.safe_load((run / "run.yaml").read_text())["orders"]
    return found


def figures(summary: gcs_formation.Summary) -> dict[str, Any]:
    """Return the figures that don't depend on the machine."""
    found = summary.to_dict()
    del found["wall_s"], found["real_time_factor"], found["control"]["compute_ms"]
    return found


def test_a_stepped_flight_without_orders_has_the_bytes_of_run_and_gives_every_row(tmp_path: Path) -> None:
    keys: dict[str, Any] = {"clock": "virtual", "until": 1.0}
    summary = gcs_formation.run(scenario(seed=3), out=tmp_path / "run", **keys)
    with Flight(scenario(), seed=3, out=tmp_path / "stepped", **keys) as flight:
        ticks = list(flight)
        assert {tick.phase for tick in ticks} == {"connecting", "assembling", "flying"}
        ticks += flight.ending()
        assert ticks[-1].phase == "loitering"
    assert same(tmp_path / "run", tmp_path / "stepped")
    assert len(ticks) == pq.read_table(tmp_path / "run" / "timeseries.parquet").num_rows / 3
    assert figures(flight.summary) == figures(summary)
    assert [tick.number for tick in ticks] == list(range(1, len(ticks) + 1))
    assert {tick.skipped for tick in ticks} == {0}
    begun = [tick.mission_time_s for tick in ticks if not math.isnan(tick.mission_time_s)]
    assert begun[0] == pytest.approx(0.0, abs=0.1)


def test_what_a_program_does_is_in_run_yaml_which_repeats_the_flight_byte_for_byte(tmp_path: Path) -> None:
    with Flight(scenario(), clock="virtual", seed=3, out=tmp_path / "first") as flight:
        flight.link(3, jitter_ms=5)
        for tick in flight:
            if tick.number == 3:
                flight.link(2, delay_ms=200, loss=0.1, uplink={"reorder": True})
                flight.disturb("sine", 2, velocity_mps=[0, 0.5, 0], period_s=8)
                flight.disturb("dryden", wind_6m_mps=5, for_s=4)
                flight.inject("freeze", vehicle=3, for_s=0.5)
            if tick.number == 60:
                flight.tell("shape line 40")
                with pytest.raises(OrderError, match="refused"):
                    flight.tell("speed 100")
            if tick.number == 70:
                break
    orders = flight_orders(tmp_path / "first")
    assert [each["at_tick"] for each in orders] == [0, 3, 3, 3, 3, 60, 60, 70]
    assert [each["order"] for each in orders if "order" in each] == ["shape line 40", "speed 100", "loiter"]
    again = gcs_formation.run(tmp_path / "first" / "run.yaml", clock="virtual", out=tmp_path / "again")
    assert same(tmp_path / "first", tmp_path / "again")
    assert figures(again) == figures(flight.summary)
    faults = [each["text"] for each in events_of(tmp_path / "again") if each["kind"] == "fault"]
    assert faults == ["freeze", "freeze is over"]


def test_links_change_at_once_and_once_and_their_delay_is_measured(tmp_path: Path) -> None:
    with Flight(scenario(), out=tmp_path / "run", until=9) as flight:
        for tick in flight:
            flight.link([2], delay_ms=150)
            if tick.number > 70:
                flight.inject("freeze", vehicle=3)
            if tick.number == 60:
                assert tick.vehicles[2].delay_s == pytest.approx(0.15, abs=0.02)
                assert tick.vehicles[3].delay_s < 0.02
    assert flight.summary.to_dict()["links"]["2"]["injected_delay_ms"] == pytest.approx(150.0, abs=15.0)
    assert flight.summary.to_dict()["links"]["3"]["injected_delay_ms"] == 0.0
    orders = flight_orders(tmp_path / "run")
    assert [each["at_tick"] for each in orders] == [1, 71], "what is so already isn't done again"


def test_a_tick_shows_every_vehicle_and_the_events_since_the_last(tmp_path: Path) -> None:
    kinds = set[str]()
    with Flight(scenario(), out=tmp_path / "run", until=1.0) as flight:
        for tick in flight:
            kinds |= {event.kind for event in tick.events}
            if tick.mission_time_s > 0.5:
                break
    assert {"phase", "ready", "member"} <= kinds
    assert (tick.phase, tick.leader) == ("flying", 1)
    leader, follower = tick.vehicles[1], tick.vehicles[2]
    assert leader.state.north_m == pytest.approx(22.0 * tick.mission_time_s, abs=5.0)
    assert all(math.isnan(each) for each in leader.error_m)
    assert max(map(abs, follower.error_m)) < 3.0
    assert follower.setpoint[2] == pytest.approx(100.0, abs=2.0)
    assert 0.0 < follower.margin_used < 1.0
    assert follower.active
    assert not follower.yielding


@pytest.mark.parametrize("leaves", ["break", "exception"])
def test_leaving_early_ends_the_flight_in_order(tmp_path: Path, leaves: str) -> None:
    flight = Flight(scenario(), out=tmp_path / "run")
    with pytest.raises(ZeroDivisionError) if leaves == "exception" else nullcontext(), flight:
        for tick in flight:
            if tick.number == 50 and leaves == "exception":
                raise ZeroDivisionError
            if tick.number == 50:
                break
    texts = [(each["kind"], each["text"]) for each in events_of(tmp_path / "run")]
    assert ("order", "loiter: accepted") in texts
    assert texts[-1] == ("phase", "done")
    assert flight_orders(tmp_path / "run") == [{"at_tick": 50, "order": "loiter"}]
    assert (tmp_path / "run" / "summary.json").is_file()
    assert flight.summary.run_dir == tmp_path / "run"


def test_what_cannot_be_done_is_refused_as_elsewhere_and_isnt_recorded(tmp_path: Path) -> None:
    with Flight(scenario(), out=tmp_path / "run") as flight:
        next(flight)
        with pytest.raises(OrderError, match=r"found shape 'lin'; .*did you mean 'line'"):
            flight.tell("shape lin")
        with pytest.raises(ScenarioError, match=r"link.vehicles.0: found 9; allowed: 1, 2, 3"):
            flight.link(9, delay_ms=3)
        with pytest.raises(ScenarioError, match=r"link: found an unknown key 'delay'|link.delay: .*delay_ms"):
            flight.link(2, delay=3)
        with pytest.raises(ScenarioError, match=r"link: found a change of nothing"):
            flight.link(2)
        with pytest.raises(ScenarioError, match=r"mean_burst: found 1 with a loss of 0\.9"):
            flight.link(2, loss=0.9, mean_burst=1)
        with pytest.raises(ScenarioError, match=r"fault.kind: found 'freez'; .*did you mean 'freeze'"):
            flight.inject("freez", vehicle=3)
        with pytest.raises(ScenarioError, match=r"fault.until_s: found an end of a crash"):
            flight.inject("crash", vehicle=3, for_s=3)
        with pytest.raises(ScenarioError, match=r"disturbance: found neither"):
            flight.disturb("dryden")
    orders = flight_orders(tmp_path / "run")
    assert orders == [{"at_tick": 1, "order": "loiter"}]


def test_replaced_setpoints_are_flown_as_a_filters_until_the_program_goes_on_without(tmp_path: Path) -> None:
    def fly(out: Path) -> list[tuple[float, float, bool]]:
        seen = list[tuple[float, float, bool]]()
        with Flight(scenario(), seed=3, out=out, until=4) as flight:
            for tick in flight:
                follower = tick.vehicles[2]
                seen.append((tick.mission_time_s, follower.setpoint.height_m, follower.replaced[2]))
                if 0.95 < tick.mission_time_s < 2.95:
                    follower.replace(height_m=101.0)
                    flight.replace(3, speed_mps=99.0)
        return seen

    seen = fly(tmp_path / "first")
    commanded_m = {round(time_s, 1): (height_m, replaced) for time_s, height_m, replaced in seen if time_s >= 0}
    assert {each for time_s, each in commanded_m.items() if 1.05 < time_s < 3.05} == {(101.0, True)}, "one tick later"
    assert not any(replaced for time_s, (_, replaced) in commanded_m.items() if not 1.05 < time_s < 3.05)
    speeds_mps = {
        row["setpoint_speed_mps"]
        for row in pq.read_table(tmp_path / "first" / "timeseries.parquet").to_pylist()
        if str(row["vehicle"]) == "3" and 1.05 < row["mission_time_s"] < 3.05
    }
    assert speeds_mps == {28.0}, "its envelope's"
    said = events_of(tmp_path / "first")
    assert [each["vehicle"] for each in said if each["kind"] == "script"] == ["2", "3"]
    assert not [each for each in said if each["kind"] == "disobeys"]
    (act,) = flight_orders(tmp_path / "first")
    assert act["setpoints"] == "replaced by a program"
    with pytest.raises(ScenarioError, match=r"orders.0.setpoints: found 'replaced by a program' after"):
        gcs_formation.run(tmp_path / "first" / "run.yaml", clock="virtual", out=tmp_path / "without")
    assert not (tmp_path / "without").exists()
    fly(tmp_path / "again")
    assert same(tmp_path / "first", tmp_path / "again")


def test_a_setpoint_that_cannot_be_commanded_is_refused(tmp_path: Path) -> None:
    with Flight(scenario(), seed=3, out=tmp_path / "run") as flight:
        next(flight)
        with pytest.raises(ValueError, match="found vehicle 9; allowed: 1, 2, 3"):
            flight.replace(9, height_m=100)
        with pytest.raises(ValueError, match="found nan; allowed: a finite number"):
            flight.replace(2, height_m=math.nan)
    assert "orders" not in yaml.safe_load((tmp_path / "run" / "run.yaml").read_text()) or all(
        "setpoints" not in each for each in flight_orders(tmp_path / "run")
    )


def test_a_vehicle_that_a_program_crashed_is_not_missed(tmp_path: Path) -> None:
    """As one that the scenario crashed: it doesn't count as lost."""
    crashed = False
    with Flight(scenario(), out=tmp_path / "run", until=6) as flight:
        for tick in flight:
            if tick.mission_time_s > 1.0 and not crashed:
                crashed = True
                flight.inject("crash", vehicle=3)
    assert flight.summary.breaches == ()


@pytest.mark.slow
def test_flights_of_one_process_do_not_meet(tmp_path: Path) -> None:
    keys: dict[str, Any] = {"clock": "virtual", "until": 0.5}
    with (
        Flight(scenario(), seed=3, out=tmp_path / "one", **keys) as one,
        Flight(scenario(), seed=4, out=tmp_path / "other", **keys) as other,
    ):
        for _ in zip(one, other, strict=False):
            pass
    gcs_formation.run(scenario(seed=3), out=tmp_path / "alone", **keys)
    with Flight(scenario(), seed=3, out=tmp_path / "stepped", **keys) as flight:

        async def steps() -> int:
            return sum([1 async for _ in flight])

        assert asyncio.run(steps()) > 50
    assert same(tmp_path / "alone", tmp_path / "stepped")


def test_a_flight_that_could_not_go_on_says_why_at_its_end(tmp_path: Path) -> None:
    flight, ticks = Flight(scenario(), out=tmp_path / "run"), list[object]()

    def fly() -> None:
        with flight:
            flight.link(outage=True)
            ticks.extend(flight)

    with pytest.raises(gcs_formation.RunAbortedError, match="no vehicle 1, 2, 3 answered"):
        fly()
    assert ticks == []


def test_a_flight_is_stepped_inside_with_and_once(tmp_path: Path) -> None:
    flight = Flight(scenario(), out=tmp_path / "run")
    with pytest.raises(RuntimeError, match="inside `with"):
        next(flight)
    with pytest.raises(RuntimeError, match="no summary before it has ended"):
        assert flight.summary
    with flight:
        pass
    with pytest.raises(RuntimeError, match="entered once"), flight:
        pass


def test_an_order_at_a_tick_is_one_thing(tmp_path: Path) -> None:
    both = [{"at_tick": 3, "order": "shape line", "link": {"delay_ms": 3}}]
    with pytest.raises(ScenarioError, match=r"orders.0: found order and link; allowed: one of order, link, fault"):
        Flight(scenario(orders=both), out=tmp_path / "run")
    with pytest.raises(ScenarioError, match=r"orders.0.at_tick: found -1; allowed: a whole number from 0"):
        Flight(scenario(orders=[{"at_tick": -1, "order": "shape line"}]), out=tmp_path / "run")
    with pytest.raises(ScenarioError, match=r"orders.0.link.vehicles.0: found 7"):
        Flight(scenario(orders=[{"at_tick": 1, "link": {"vehicles": [7], "loss": 0.1}}]), out=tmp_path / "run")


def test_overrides_and_progress_of_run_and_a_table_of_its_result(tmp_path: Path) -> None:
    reported = list[tuple[float, float]]()
    keys: dict[str, Any] = {"clock": "virtual", "until": 4.0, "out": tmp_path / "run"}
    summary = gcs_formation.run(
        scenario(), overrides={"law.rate_hz": 20}, progress=lambda *now: reported.append(now), **keys
    )
    assert summary.to_dict()["control"]["rate_hz"] == 20
    assert {end_s for _, end_s in reported} <= {30.0}
    head, *rows = summary.table().splitlines()
    assert head.split()[:3] == ["follower", "x", "RMS"]
    assert [row.split()[0] for row in rows] == ["2", "3"]
