"""Every law that a scenario can name goes through all commands."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from gcs_formation.cli import main
from gcs_formation.control.laws import LAWS

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"


def done(*arguments: str) -> str:
    result = CliRunner().invoke(main, [*arguments])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_law_is_checked_flown_drawn_and_compared(law: str, tmp_path: Path) -> None:
    chosen = ("--set", f"law.type={law}", "--set", "expect=[]")
    run, short = str(tmp_path / "run"), ("--clock", "virtual", "--until", "5", "--quiet")
    assert f"type: {law}" in done("check", str(QUICKSTART), "--no-fly", *chosen)
    done("run", str(QUICKSTART), *chosen, *short, "--out", run)
    done("report", run)
    assert f"{LAWS[law].name} at " in (tmp_path / "run" / "report.html").read_text()
    assert law in done("compare", str(QUICKSTART), "--laws", law, "--until", "5", "--out", str(tmp_path / "laws"))
