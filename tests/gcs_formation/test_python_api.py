"""`gcs_formation.run`, as called by a script."""

from pathlib import Path
from typing import Any

import pytest

import gcs_formation
from formation_scenario.expectation import Expectation
from gcs_formation.record.verdict import Verdict
from tests.flights.conftest import scenario
from tests.processes import events_of


def test_a_summary_says_where_the_run_is_and_an_earlier_run_is_replaced_on_request_only(tmp_path: Path) -> None:
    """The repeated flight is the same: under the virtual clock no delay depends on the machine's speed."""
    keys: dict[str, Any] = {"clock": "virtual", "until": 0.5, "out": tmp_path / "run"}
    summary = gcs_formation.run(scenario(), **keys)
    assert summary.run_dir == tmp_path / "run"
    first = summary.to_dict()
    assert first["duration_s"] == pytest.approx(0.5, abs=0.11)
    assert first["assembled"] is True
    with pytest.raises(gcs_formation.RecordError, match=r"found an earlier run in .*overwrite=True"):
        gcs_formation.run(scenario(), **keys)
    again = gcs_formation.run(scenario(), **keys, overwrite=True).to_dict()
    assert again["links"] == first["links"]
    assert again["stability"] == first["stability"]
    assert again["control"]["compute_ms"] != first["control"]["compute_ms"]


def test_a_loop_that_is_unstable_whatever_its_delay_keeps_no_margin(tmp_path: Path) -> None:
    expect = [{"metric": "margin_used", "below": 1, "to_s": 2}]
    keys = scenario(law={"speed": {"kp": 0.0}}, expect=expect, duration_s=2)
    summary = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run")
    assert summary.to_dict()["stability"]["margin_used"] is None
    assert [verdict.held for verdict in summary.verdicts] == [False]
    said = [each for each in events_of(tmp_path / "run") if each["kind"] == "delay_margin"]
    assert {each["text"] for each in said} == {"has no delay margin: its loops are unstable whatever the delay"}
    assert {each["used"] for each in said} == {None}


@pytest.mark.slow
def test_a_summary_draws_the_report_of_its_run(tmp_path: Path) -> None:
    summary = gcs_formation.run(scenario(), clock="virtual", until=0.5, out=tmp_path / "run")
    assert summary.report() == tmp_path / "run" / "report.html"
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"law__rate_hz": 0.1}, "law.rate_hz=0.1: law.rate_hz: found 0.1; allowed: "),
        ({"expect__7__below": 3}, "expect.7.below=3: "),
        ({"law__rate_hz": object()}, "law.rate_hz: found a object; allowed: "),
    ],
)
def test_a_wrong_key_is_named_as_it_was_given_and_not_as_an_option_of_the_command(
    keys: dict[str, Any], said: str
) -> None:
    with pytest.raises(gcs_formation.ScenarioError) as refused:
        gcs_formation.run(scenario(), **keys)
    assert str(refused.value).startswith(said)
    assert "--set" not in str(refused.value)


def test_what_is_no_scenario_is_refused() -> None:
    with pytest.raises(gcs_formation.ScenarioError, match=r"found \[1, 2\]; allowed: a file, a mapping"):
        gcs_formation.run([1, 2])  # type: ignore[arg-type]


def test_an_empty_directory_name_is_refused() -> None:
    with pytest.raises(ValueError, match="out: found ''; allowed: a directory"):
        gcs_formation.run(scenario(), out="")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"until": "x"}, "until: found 'x'; allowed: a number >= 0"),
        ({"speedup": None}, "speedup: found None; allowed: a number from 0.01 to 1000"),
    ],
)
def test_an_option_that_is_no_number_is_refused(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        gcs_formation.run(scenario(), clock="virtual", out=tmp_path / "run", **keys)


def test_a_mistyped_option_is_reported_the_nearest_option_or_key() -> None:
    for name, near in (("untl", "until"), ("clok", "clock"), ("law_", "law")):
        mistyped: dict[str, Any] = {name: 3}
        with pytest.raises(gcs_formation.ScenarioError, match=rf"clock, speedup, until, .*did you mean '{near}'"):
            gcs_formation.run(scenario(), **mistyped)


def test_what_is_imported_on_first_use_is_listed() -> None:
    assert set(gcs_formation.__all__) <= set(dir(gcs_formation))


@pytest.mark.parametrize(
    ("verdicts", "breaches", "held", "said"),
    [
        ([True, True], (), True, "held"),
        ([True, None], (), True, "held (1 of 2 not judged)"),
        ([False, None], (), False, "not held (1 of 2 not judged)"),
        ([None, None], (), None, "nothing judged"),
        ([], (), None, "nothing judged"),
        ([None], ("safety broken: clearance was 1 m",), False, "not held (1 of 1 not judged)"),
    ],
)
def test_a_summary_is_shown_in_a_line_and_holds_only_what_was_judged(
    verdicts: list[bool | None], breaches: tuple[str, ...], held: bool | None, said: str, tmp_path: Path
) -> None:
    each = {f"error_{axis}_m": {"rms": rms} for axis, rms in zip("xyz", (0.123, 0.2, None), strict=True)}
    bound = Expectation(metric="error_x_m.max", to_s=9.0, below=1.0)
    judged = tuple(Verdict(bound, None, 2.0 if kept is False else 0.1, judged=kept is not None) for kept in verdicts)
    shown = gcs_formation.Summary({"duration_s": 9.96, "followers": {"2": each}}, judged, breaches, tmp_path)
    assert shown.held is held
    assert repr(shown) == f"Summary({tmp_path}, {said}, 10.0 s, 2: 0.12 / 0.20 / - m RMS)"
