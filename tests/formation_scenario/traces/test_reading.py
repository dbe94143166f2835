"""Recorded delays as people have them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from formation_scenario import ScenarioError, dump_scenario, load_scenario
from formation_scenario.fields import FileError
from formation_scenario.traces.keys import Trace
from formation_scenario.traces.reading import read_trace
from formation_scenario.traces.recorded import RecordedDelays

LINUX = """\
PING 1.1.1.1 (1.1.1.1) 56(84) bytes of data.
64 bytes from 1.1.1.1: icmp_seq=1 ttl=57 time=100 ms
64 bytes from 1.1.1.1: icmp_seq=3 ttl=57 time=200 ms
no answer yet for icmp_seq=4
64 bytes from 1.1.1.1: icmp_seq=5 ttl=57 time=40.5 ms
64 bytes from 1.1.1.1: icmp_seq=5 ttl=57 time=90 ms (DUP!)

--- 1.1.1.1 ping statistics ---
5 packets transmitted, 3 received, 40% packet loss, time 802ms
rtt min/avg/max/mdev = 40.5/113.5/200/12 ms
"""
STAMPED = """\
[1700000000.500000] 64 bytes from 1.1.1.1: icmp_seq=65534 ttl=57 time=500 ms
[1700000000.600000] 64 bytes from 1.1.1.1: icmp_seq=65535 ttl=57 time=100 ms
[1700000001.700000] 64 bytes from 1.1.1.1: icmp_seq=1 ttl=57 time=200 ms
"""
MACOS = """\
PING 1.1.1.1 (1.1.1.1): 56 data bytes
64 bytes from 1.1.1.1: icmp_seq=0 ttl=57 time=12.250 ms
Request timeout for icmp_seq 1
64 bytes from 1.1.1.1: icmp_seq=2 ttl=57 time=14.000 ms
"""
WINDOWS = """\

Pinging 1.1.1.1 with 32 bytes of data:
Reply from 1.1.1.1: bytes=32 time=12ms TTL=57
Request timed out.
Reply from 1.1.1.1: bytes=32 time<1ms TTL=57
"""


@pytest.fixture
def read(tmp_path: Path) -> Any:
    def read_text(text: str, **keys: Any) -> RecordedDelays:
        (tmp_path / "trace").write_text(text, encoding="utf-8")
        return read_trace(Trace(file=str(tmp_path / "trace"), **keys))

    return read_text


def shown(record: RecordedDelays) -> list[Any]:
    each = zip(record.times_s, record.delays_ms, strict=True)
    return [(pytest.approx(at_s), None if math.isnan(ms) else pytest.approx(ms)) for at_s, ms in each]


def test_pings_answers_are_halved_at_its_own_interval_and_what_wasnt_answered_is_lost(read: Any) -> None:
    record = read(LINUX)
    assert shown(record) == [(0.0, 50.0), (0.2005, None), (0.401, 100.0), (0.6015, None), (0.802, 20.25)]
    assert record.mean_ms == pytest.approx((50 + 100 + 20.25) / 3)
    assert record.loss == pytest.approx(0.4)
    assert shown(read(LINUX, kind="one_way", period_s=0.5))[2:] == [(1.0, 200.0), (1.5, None), (2.0, 40.5)]


def test_pings_stamps_are_of_the_answer_and_its_numbers_begin_again(read: Any) -> None:
    """Sent at 0.0, 0.5 and 1.5 s by the stamps less the round trips: numbers 65534, 65535, 0 (lost) and 1."""
    assert shown(read(STAMPED)) == [(0.0, 250.0), (0.5, 50.0), (1.0, None), (1.5, 100.0)]


def test_ping_of_other_systems(read: Any) -> None:
    assert shown(read(MACOS)) == [(0.0, 6.125), (1.0, None), (2.0, 7.0)]
    assert shown(read(WINDOWS)) == [(0.0, 6.0), (1.0, None), (2.0, 0.25)]


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("t_s,rtt_ms\n0,100\n0.2,\n0.4,60\n", {"time": "t_s"}),
        ("t_s;rtt_ms\n0;100\n0.2;nan\n0.4;60\n", {"time": "t_s"}),
        ("when\tlast\trtt [s]\n5000\t1\t0.1\n5200\t1\t-1\n5400\t1\t0.06\n", {"time": "when", "time_unit": "ms"}),
        ("# a comment\nseq,rtt_ns\n1,100000000\n2,lost\n3,60000000\n", {"period_s": 0.2}),
        ("a,b\n1,100\n2,\n3,60\n", {"column": "b", "unit": "ms", "kind": "rtt", "period_s": 0.2}),
        (
            "at,rtt_us\n2026-01-01T00:00:00,100000\n2026-01-01T00:00:00.2,*\n2026-01-01T00:00:00.4,60000\n",
            {"time": "at"},
        ),
        ("t_ms,one_way_ms\n0,50\n200,\n400,30\n", {"time": "t_ms"}),
    ],
)
def test_tables_in_every_unit_are_the_same_record(read: Any, text: str, keys: dict[str, Any]) -> None:
    record = read(text, **keys)
    assert shown(record) == [(0.0, 50.0), (0.2, None), (0.4, 30.0)]
    assert record.period_s == pytest.approx(0.2)
    assert record.timed


def test_lines_that_are_missing_from_a_steady_table_are_losses(read: Any) -> None:
    rows = "".join(f"{0.2 * i},{100}\n" for i in range(100) if i not in {7, 40, 41})
    record = read("t_s,rtt_ms\n" + rows, time="t_s")
    assert record.gaps
    assert record.loss == pytest.approx(0.03)
    unsteady = "".join(f"{i * i},{100}\n" for i in range(20))
    assert not read("t_s,rtt_ms\n" + unsteady, time="t_s").gaps


def test_times_that_were_rounded_are_spread(read: Any) -> None:
    record = read("t_s,rtt_ms\n10,1\n10,2\n11,3\n11,4\n12,5\n12,6\n", time="t_s")
    assert record.times_s == pytest.approx((0.0, 0.5, 1.0, 1.5, 2.0, 2.5))


def test_numbers_alone_are_milliseconds_of_one_direction_a_second_apart_unless_the_keys_say(read: Any) -> None:
    record = read("40 # ms\n\n# slower\n55.5\nlost\n")
    assert shown(record) == [(0.0, 40.0), (1.0, 55.5), (2.0, None)]
    assert not record.timed
    record = read("0.04\n0.06\n", unit="s", kind="rtt", period_s=0.2)
    assert shown(record) == [(0.0, 20.0), (0.2, 30.0)]
    assert record.timed


@pytest.mark.parametrize(
    ("text", "keys", "found"),
    [
        ("t_s,rtt_ms\n0,1\n", {}, "neither `time`, the column of its times, nor `period_s`"),
        ("t_s,rtt_ms\n0,1\n", {"time": "t"}, "without a column 't' (did you mean 't_s'?): its columns are t_s, rtt_ms"),
        (
            "t_s,up_ms,down_ms\n0,1,2\n",
            {"time": "t_s"},
            "t_s, up_ms, down_ms, and none of them chosen",
        ),
        ("t_s,rtt\n0,1\n", {"time": "t_s", "column": "rtt"}, "the column 'rtt'"),
        ("t_s,rtt_ms\n0,slow\n", {"time": "t_s"}, "found 'slow' at"),
        ("t_s,rtt_ms\n1,1\n0,1\n", {"time": "t_s"}, "found a time before the one above it at"),
        ("t_s,rtt_ms\nnoon,1\n", {"time": "t_s"}, "found the time 'noon' at"),
        ("t_s,rtt_ms\n3,1\n3,2\n", {"time": "t_s"}, "in which time doesn't advance"),
        ("t_s,rtt_ms\n0,\n1,\n", {"time": "t_s"}, "without a delay in it"),
        ("t_s,rtt_ms\n", {"time": "t_s"}, "without a line below its columns' names"),
        ("t_s,rtt_ms\n0,-5\n", {"time": "t_s"}, "found a delay of -5 ms at"),
        ("1\n2\n", {"column": "rtt"}, "which isn't a table with named columns"),
        ("PING 1.1.1.1 (1.1.1.1) 56(84) bytes of data.\n", {}, "the output of a ping that nothing answered"),
    ],
)
def test_what_isnt_a_record_is_refused(read: Any, text: str, keys: dict[str, Any], found: str) -> None:
    with pytest.raises(FileError) as refused:
        read(text, **keys)
    assert found in str(refused.value)


def scenario_of(**link: Any) -> dict[str, Any]:
    return {
        "vehicles": {"count": 2},
        "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]},
        "links": {"default": link},
    }


def test_a_trace_is_found_beside_its_scenario_and_replaced_by_a_later_one_in_either_form(tmp_path: Path) -> None:
    (tmp_path / "ping.csv").write_text("t_s,rtt_ms\n0,100\n1,300\n")
    (tmp_path / "late.txt").write_text("5\n")
    link = {
        "trace": {"file": "ping.csv", "time": "t_s"},
        "uplink": {"trace_file": "late.txt"},
        "downlink": {"trace": {"file": "ping.csv", "time": "t_s", "kind": "one_way"}},
    }
    path = tmp_path / "scenario.yaml"
    path.write_text(
        f"vehicles: {{count: 2}}\npath: {{waypoints_m: [[0, 0, 100], [4000, 0, 100]]}}\nlinks: {{default: {link}}}\n"
    )
    scenario = load_scenario(path)
    (step,) = scenario.link_steps(scenario.vehicles[0])
    up, down = step.uplink.recording, step.downlink.recording
    assert up == Trace(file=str(tmp_path / "late.txt"))
    assert down == Trace(file=str(tmp_path / "ping.csv"), time="t_s", kind="one_way")
    assert down is not None
    assert scenario.recorded_delays(down).mean_ms == 200.0
    assert load_scenario(dump_to(tmp_path, scenario)).link_steps(scenario.vehicles[0]) == (step,)


def dump_to(directory: Path, scenario: Any) -> Path:
    (directory / "elsewhere").mkdir()
    path = directory / "elsewhere" / "run.yaml"
    path.write_text(dump_scenario(scenario))
    return path


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ({"trace_file": "FILE", "trace": {"file": "FILE", "time": "t_s"}}, "default.trace_file: found it beside trace"),
        ({"trace": {"file": "FILE", "time": "t_s", "period_s": 1.0}}, "default.trace.period_s: found it beside time"),
        ({"trace": {"file": "NONE"}}, "default.trace.file: found NONE: No such file"),
        ({"trace": {"file": "FILE", "time": "t_s", "kind": "both"}}, "default.trace.kind: found 'both'"),
    ],
)
def test_keys_that_contradict_each_other_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, link: dict[str, Any], expected: str
) -> None:
    (tmp_path / "FILE").write_text("t_s,rtt_ms\n0,100\n1,300\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScenarioError) as refused:
        load_scenario(scenario_of(**link))
    assert any(expected in str(each).replace(f"{tmp_path}/", "") for each in refused.value.problems)
