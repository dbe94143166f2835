"""The plugin in its users' pytest sessions."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

EXAMPLES = Path(__file__).parents[3] / "examples"
PLUGIN = ("-p", "gcs_formation.testing.plugin", "-p", "no:cacheprovider")


@pytest.fixture
def session(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """Return a directory to run pytest in, where only named plugins are loaded."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.delenv("FORMATION_SCENARIO", raising=False)
    return pytester


@pytest.mark.slow
def test_the_examples_hold(session):
    for example in EXAMPLES.iterdir():
        if example.is_file():
            (session.path / example.name).write_bytes(example.read_bytes())
    session.runpytest(*PLUGIN).assert_outcomes(passed=3, skipped=1)


@pytest.mark.slow
def test_a_broken_claim_shows_the_users_line_and_what_was_found(session):
    (session.path / "diamond.yaml").write_bytes((EXAMPLES / "diamond.yaml").read_bytes())
    session.makepyfile(
        """
        def test_too_much_to_ask(formation):
            flight = formation("diamond.yaml", seed=5).with_link(vehicle=3, delay_ms=100).fly(until=1)
            flight.stays_within(1e-9, axes="x")
        """
    )
    result = session.runpytest(*PLUGIN)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            '>*flight.stays_within(1e-9, axes="x")',
            "E*AssertionError: more than 1e-09 m from the slot along x from 0 s to 1 s",
            "E*vehicle ?: |error_x| = * m at * s",
            "E*seed 5, errors by ground truth, recorded in *flight-1",
            "E*again: gcs-formation run *diamond.yaml --set seed=5 --set 'links.changes=*vehicles: *3*--until 1",
        ]
    )
    result.stdout.no_fnmatch_line("*flown.py*")


def test_a_session_that_flies_nothing_imports_nothing_that_flies(session):
    session.makepyfile("def test_two(): assert 1 + 1 == 2")
    loaded = "import sys; print([n for n in ('numpy', 'pydantic', 'scipy', 'pyarrow', 'airlink') if n in sys.modules])"
    code = f"import pytest; status = pytest.main(['-q', '-p', 'gcs_formation.testing.plugin']); {loaded}; exit(status)"
    root = {"PYTHONPATH": str(EXAMPLES.parent), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=session.path,
        env=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "[]"
