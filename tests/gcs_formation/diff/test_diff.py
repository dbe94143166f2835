"""`diff` finds each kind of difference of two runs, names its place and time, and what counts beyond a tolerance."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import gcs_formation
from gcs_formation.cli import main
from gcs_formation.diff.runs import differences
from tests.gcs_formation.diff.records import (
    KEYS,
    SERIES,
    SUMMARY,
    heartbeat,
    write_record,
    write_series,
    write_tlog,
)

Change = Callable[[Path], object]


def summary(**changed: object) -> Change:
    return lambda run: (run / "summary.json").write_text(json.dumps(SUMMARY | changed))


def text(name: str, content: str) -> Change:
    return lambda run: (run / name).write_text(content)


def without(name: str) -> Change:
    return lambda run: (run / name).unlink()


def rows_less(run: Path) -> None:
    write_series(run, **{name: values[:2] for name, values in SERIES.items()})


DIFFERENCES: list[tuple[Change, str]] = [
    (summary(version="0.2.0"), "version: 0.1.0 | 0.2.0"),
    (summary(extensions={"lqr": "1"}), "extensions: None | missing"),
    (text("run.yaml", KEYS.replace("pid", "lqr")), "run.yaml: law.type: pid | lqr"),
    (text("run.yaml", KEYS.replace("3", "4")), "run.yaml: seed: 3 | 4 (by 1)"),
    (lambda run: write_tlog(run, heartbeat(1), heartbeat(3), every_us=50_000),
     "flight.tlog: frame 2 at 0.050 s: HEARTBEAT of 2/0 | HEARTBEAT of 3/0"),
    (lambda run: write_tlog(run, heartbeat(1), heartbeat(2, mode=15), every_us=50_000),
     "flight.tlog: frame 2, HEARTBEAT of 2/0: custom_mode at 0.050 s: 0 | 15 (by 15)"),
    (lambda run: write_tlog(run, heartbeat(1), heartbeat(2), every_us=60_000),
     "flight.tlog: frame 2, HEARTBEAT of 2/0: stamp, us at 0.050 s: "),
    (lambda run: write_tlog(run, heartbeat(1), every_us=50_000),
     "flight.tlog: frame 2 at 0.050 s: HEARTBEAT of 2/0 | no more frames"),
    (text("events.jsonl", '{"t_s": 0.0}\n{"t_s": 0.2}\n'),
     'events.jsonl: line 2 at 0.100 s: {"t_s": 0.1} | {"t_s": 0.2}'),
    (text("events.jsonl", '{"t_s": 0.0}\n'), "events.jsonl: lines at 0.100 s: 2 | 1 (by 1)"),
    (lambda run: write_series(run, delay_s=[math.nan, 0.25, 0.5, 0.75]),
     "timeseries.parquet: delay_s of vehicle 2, in 1 of 2 ticks at 0.100 s: 0.25 | 0.75 (by 0.5)"),
    (lambda run: write_series(run, delay_s=[0.0, 0.25, 0.5, 0.25]),
     "timeseries.parquet: delay_s of vehicle 1, in 1 of 2 ticks at 0.000 s: nan | 0"),
    (lambda run: write_series(run, delay_s=[math.nan, 0.5, 0.5, 1.0]),
     "timeseries.parquet: delay_s of vehicle 2, in 2 of 2 ticks, at most 0.75 at 0.000 s: 0.25 | 0.5 (by 0.25)"),
    (lambda run: write_series(run, phase=["flying", "ending", "flying", "flying"]),
     "timeseries.parquet: phase of vehicle 2, in 1 of 2 ticks at 0.000 s: flying | ending"),
    (lambda run: write_series(run, jitter_s=[0.0] * 4), "timeseries.parquet: jitter_s: missing | there"),
    (rows_less, "timeseries.parquet: rows of vehicle 1: 2 | 1 (by 1)"),
    (summary(expect=[{"value": 0.26}]), "summary.json: expect.0.value: 0.25 | 0.26 (by 0.01)"),
    (summary(control={"compute_ms": {"p50": 0.2}}), "summary.json: control.ticks: 2 | missing"),
    (without("timeseries.parquet"), "timeseries.parquet: there | missing"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "said"), DIFFERENCES, ids=[said for _, said in DIFFERENCES])
def test_a_difference_is_found_where_it_is(change: Change, said: str, tmp_path: Path) -> None:
    one, other = write_record(tmp_path / "one"), write_record(tmp_path / "other")
    assert list(differences(one, other)) == []
    change(other)
    found = [str(each) for each in differences(one, other)]
    if said.startswith("extensions"):
        found = [each for each in found if each.startswith("extensions")]
        assert found
        return
    assert found[0].startswith(said)


def test_causes_come_first_and_then_what_happened_first(tmp_path: Path) -> None:
    one, other = write_record(tmp_path / "one"), write_record(tmp_path / "other")
    summary(version="2", expect=[{"value": 9.0}])(other)
    text("run.yaml", KEYS.replace("3", "4"))(other)
    text("events.jsonl", '{"t_s": 0.0}\n{"t_s": 0.2}\n')(other)
    write_tlog(other, heartbeat(1), heartbeat(3), every_us=50_000)
    write_series(other, heading_rad=[3.0, 0.0, 3.1, 0.0])
    parts = [each.part or each.location for each in differences(one, other)]
    assert parts == ["version", "run.yaml", "timeseries.parquet", "flight.tlog", "events.jsonl", "summary.json"]


def test_with_a_tolerance_numbers_alone_count_and_beyond_it_alone(tmp_path: Path) -> None:
    one, other = write_record(tmp_path / "one"), write_record(tmp_path / "other")
    write_tlog(other, heartbeat(1), heartbeat(3))
    text("events.jsonl", "{}\n")(other)
    write_series(other, delay_s=[math.nan, 0.375, 0.5, 0.25], heading_rad=[3.1 - 2 * math.pi, 0.0, 3.1, 0.0])
    summary(expect=[{"value": 0.375}])(other)
    assert list(differences(one, other, 0.125)) == []
    places = [each.location for each in differences(one, other, 0.12)]
    assert places == ["delay_s of vehicle 2, in 1 of 2 ticks", "expect.0.value"]
    write_series(other, delay_s=[0.25, 0.25, 0.5, 0.25])
    assert [each.location for each in differences(one, other, 1e9)] == ["delay_s of vehicle 1, in 1 of 2 ticks"]


def test_figures_of_the_machine_do_not_count(tmp_path: Path) -> None:
    one, other = write_record(tmp_path / "one"), write_record(tmp_path / "other")
    summary(wall_s=99.0, control={"ticks": 2, "compute_ms": {"p50": 7.0}})(other)
    assert list(differences(one, other)) == []


def called(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["diff", *map(str, arguments)])


def test_the_exit_status_says_whether_anything_differs(tmp_path: Path) -> None:
    one, other = write_record(tmp_path / "one"), write_record(tmp_path / "other")
    same = called(one, other)
    assert (same.exit_code, same.output) == (0, "no difference\n")
    assert called(one, other, "--plugin", "law.py").exit_code == 0, "as of every command that reads a run"
    text("run.yaml", KEYS.replace("3", "4"))(other)
    assert called(one, other).exit_code == 1
    assert called(one, other, "--ignore", "run.yaml: s*d").exit_code == 0
    (row,) = json.loads(called(one, other, "--json").output)
    assert row == {"part": "run.yaml", "place": "seed", "t_s": None, "one": 3, "other": 4}
    text("run.yaml", "schema: 2\n")(other)
    assert called(one, other, "--lines", "1").output.endswith("… and 2 more (--lines)\n")


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (without("run.yaml"), "found no run.yaml in"),
        (text("run.yaml", "a: ["), "cannot read"),
        (text("summary.json", "{"), "cannot read"),
        (text("timeseries.parquet", "no table"), "cannot read timeseries.parquet of"),
    ],
)
def test_what_is_no_record_is_bad_usage(broken: Change, words: str, tmp_path: Path) -> None:
    one, other = write_record(tmp_path / "one"), write_record(tmp_path / "other")
    broken(other)
    answer = called(one, other)
    assert answer.exit_code == 2
    assert words in answer.output


@pytest.mark.slow
def test_one_key_is_followed_to_its_first_frame_in_a_real_pair_of_runs(tmp_path: Path) -> None:
    keys = {"name": "pair", "vehicles": {"count": 2}, "start": {"in_air": True, "run_in_s": 2.0},
            "path": {"waypoints_m": [[0, 0, 100], [2000, 0, 100]]}}  # fmt: skip
    for name, gain in (("one", 3.0), ("again", 3.0), ("other", 3.5)):
        overrides = {"law": {"speed": {"kp": gain}}}
        gcs_formation.run(keys | overrides, clock="virtual", until=3.0, out=tmp_path / name)
    assert list(differences(tmp_path / "one", tmp_path / "again")) == []
    cause, first, *later = differences(tmp_path / "one", tmp_path / "other")
    assert str(cause) == "run.yaml: law.speed.kp: 3 | 3.5 (by 0.5)"
    assert first.location.startswith("kp_speed of vehicle 2")
    frame = next(each for each in later if each.part == "flight.tlog")
    assert "COMMAND_INT of 255/" in frame.location
