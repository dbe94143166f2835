import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from airlink.cli import Status
from gcs_formation.app.run_options import RunOptions
from gcs_formation.cli import main
from gcs_formation.record import summary


@pytest.mark.parametrize(
    "wrong",
    [
        {"clock": "fast"},
        {"speedup": 0.0},
        {"speedup": math.nan},
        {"until_s": -1.0},
        {"until_s": math.nan},
        {"clock": "virtual", "speedup": 2.0},
    ],
)
def test_what_the_command_line_refuses_is_refused_from_python_too(wrong) -> None:
    with pytest.raises(ValueError, match="allowed: "):
        RunOptions(Path("run"), **wrong)


def test_identify_refuses_what_only_simulated_autopilots_can_be_reported(tmp_path) -> None:
    """Emulated vehicles fly their steps under the virtual clock; messages name no option of another command."""
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("vehicles: {count: 2}\npath: {waypoints_m: [[0, 0, 100], [6000, 0, 100]]}\n")
    told = CliRunner().invoke(main, ["identify", str(scenario), "--speedup", "10", "--run-dir", str(tmp_path / "run")])
    assert told.exit_code == Status.BAD_USAGE
    assert "--speedup: found 10 of emulated vehicles alone, which fly as fast" in told.output
    assert "the real clock" not in told.output
    assert not (tmp_path / "run").exists()


@pytest.fixture
def flown(tmp_path):
    """Fly two vehicles under the virtual clock from the command line; return the output."""
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(
        "duration_s: 5\nstart: {in_air: true, run_in_s: 6}\nfinish: {loiter_s: 1}\nvehicles: {count: 2}\n"
        "path: {waypoints_m: [[0, 0, 100], [6000, 0, 100]]}\n"
    )
    always = ("run", str(scenario), "--clock", "virtual", "--out", str(tmp_path / "run"))
    return lambda *words: CliRunner().invoke(main, [*always, *words])


def test_a_run_warns_of_what_never_comes(flown) -> None:
    late = "links.changes=[{at_s: 3, delay_ms: 5}, {at_s: 100, delay_ms: 300}]"
    for until, end_s, missed in (((), 5, (1,)), (("--until", "1", "--overwrite"), 1, (0, 1))):
        told = flown("--set", late, *until)
        said = [line for line in told.stderr.splitlines() if line.startswith("warning: ")]
        times_s = (3, 100)
        over = f"the flight is over at {end_s} s"
        assert said == [f"warning: links.changes.{i}.at_s: found {times_s[i]}; {over}" for i in missed]
        assert told.exit_code == 0
    assert "warning" not in flown("--set", late, "--overwrite", "--quiet").stderr


def test_what_was_not_judged_is_said_also_with_quiet(flown) -> None:
    """Of 5 s, 1 s was flown: had it been 2 s, the rest would count as judged."""
    told = flown("--quiet", "--until", "1", "--set", "expect=[{metric: error_x_m.max, below: 1}]")
    assert (told.exit_code, told.stdout) == (0, "")
    assert told.stderr == "nothing was judged: 1 of 1 expectation not judged (flown to 1.0 s of 5 s)\n"
    judged = flown("--quiet", "--overwrite", "--set", "expect=[{metric: error_x_m.max, below: 1, to_s: 2}]")
    assert (judged.exit_code, judged.output) == (0, "")
    part = "expect=[{metric: error_x_m.max, below: 1, to_s: 0.5}, {metric: error_y_m.max, below: 1}]"
    told = flown("--quiet", "--overwrite", "--until", "1", "--set", part)
    assert told.stderr == "1 of 2 expectations not judged (flown to 1.0 s of 5 s)\n"
    nothing = flown("--overwrite", "--until", "0.3")
    assert nothing.stderr.splitlines()[-1] == "nothing was judged: the scenario has no expect"
    assert nothing.exit_code == 0


def test_a_bound_that_was_broken_before_the_flight_was_cut_is_broken(flown) -> None:
    told = flown("--quiet", "--until", "1", "--set", "expect=[{metric: error_x_m.max, below: 1e-9}]")
    assert told.exit_code == Status.EXPECTATION_BROKEN
    assert told.stderr.endswith("expected: below 1e-09: broken: flown to 1.0 s of 5 s\n")


def test_late_ticks_that_spoil_a_flight_are_said_also_with_quiet(flown, monkeypatch) -> None:
    """They fail nothing by themselves. The result line of a log has their number."""
    monkeypatch.setattr(summary, "lateness", lambda *_: "late ticks: 3 of 9 began more than 10 ms late")
    told = flown("--quiet", "--set", "expect=[{metric: error_x_m.max, below: 1}]")
    assert (told.exit_code, told.output) == (0, "late ticks: 3 of 9 began more than 10 ms late\n")
    told = flown("--overwrite")
    assert "late ticks: 3 of 9 began" in told.stdout
    assert "; late ticks: 0 of " in told.stderr
