import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from formation_scenario import dump_scenario, load_scenario
from gcs_formation.errors import RecordError
from gcs_formation.record.parquet import read_parquet, write_parquet
from gcs_formation.report import load_run


def test_mission_time_is_continued_backwards_over_the_assembly(make_run):
    run = load_run(make_run())
    assert run.begun
    assert run.whole_time_s[0] == pytest.approx(-10.0)
    assert run.time_s[0] == pytest.approx(0.0, abs=1e-9)
    assert run.whole_time_s.size - run.time_s.size == 100
    assert np.diff(run.whole_time_s) == pytest.approx(0.1)


def test_a_path_never_begun_counts_from_the_first_tick(make_run):
    run = load_run(make_run(begun=False, flown_s=20.0))
    assert not run.begun
    assert run.time_s[0] == 0.0
    assert run.time_s.size == run.whole_time_s.size


def test_the_worst_follower_is_the_one_that_crashed(make_run):
    run = load_run(make_run(crash=True))
    assert run.worst_first()[0] == run.followers[-1]


def test_columns_are_those_of_the_vehicle(make_run):
    directory = make_run()
    columns = read_parquet(directory / "timeseries.parquet")
    run = load_run(directory)
    for vehicle, own in run.whole.vehicles.items():
        mine = columns["vehicle"] == vehicle.system
        np.testing.assert_array_equal(own["true_north_m"], columns["true_north_m"][mine])


def test_a_run_that_would_be_refused_now_is_read_and_says_why(make_run):
    directory = make_run()
    assert load_run(directory).missing == ()
    written = (directory / "run.yaml").read_text(encoding="utf-8")
    wanted = "expect: [{metric: settled_at_s, from_s: 1.0, below: 9.0}]\n"  # earlier versions ignored from_s there
    (directory / "run.yaml").write_text(written.split("expect:")[0] + wanted, encoding="utf-8")
    run = load_run(directory)
    assert run.scenario.expect[0].metric == "settled_at_s"
    (said,) = run.missing
    assert "expect.0.from_s: found 1 for settled_at_s, a figure of the whole flight; allowed: 0, or nothing" in said
    (directory / "run.yaml").write_text(written.replace("duration_s", "duration"), encoding="utf-8")
    with pytest.raises(RecordError, match="cannot read the run"):
        load_run(directory)


def test_no_directory(tmp_path):
    with pytest.raises(RecordError, match="found no directory"):
        load_run(tmp_path / "nowhere")


def test_not_a_run(tmp_path):
    with pytest.raises(RecordError, match=r"found no run\.yaml"):
        load_run(tmp_path)


@pytest.mark.parametrize(
    ("name", "place"), [("summary.json", "summary.json"), ("events.jsonl", "events.jsonl, line 1")]
)
def test_a_file_that_is_cut_off_is_named(make_run, name, place):
    directory = make_run()
    (directory / name).write_text('{"schema": 1, "t_s"')
    with pytest.raises(RecordError, match=rf"found text that isn't whole JSON in {place} .*; expected: {name} as"):
        load_run(directory)


@pytest.mark.parametrize("name", ["summary.json", "timeseries.parquet"])
def test_an_unfinished_run(make_run, name):
    directory = make_run()
    (directory / name).unlink()
    with pytest.raises(RecordError, match=rf"found no {name}.*and no timeseries\.ticks"):
        load_run(directory)


@pytest.mark.parametrize("name", ["run.yaml", "summary.json", "timeseries.parquet", "events.jsonl"])
def test_a_damaged_file(make_run, name):
    directory = make_run()
    (directory / name).write_bytes(b"\xff{ damaged")
    with pytest.raises(RecordError, match="cannot read the run"):
        load_run(directory)


@pytest.mark.parametrize("name", ["summary.json", "events.jsonl"])
def test_a_file_that_is_no_text_is_named_with_the_byte(make_run, name):
    directory = make_run()
    (directory / name).write_bytes(b'{"schema": 1, "\xaf')
    found = rf"found byte 0xaf at offset 15 of {name}; expected: text in UTF-8, {name} as the run wrote it"
    with pytest.raises(RecordError, match=found):
        load_run(directory)


def test_a_time_series_with_a_damaged_block_is_named(make_run):
    directory = make_run()
    path = directory / "timeseries.parquet"
    columns = read_parquet(path)
    pq.write_table(pa.table(columns), path, compression="lz4", use_dictionary=False)
    whole, begin = path.read_bytes(), pq.read_metadata(path).row_group(0).column(0).data_page_offset
    path.write_bytes(whole[:begin] + b"\xff" * 200 + whole[begin + 200 :])
    with pytest.raises(
        RecordError, match=r"found something else than whole Parquet in timeseries\.parquet \([^\n]*\); expected: times"
    ):
        load_run(directory)


@pytest.fixture(scope="module")
def whole(make_run):
    """A run, and its table as it was written: tests put others into the place of that."""
    directory = make_run(flown_s=5.0)
    return directory, pq.read_table(directory / "timeseries.parquet")


@pytest.mark.parametrize("wrong", [["a"], [None], [[1.0]], [b"a"]])
@pytest.mark.parametrize("name", ["t_s", "vehicle", "error_x_m"])
def test_a_column_of_something_else_than_numbers_is_named(whole, name, wrong):
    directory, table = whole
    other = pa.array(wrong * table.num_rows)
    changed = table.set_column(table.column_names.index(name), name, other)
    pq.write_table(changed, directory / "timeseries.parquet")
    found = rf"found a column {name} of something else than numbers in timeseries\.parquet; expected: timeseries"
    with pytest.raises(RecordError, match=found):
        load_run(directory)


def test_another_schema(make_run):
    directory = make_run()
    summary = json.loads((directory / "summary.json").read_text())
    (directory / "summary.json").write_text(json.dumps(summary | {"schema": 2}))
    with pytest.raises(RecordError, match="found schema 2"):
        load_run(directory)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (None, "found no name in summary.json; expected: a text"),
        ({"links": {"1": {}}}, "found no links.1.injected_delay_ms in summary.json; expected: a number or null"),
        ({"followers": 3}, "found 3 for followers in summary.json; expected: an object or an array"),
        ({"safety": {"violations": None}}, "found null for safety.violations in summary.json; expected: an integer"),
        ({"expect": [{"metric": "x", "value": 1, "held": 1}]}, "found 1 for expect.0.held in summary.json; expected: "),
    ],
)
def test_a_summary_that_no_run_wrote_is_named(make_run, keys, said):
    directory = make_run()
    summary = {} if keys is None else json.loads((directory / "summary.json").read_text()) | keys
    (directory / "summary.json").write_text(json.dumps(summary | {"schema": 1}))
    with pytest.raises(RecordError, match="cannot read the run") as refused:
        load_run(directory)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("[1]", "found [1] in events.jsonl, line 1; expected: an object"),
        ('{"kind": "mode", "text": ""}', "found no t_s in events.jsonl, line 1; expected: a number"),
        (
            '{"t_s": 1, "kind": "design", "text": ""}',
            "found no design_delay_s in events.jsonl, line 1; expected: a num",
        ),
    ],
)
def test_an_event_that_no_run_wrote_is_named(make_run, line, said):
    directory = make_run()
    (directory / "events.jsonl").write_text(line + "\n")
    with pytest.raises(RecordError, match="cannot read the run") as refused:
        load_run(directory)
    assert said in str(refused.value)


def test_no_ticks(make_run):
    directory = make_run()
    path = directory / "timeseries.parquet"
    write_parquet(path, [{name: np.zeros(0) for name in read_parquet(path)}])
    with pytest.raises(RecordError, match="found no control tick"):
        load_run(directory)


def test_a_record_of_another_version(make_run):
    directory = make_run()
    path = directory / "timeseries.parquet"
    columns = read_parquet(path)
    del columns["airborne"]
    pq.write_table(pa.table(columns), path)
    with pytest.raises(RecordError, match="found no column airborne"):
        load_run(directory)


def test_another_run_s_scenario(make_run):
    directory = make_run()
    path = directory / "run.yaml"
    path.write_text(dump_scenario(load_scenario(path, ["vehicles={count: 3}"])))
    with pytest.raises(RecordError, match="expected: a multiple of 3"):
        load_run(directory)


@pytest.mark.parametrize("wrong", [[["a"]], [1.0]])
def test_phases_that_are_not_text_are_ignored(make_run, wrong):
    directory = make_run()
    path = directory / "timeseries.parquet"
    table = pq.read_table(path)
    pq.write_table(table.set_column(table.column_names.index("phase"), "phase", pa.array(wrong * table.num_rows)), path)
    assert not load_run(directory).begun
