"""Flights of a study on machines that have none of its files: rows and records are those of flights here."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from collections import deque
from contextlib import contextmanager, nullcontext
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from airlink.cli import COMPILED
from formation_scenario.bounded_read import read_bounded
from formation_scenario.named_files import copies_below, files_read
from gcs_formation.cli import main
from gcs_formation.errors import RecordError, RecordingError, RunAbortedError
from gcs_formation.studies import cluster
from gcs_formation.studies.cluster import Cluster
from gcs_formation.studies.dataset import Dataset, read_plan
from gcs_formation.studies.flight import VERSION, Task, fly
from gcs_formation.studies.plan import Plan, Planned
from gcs_formation.studies.preparation import prepare
from gcs_formation.studies.records import keep, packed
from gcs_formation.studies.shipment import Shipment, Worker, fly_from, receive
from tests.formation_scenario.test_terrain import plane, write_geotiff
from tests.processes import wait_for

EXAMPLES = Path(__file__).parents[3] / "examples" / "extensions"
PLUGINS = (
    *("lqr_law", "chase_law", "keep_out_filter", "lines_recorder", "spread_metric"),
    *("radio_link", "drift_predictor", "vee_shape", "thermal_disturbance"),
)
MISSION = "lat,lon,alt\n35.5,125.5,260\n35.52,125.5,260\n35.55,125.51,270\n"
TIMES = {"wall_s", "cpu_s", "real_time_factor", "compute_ms"}


@pytest.fixture
def named(tmp_path) -> Path:
    """A study whose keys name a file of every kind, beside it."""
    affine = pytest.importorskip("affine")
    home = tmp_path / "home"
    home.mkdir()
    corner = affine.Affine(0.002, 0.0, 125.3, 0.0, -0.002, 35.8)
    write_geotiff(home / "ground.tif", plane(35.8, 125.3, 0.002, 301, 301) / 100.0, "EPSG:4326", corner)
    (home / "late.txt").write_text("40\n60\n")
    (home / "later.txt").write_text("80\n")
    (home / "mine.yaml").write_text("model: {tau_v_s: 2.5}")
    (home / "legs.csv").write_text(MISSION)
    for each in PLUGINS:
        shutil.copy(EXAMPLES / f"{each}.py", home)
    base = {
        "vehicles": {"count": 2},
        "origin": {"lat_deg": 35.5, "lon_deg": 125.5, "alt_m": 0.0},
        "start": {"in_air": True},
        "finish": {"loiter_s": 1},
        "duration_s": 2,
        "path": {"file": "legs.csv", "speed_mps": 22},
        "terrain": {"file": "ground.tif"},
        "formation": {"shape": "vee"},
        "disturbances": [{"kind": "thermal", "at_s": 0, "parameters": {"north_m": 40, "up_mps": 0.5}}],
        "extensions": {"keep_out": {"north_m": 3000, "east_m": 300, "radius_m": 40}, "lines": {}},
    }
    (home / "base.yaml").write_text(json.dumps(base))
    study = {
        "base": "base.yaml",
        "set": {
            "links.default.trace_file": "late.txt",
            "links.downlink": {"process": "radio", "parameters": {"range_m": 5000}},
            "law.predictor": {"type": "drift"},
        },
        "parameters": {
            "law.type": ["lqr", "chase"],
            "all": {"cases": {"mine": {"vehicles.model": "mine.yaml", "links.uplink": {"trace_file": "later.txt"}}}},
        },
        "metrics": ["error_x_m.max", "spread_m"],
        "record": "full",
    }
    (home / "study.yaml").write_text(json.dumps(study))
    return home / "study.yaml"


def plugins_of(named: Path) -> list[str]:
    return [str(named.parent / f"{each}.py") for each in PLUGINS]


def tasks_of(named: Path) -> list[Task]:
    planned, base = prepare(named, plugins=plugins_of(named))
    return [Task(each, planned, base) for each in Plan(planned).first_flights()]


def without_times(found: Any) -> Any:
    if isinstance(found, dict):
        return {key: without_times(value) for key, value in found.items() if key not in TIMES}
    return found


def same(content: bytes, name: str) -> Any:
    return without_times(json.loads(content)) if name == "summary.json" else content


def comparable(directory: Path) -> dict[str, Any]:
    return {name: same(content, name) for name, content in packed(directory).items()}


def unpacked(task: Task, place: Path) -> Path:
    """Send a study's shipment to a worker whose directory is `place`."""
    shipment = Shipment(task.study, task.base)
    assert receive(shipment.content, shipment.digest, SimpleNamespace(local_directory=str(place))).wrong == ""
    return place / shipment.digest


@pytest.mark.slow
def test_what_keys_name_goes_along_and_rows_and_records_are_the_same(named, tmp_path, monkeypatch):
    tasks = tasks_of(named)
    names = {"ground.tif", "late.txt", "later.txt", "mine.yaml"}
    assert {each.name for each in tasks[0].study.files} == names, "the base's mission is in its keys already"
    here = [fly(Task(each.planned, each.study, each.base, str(tmp_path / f"{i}"))) for i, each in enumerate(tasks)]
    assert [row["exit"] for row in here] == [0, 0], here
    assert here[0]["digest"] != here[1]["digest"]
    place = unpacked(tasks[0], tmp_path / "worker")
    named.parent.rename(tmp_path / "gone")
    monkeypatch.chdir("/")
    for i, task in enumerate(tasks):
        flown = fly_from(place, task.planned, "wherever")
        assert flown is not None
        assert without_times(flown.row) == without_times(here[i])
        keep(flown.record, tmp_path / "kept")
        assert comparable(tmp_path / "kept") == comparable(tmp_path / f"{i}")
        assert {"run.yaml", "flight.tlog", "timeseries.parquet", "summary.json", "positions.jsonl"} <= set(flown.record)


def test_a_file_beside_a_geotiff_goes_along_too(named):
    """GDAL reads a world file, or those that a .vrt joins, by itself."""
    (named.parent / "ground.tif.aux.xml").write_text("<PAMDataset/>")
    assert named.parent / "ground.tif.aux.xml" in tasks_of(named)[0].study.files


def test_files_that_the_study_itself_names_are_beside_it_missions_too(named, tmp_path, monkeypatch):
    study = json.loads(named.read_text())
    paths = [{"file": "legs.csv", "speed_mps": 22}, {"file": "legs.csv", "speed_mps": 23}]
    study["parameters"] = {"path": paths, "law.type": ["lqr"]}
    named.write_text(json.dumps(study))
    monkeypatch.chdir(tmp_path)
    assert named.parent / "legs.csv" in tasks_of(named)[0].study.files


def test_a_copy_is_read_in_place_of_the_file_within_its_block_alone(tmp_path):
    file, root = tmp_path / "a" / "b.txt", tmp_path / "root"
    copy = root / file.relative_to("/")
    for each, text in ((file, b"own"), (copy, b"copy")):
        each.parent.mkdir(parents=True)
        each.write_bytes(text)
    with files_read() as found, copies_below(root):
        assert read_bounded(tmp_path / "a" / "c" / ".." / "b.txt", 100) == b"copy"
    assert found == {file}
    assert read_bounded(file, 100) == b"own"


def test_a_worker_that_was_sent_nothing_flies_nothing(tmp_path):
    assert fly_from(tmp_path, Planned(0, 1, {}), None) is None


def test_a_worker_without_an_extension_s_package_says_which(tmp_path, monkeypatch):
    site = tmp_path / "site"
    _package(site)
    base = {"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}, "duration_s": 3}
    with monkeypatch.context() as installed:
        installed.syspath_prepend(str(site))
        study, keys = prepare({"base": {**base, "extensions": {"in_slot": {"within_m": 2}}}})
        shipment = Shipment(study, keys)
    sys.modules.pop("hive")
    found = receive(shipment.content, shipment.digest, SimpleNamespace(local_directory=str(tmp_path)))
    assert "found no hive 1.2 here; allowed: pip install hive==1.2" in found.wrong


@pytest.mark.parametrize(
    ("here", "theirs", "said"),
    [
        (True, Worker(VERSION, False, ""), f"has gcs-formation {VERSION} without its compiled modules; here it is"),
        (True, Worker(VERSION, True, ""), None),
        (False, Worker(VERSION, True, ""), None),
        (False, Worker("0.0.1", False, ""), f"has gcs-formation 0.0.1; here it is {VERSION}"),
        (False, Worker(VERSION, False, "found no hive"), "can't fly the study: found no hive"),
        (False, AttributeError("no receive"), "of another tree: AttributeError: no receive"),
    ],
)
def test_a_worker_that_would_fly_otherwise_is_refused(monkeypatch, here, theirs, said):
    monkeypatch.setattr(cluster, "COMPILED", here)
    found = cluster._unfit(theirs)
    assert found is None if said is None else said in str(found)


@pytest.mark.parametrize(
    ("found", "received", "said"),
    [
        (PackageNotFoundError("x"), None, "the Dask worker b has no gcs-formation; here it is"),
        ("0.0.1", None, "the Dask worker b has gcs-formation 0.0.1; here it is"),
        (
            version("gcs-formation"),
            Worker(VERSION, False, "found no hive"),
            "worker b can't fly the study: found no hive",
        ),
        (OSError("gone"), OSError("gone"), None),
    ],
)
def test_the_worker_that_is_not_fit_is_named_and_one_that_is_gone_is_not(found, received, said):
    fine = {"version": version("gcs-formation"), "receive": Worker(VERSION, COMPILED, "")}
    theirs = {"version": found, "receive": received}

    def run(call, *_, workers, on_error):
        assert (workers, on_error) == (None, "return")
        return {"a": fine[call.__name__], "b": theirs[call.__name__]}

    connected: Any = Cluster("tcp://host:1")
    connected._client = SimpleNamespace(run=run)
    connected._shipment = SimpleNamespace(content=b"", digest="")
    with nullcontext() if said is None else pytest.raises(RunAbortedError, match=said):
        connected._send(None)


def test_a_record_is_there_as_a_whole_and_replaces_what_a_cut_left(tmp_path):
    kept = tmp_path / "flights" / "000001"
    (kept / "figures").mkdir(parents=True)
    (kept / "half").write_text("")
    keep({"run.yaml": b"a", "figures/b.png": b"b"}, kept)
    assert packed(kept) == {"figures/b.png": b"b", "run.yaml": b"a"}
    assert [each.name for each in kept.parent.iterdir()] == ["000001"]
    with pytest.raises(RecordingError, match="cannot write"):
        keep({"a": b""}, Path("/proc/nowhere"))


def command(*arguments: object) -> Any:
    return CliRunner().invoke(main, list(map(str, arguments)))


def _package(site: Path) -> None:
    """Install a package that brings an extension, in a directory that is imported from."""
    info = site / "hive-1.2.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hive\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[gcs_formation.extensions]\nhive = hive\n")
    shutil.copy(EXAMPLES / "slot_monitor.py", site / "hive.py")


@pytest.fixture
def small(tmp_path) -> Path:
    base = {"vehicles": {"count": 2}, "start": {"in_air": True}, "duration_s": 1}
    base |= {"path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
    file = tmp_path / "small.yaml"
    file.write_text(json.dumps({"base": base, "record": "summary", "metrics": ["error_x_m.max"]}))
    return file


def test_records_go_to_any_url_that_fsspec_knows(small):
    fsspec = pytest.importorskip("fsspec")
    planned, base = prepare(small)
    row = fly(Task(Planned(0, 1, {}), planned, base, "memory://study/000000"))
    assert row["exit"] == 0
    assert json.loads(fsspec.filesystem("memory").cat("/study/000000/summary.json"))["schema"] == 1


def test_a_url_at_which_nothing_can_be_written_ends_the_study(small, tmp_path, monkeypatch):
    monkeypatch.setattr("gcs_formation.studies.flight._flown", lambda *_: pytest.fail("flown"))
    for url, said in (
        ("ftq://host/x", "--records: found 'ftq://host/x'; allowed: a URL that fsspec knows"),
        ("here", "found 'here'; allowed: a URL"),
    ):
        done = command("study", small, "--out", tmp_path / "out", "--records", url)
        assert (done.exit_code, said in done.output) == (2, True), done.output
    monkeypatch.undo()
    planned, base = prepare(small)
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=f"cannot write file://{tmp_path}/file/0"):
        fly(Task(Planned(0, 1, {}), planned, base, f"file://{tmp_path}/file/0"))


def test_a_study_s_directory_says_what_it_was_flown_with_and_a_resumed_one_needs_the_same(named, tmp_path):
    planned, base = prepare(named, plugins=plugins_of(named))
    with Dataset(tmp_path / "out", planned, base, resume=False, overwrite=False):
        contents = read_plan(tmp_path / "out")["contents"]
    assert {Path(name).name for name in contents} == {
        *("ground.tif", "late.txt", "later.txt", "mine.yaml"),
        *(f"{each}.py" for each in PLUGINS),
    }
    with Dataset(tmp_path / "out", planned, base, resume=True, overwrite=False):
        pass
    (named.parent / "late.txt").write_text("41\n")
    with pytest.raises(RecordError, match=r"late\.txt changed"):
        Dataset(tmp_path / "out", planned, base, resume=True, overwrite=False)


@contextmanager
def _elsewhere(scheduler: str, hidden: Path, place: Path, site: Path):
    """A Dask worker in a mount namespace of its own, in which the directory `hidden` is empty."""
    user = [] if os.geteuid() == 0 else ["--map-root-user", "--user"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", scheduler, "--nthreads", "1", "--no-dashboard"]
    shell = 'mount -t tmpfs none "$0" && exec "$@"'
    reported = ["unshare", *user, "--mount", "sh", "-c", shell, str(hidden), *worker, "--local-directory", str(place)]
    found = os.pathsep.join([str(Path(__file__).parents[3]), str(site)])
    environment = os.environ | {"PYTHONPATH": found, "PYTHONSAFEPATH": "1"}
    process = subprocess.Popen(reported, cwd="/", env=environment, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


@pytest.mark.slow
def test_workers_that_share_no_disk_leave_the_same_rows_and_records(named, tmp_path, monkeypatch):
    """With extensions from files, which go along, and from a package, which is installed there too."""
    distributed = pytest.importorskip("distributed")
    site = tmp_path / "site"
    _package(site)
    monkeypatch.syspath_prepend(str(site))
    keys = json.loads((named.parent / "base.yaml").read_text())
    keys["extensions"]["in_slot"] = {"within_m": 2}
    (named.parent / "base.yaml").write_text(json.dumps(keys))
    reported = [named, "--quiet", *(part for each in plugins_of(named) for part in ("--plugin", each))]
    here, there, away = (tmp_path / each for each in ("here", "there", "away"))
    assert command("study", *reported, "--out", here, "--workers", 1).exit_code == 0
    with distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as empty:
        address = empty.scheduler_address
        with _elsewhere(address, named.parent, tmp_path / "worker", site):
            with distributed.Client(address) as client:
                wait_for(client.nthreads)
            assert command("study", *reported, "--out", there, "--scheduler", address).exit_code == 0
            reported += ["--records", f"file://{away}"]
            assert command("study", *reported, "--out", tmp_path / "o", "--scheduler", address).exit_code == 0
            left = list((tmp_path / "worker").rglob("study.pickle"))
    assert left == []
    rows = [pq.read_table(each / "flights.parquet").drop(["wall_s", "cpu_s"]) for each in (here, there)]
    assert rows[0].equals(rows[1])
    for flight in ("000000", "000001"):
        assert comparable(there / "flights" / flight) == comparable(here / "flights" / flight) != {}
        assert comparable(away / flight) == comparable(here / "flights" / flight)


@pytest.mark.slow
def test_a_worker_that_comes_later_is_sent_everything_then(named, tmp_path):
    distributed = pytest.importorskip("distributed")
    tasks = tasks_of(named)
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as local,
        Cluster(local.scheduler_address) as workers,
    ):
        rows = workers.rows(deque([*tasks, *tasks]))
        flown = [next(rows)]
        local.scale(0)
        wait_for(lambda: not local.scheduler.workers)
        local.scale(1)
        flown += rows
    assert sorted(each["exit"] for each in flown) == [0, 0, 0, 0]
    assert all(each["spread_m"] for each in flown)


READERS = {
    "bounded_read.py",  # what all others read by
    "terrain.py",  # rasterio opens a file itself, at its place
    "registry.py",  # extensions go along with what they register
    "vehicle_files.py",  # shipped aircraft, of the package
    "schema.py",  # likewise, the head of a page
    "feature_folders.py",  # likewise, captions; and which features a run was flown with, for an error's text
}


def test_whatever_a_scenario_reads_is_read_where_its_copies_are():
    """So that every file that a key names goes along, also one of a key that is yet to come."""
    package = Path(__file__).parents[3] / "formation_scenario"
    found = set[str]()
    for file in package.rglob("*.py"):
        calls = [each.func for each in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(each, ast.Call)]
        names = {each.attr for each in calls if isinstance(each, ast.Attribute)}
        names |= {each.id for each in calls if isinstance(each, ast.Name) and each.id == "open"}
        if names & {"open", "read_text", "read_bytes", "fromfile", "loadtxt"}:
            found.add(file.name)
    assert found == READERS
