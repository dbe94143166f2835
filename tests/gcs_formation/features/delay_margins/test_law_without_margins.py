"""A law that is added has no delay margin of its own, and nobody prints another law's in its place."""

import json
import math

import pytest
from click.testing import CliRunner

from formation_scenario import load_scenario
from gcs_formation.app.check import check_report, check_text
from gcs_formation.cli import main
from gcs_formation.control import laws
from gcs_formation.control.laws import LawKind, formation_law
from gcs_formation.stability import law_loops, law_margins, scenario_delay_margin
from tests.flights.in_memory import World

KEYS = {
    "vehicles": {"count": 3},
    "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]},
    "links": {"default": {"delay_ms": 300}},
    "law": {"type": "pid", "delay_compensation": False, "on_delay": "degrade"},
}


@pytest.fixture(params=[False, True], ids=["of followers", "mutual"])
def added(request, monkeypatch):
    """Let the name pid stand for a law whose row says nothing of margins, as one that is added does."""
    monkeypatch.setitem(laws.LAWS, "pid", LawKind("added", formation_law, mutual=request.param))


def test_none_is_computed_or_checked(added):
    scenario = load_scenario(KEYS)
    assert dict(law_margins(scenario).small_signal) == {}
    assert scenario_delay_margin(scenario) == math.inf
    assert all(axes == {} for axes in law_loops(scenario, succession=True).values())
    reported = check_report(scenario)
    assert reported["delay_margin_s"] == reported["delay_margin_worst_s"] == {"x": None, "y": None, "z": None}
    assert "design" not in reported
    assert any("law.on_delay: found degrade" in each for each in reported["warnings"])
    text = check_text(scenario)
    assert "# delay margin: – " in text
    assert text.count("delay margin") <= 2, "the other is the warning"
    assert "sensitivity" not in text


def test_the_watch_in_flight_reports_the_loops_delay_and_no_margin(monkeypatch):
    monkeypatch.setitem(laws.LAWS, "pid", LawKind("added", formation_law))
    world = World(start={"in_air": True, "run_in_s": 6}, law=KEYS["law"], links={"default": {"delay_ms": 900}})
    world.run(20.0)  # the formation is still assembling: delays are watched from the first setpoint on
    cycle = world.station.cycle
    assert math.isnan(cycle.findings.max_used)
    assert cycle.findings.longest_s > 1.8
    assert all(math.isnan(each) for each in cycle.findings.margin_used)
    assert not [each for each in world.recorder.events if each.kind == "delay_margin"]


@pytest.mark.slow
def test_compare_prints_a_dash(monkeypatch, tmp_path):
    from gcs_formation.studies import compare, flight  # noqa: PLC0415 - flown here, where the law is added

    class Here:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def rows(self, tasks):
            return map(flight.fly, tasks)

    monkeypatch.setitem(laws.LAWS, "pid", LawKind("added", formation_law))
    monkeypatch.setattr("gcs_formation.cli.study.Processes", lambda _: Here())
    scenario = tmp_path / "s.yaml"
    scenario.write_text(json.dumps(KEYS | {"duration_s": 4, "start": {"in_air": True}}))
    done = CliRunner().invoke(main, ["compare", str(scenario), "--laws", "pid,fuzzy_pid", "--out", str(tmp_path / "c")])
    found = json.loads((tmp_path / "c" / f"{compare.NAME}.json").read_text())["laws"]
    assert found["pid"]["delay_margin_s"] is found["pid"]["margin_used"] is None
    assert found["fuzzy_pid"]["delay_margin_s"] > 0.1
    (row,) = [line for line in done.stdout.splitlines() if line.strip().startswith("pid ")]
    assert row.split()[-2:] == ["–", "–"]
