"""How the page is asked for on the command line, and what is refused there."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from airlink.endpoint import Address
from gcs_formation.cli.view import VIEW, VIEW_ORDERS, WithView, view
from tests.gcs_formation.view.conftest import Flown

ASKED = [
    (["a.yaml", "--view"], Address("127.0.0.1", 0)),
    (["--view", "a.yaml"], Address("127.0.0.1", 0)),
    (["--view", "--quiet", "a.yaml"], Address("127.0.0.1", 0)),
    (["--view", "0.0.0.0:8080", "a.yaml"], Address("0.0.0.0", 8080)),
    (["a.yaml", "--view=[::1]:80"], Address("::1", 80)),
    (["a.yaml", "--view", ":8080"], Address("127.0.0.1", 8080)),
    (["a.yaml"], None),
]


@pytest.fixture
def command() -> click.Command:
    @click.command(cls=WithView)
    @click.argument("scenario")
    @click.option("--quiet", is_flag=True)
    @VIEW
    @VIEW_ORDERS
    def run(scenario: str, quiet: bool, view: Address | None, view_orders: bool) -> None:
        click.echo(f"{scenario} {view}")

    return run


@pytest.mark.parametrize(("arguments", "address"), ASKED)
def test_the_address_may_be_left_out(command, arguments: list[str], address: Address | None) -> None:
    assert CliRunner().invoke(command, arguments).output == f"a.yaml {address}\n"


@pytest.mark.parametrize("address", ["nonsense", "127.0.0.1:x", "127.0.0.1:70000", "1:2:"])
def test_what_is_no_address_is_refused(command, address: str) -> None:
    done = CliRunner().invoke(command, ["a.yaml", "--view", address])
    assert done.exit_code == 2
    assert "allowed: HOST:PORT" in done.output


def test_a_port_that_is_taken_is_exit_3_and_what_is_no_recording_2(flown: Flown, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = CliRunner().invoke(view, [str(flown.finished), "--address", f"127.0.0.1:{port}"])
    assert done.exit_code == 3
    assert "allowed: a free port" in done.stderr
    done = CliRunner().invoke(view, [str(tmp_path)])
    assert done.exit_code == 2
    assert "allowed: the directory of a run" in done.stderr


def test_what_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs_formation.app.viewer.NEEDED", ("starlette", "no_such_package"))
    done = CliRunner().invoke(view, [str(tmp_path)])
    assert done.exit_code == 2
    assert "found no no_such_package, which the page needs; allowed: pip install 'gcs-formation[view]'" in done.stderr


def test_a_flight_without_the_page_imports_nothing_of_it() -> None:
    script = "import gcs_formation.cli.run_and_fly, sys; print(*sys.modules)"
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert not [name for name in said if name.startswith(("gcs_formation.view", "gcs_formation.app.viewer", "uvicorn"))]
