"""`gcs-formation signing`: what it refuses, and vehicles that get a key over UDP and lose it again."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner, Result

from airlink.signing.key import read_key
from gcs_formation.cli import main
from tests.flights.conftest import scenario
from tests.processes import VEHICLES, free_ports, started


def signing(*arguments: str | Path) -> Result:
    """Run the command line with these arguments in this process."""
    return CliRunner().invoke(main, ["signing", *map(str, arguments)])


def written(directory: Path, endpoint: str = "udpin:127.0.0.1:14550", **keys: Any) -> Path:
    """Return a scenario with two vehicles, and a key for them."""
    (directory / "link.key").write_text("a passphrase")
    (directory / "link.key").chmod(0o600)
    links = {"default": {"signing": {"key_file": "link.key"}}}
    file = directory / "scenario.yaml"
    vehicles = [{"id": 1, "role": "leader", "endpoint": endpoint}, {"id": 2, "endpoint": endpoint}]
    file.write_text(yaml.safe_dump(scenario(vehicles=vehicles, **({"links": links} | keys))))
    return file


def test_a_new_key_is_written_once_for_its_owner(tmp_path: Path) -> None:
    file = tmp_path / "new.key"
    first = signing("key", file)
    assert (first.exit_code, stat.S_IMODE(file.stat().st_mode)) == (0, 0o600)
    key = read_key(file)
    again = signing("key", file)
    assert (again.exit_code, read_key(file)) == (2, key)
    assert "File exists" in again.output
    assert key.octets.hex() not in first.output


@pytest.mark.parametrize(
    ("endpoint", "options", "found"),
    [
        ("udpin:0.0.0.0:14550", [], "found udpin:0.0.0.0:14550; allowed: loopback, or with --cable a serial line"),
        ("udpin:0.0.0.0:14550", ["--cable"], "found udpin:0.0.0.0:14550; allowed: loopback"),
        ("tcp:192.0.2.1:5760", [], "found tcp:192.0.2.1:5760; allowed: loopback"),
        ("mcast:", ["--cable"], "found mcast:239.255.145.50:14550; allowed: loopback"),
        ("serial:/dev/ttyUSB0:57600", [], "found serial:/dev/ttyUSB0:57600; allowed: loopback, or with --cable"),
        ("udpin:127.0.0.1:14550", ["--vehicles", "3"], "--vehicles: found 3; allowed: the scenario's vehicles, 1, 2"),
        ("udpin:127.0.0.1:14550", ["--vehicles", "x"], "found 'x'; allowed: system ids such as 2,3"),
    ],
)
def test_a_key_is_never_sent_where_others_listen(tmp_path: Path, endpoint: str, options: list[str], found: str) -> None:
    result = signing("setup", written(tmp_path, endpoint), *options)
    assert result.exit_code == 2
    assert found in result.output


def test_without_a_key_there_is_nothing_to_set_up(tmp_path: Path) -> None:
    result = signing("setup", written(tmp_path, links={}))
    assert result.exit_code == 2
    assert "links.default.signing: found none for vehicle 1; allowed: {key_file: FILE}" in result.output


@pytest.mark.slow
def test_vehicles_get_a_key_and_lose_it(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    file = written(tmp_path, f"udpin:127.0.0.1:{port}", start={"in_air": False})
    plain = ["--set", "links.default.signing.key_file=none"]
    with started([*VEHICLES, file, "--quiet", *plain]):
        given = signing("setup", file)
        assert given.exit_code == 0, given.output
        assert given.output.count("signs with the key") == 2
        taken = signing("remove", file)
        assert taken.exit_code == 0, taken.output
        assert taken.output.count("signs no more") == 2
