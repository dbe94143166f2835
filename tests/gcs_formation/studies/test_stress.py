"""Seeded flights: the same seed draws the same flight, and none breaks an invariant."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

import pytest
from click.testing import CliRunner

from airlink.telemetry_faults import QUANTITIES
from formation_scenario import Scenario, dump_scenario
from formation_scenario.surroundings import FaultKind
from gcs_formation.cli import main
from gcs_formation.errors import RunAbortedError
from gcs_formation.studies import INVARIANTS, Study, flight
from gcs_formation.studies.flight import Task, fly
from gcs_formation.studies.plan import Planned
from gcs_formation.studies.random_scenarios import HARD, TELEMETRY, draw

SEEDS_EACH = 2


def flown(seed: int, severity: Literal["usual", "hard"] = "usual") -> str:
    """Fly a seed; return what it broke."""
    study = Study(random=severity, metrics=(INVARIANTS,), record="none")
    return fly(Task(Planned(0, seed, {}), study, {}))["words"]


def test_a_seed_is_one_scenario_and_seeds_differ() -> None:
    drawn = [dump_scenario(draw(seed)) for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    return [draw(seed) for seed in range(50)]


@pytest.mark.slow
def test_seeds_cover_what_may_happen() -> None:
    scenarios = [draw(seed) for seed in range(200)]
    assert {fault.kind for each in scenarios for fault in each.faults} == set(get_args(FaultKind)) - {"telemetry"}
    assert {each.formation.frame for each in scenarios} == {"leader_heading", "follower_heading"}
    assert len({each.formation.shape for each in scenarios}) == 9
    assert any(change.outage for each in scenarios for change in each.links.changes)
    assert any(not each.start.in_air for each in scenarios)


def test_faults_of_telemetry_are_drawn_where_asked_for() -> None:
    faults = [fault for seed in range(40) for fault in draw(seed, TELEMETRY).faults]
    assert {each.kind for each in faults} == {"telemetry"}
    assert {each.quantity for each in faults} == set(QUANTITIES)
    assert len({each.effect for each in faults}) > 8
    assert all(each.for_s is not None for each in faults)


def test_a_vehicle_that_its_pilot_takes_is_heard(scenarios: list[Scenario]) -> None:
    for each in scenarios:
        taken = {number for fault in each.faults if fault.kind == "pilot" for number in fault.vehicles}
        silent = {number for change in each.links.changes if change.outage for number in change.vehicles}
        assert not taken & silent


def test_hard_flights_are_faster_and_in_trouble_for_longer(scenarios: list[Scenario]) -> None:
    hard = [draw(seed, HARD) for seed in range(30)]
    for harder in (
        lambda each: each.law.rate_hz,
        lambda each: each.path.speed_mps,
        lambda each: max(abs(mps) for mps in each.wind.velocity_mps),
        lambda each: max((fault.until_s - fault.at_s for fault in each.faults if fault.until_s), default=0.0),
        lambda each: each.duration_s,
    ):
        assert max(map(harder, hard)) > max(map(harder, scenarios))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1, 101, SEEDS_EACH))
def test_seeded_flights_break_nothing(first: int) -> None:
    assert [wrong for seed in range(first, first + SEEDS_EACH) if (wrong := flown(seed))] == []


@pytest.mark.slow
def test_a_leader_that_its_pilot_takes_600_m_away_is_in_its_slot_again() -> None:
    assert flown(14, "hard") == ""


@pytest.mark.parametrize("hard", [[], ["--hard"]])
def test_the_command_names_the_seed_that_breaks_something(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, hard: list[str]
) -> None:
    def run(scenario: Scenario, *_: object) -> None:
        raise RunAbortedError(f"{scenario.name}: vehicle 2 doesn't answer")

    monkeypatch.setattr(flight, "run", run)
    result = CliRunner().invoke(main, ["stress", *hard, "--count", "1", "--seed", "7", "--out", str(tmp_path / "run")])
    assert result.exit_code == 1
    name = "stress-hard-7" if hard else "stress-7"
    assert f"seed 7: completed: {name}: vehicle 2 doesn't answer" in result.stderr
    assert " ".join(["gcs-formation stress", *hard, "--count 1 --seed 7"]) in result.stderr
    assert result.stdout == "1 flight, seed 7: 1 broke an invariant\n"


def test_a_flight_that_raises_is_one_that_broke_something(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object) -> None:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(flight, "run", run)
    assert flown(7) == "raised ZeroDivisionError('by nothing')"


def test_what_an_earlier_run_left_is_replaced_with_overwrite_only(tmp_path: Path) -> None:
    (tmp_path / "run.yaml").touch()
    result = CliRunner().invoke(main, ["stress", "--count", "1", "--out", str(tmp_path)])
    assert (result.exit_code, "found an earlier run" in result.stderr) == (2, True)


def test_a_record_is_kept_of_one_flight_only() -> None:
    result = CliRunner().invoke(main, ["stress", "--out", "anywhere"])
    assert (result.exit_code, "allowed: --count 1" in result.stderr) == (2, True)
