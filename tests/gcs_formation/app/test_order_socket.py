"""Orders through a run directory's socket, from another thread as from another process."""

from __future__ import annotations

import resource
import socket
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest
from click.testing import CliRunner

from formation_scenario.orders import Answer
from gcs_formation.app.order_socket import MAX_BYTES, MAX_CALLERS, OrderSocket, tell
from gcs_formation.cli import main
from gcs_formation.errors import NothingRunningError


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Return a directory whose path is longer than a Unix socket's may be."""
    deep = tmp_path.joinpath(*["a-long-name-of-a-directory"] * 6)
    deep.mkdir(parents=True)
    return deep


def echo(text: str) -> Answer:
    return Answer(text != "land", f"heard {text}")


def test_an_order_is_answered_and_the_socket_is_gone_afterwards(directory: Path) -> None:
    with ThreadPoolExecutor() as pool, OrderSocket(directory, echo) as orders:
        asked = [pool.submit(tell, directory, order) for order in ("shape  line", "land")]
        while not all(each.done() for each in asked):
            orders.poll()
        assert [each.result() for each in asked] == [(True, "heard shape line"), (False, "heard land")]
    assert not list(directory.iterdir())


def test_an_order_that_is_too_long_is_answered_too(directory: Path) -> None:
    with ThreadPoolExecutor() as pool, OrderSocket(directory, echo) as orders:
        asked = pool.submit(tell, directory, "é" * 500)
        while not asked.done():
            orders.poll()
        assert asked.result() == (True, f"heard {'é' * 101}")


def test_where_nothing_runs_none_answers(directory: Path, tmp_path: Path) -> None:
    for place in (directory, tmp_path / "none"):
        with pytest.raises(NothingRunningError, match="no flight answers in"):
            tell(place, "loiter")
    with OrderSocket(directory, echo) as orders:
        assert orders is not None
        stale = directory / "orders.sock"
        assert stale.stat().st_mode & 0o777 == 0o600


def test_a_new_flight_takes_the_place_of_one_that_was_killed(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as killed:
        killed.bind(str(tmp_path / "orders.sock"))
    test_an_order_is_answered_and_the_socket_is_gone_afterwards(tmp_path)


def test_callers_that_say_nothing_or_too_much_are_dropped(tmp_path: Path) -> None:
    received: list[str] = []
    with OrderSocket(tmp_path, lambda text: Answer(True, received.append(text) or text)) as orders:
        with socket.socket(socket.AF_UNIX) as gone, socket.socket(socket.AF_UNIX) as loud:
            for caller in (gone, loud):
                caller.connect(str(tmp_path / "orders.sock"))
            loud.sendall(b"x" * 2 * MAX_BYTES)
        for _ in range(10):
            orders.poll()
    assert received == []


def test_where_no_more_files_may_be_opened_an_order_waits(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    with OrderSocket(tmp_path, echo) as orders, socket.socket(socket.AF_UNIX) as caller:
        caller.connect(str(tmp_path / "orders.sock"))
        caller.sendall(b"land\n")
        resource.setrlimit(resource.RLIMIT_NOFILE, (0, before[1]))
        try:
            orders.poll()
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, before)
        caller.setblocking(False)
        with pytest.raises(BlockingIOError):
            caller.recv(MAX_BYTES)
        orders.poll()
        assert b"heard land" in caller.recv(MAX_BYTES)


@pytest.mark.parametrize("said", [b"", b"shape"])
def test_callers_that_go_on_saying_nothing_keep_none_from_an_answer(tmp_path: Path, said: bytes) -> None:
    with ThreadPoolExecutor() as pool, OrderSocket(tmp_path, echo) as orders, ExitStack() as silent:
        for _ in range(2 * MAX_CALLERS):
            caller = silent.enter_context(socket.socket(socket.AF_UNIX))
            caller.connect(str(tmp_path / "orders.sock"))
            caller.sendall(said)
            orders.poll()
        asked = pool.submit(tell, tmp_path, "shape line")
        while not asked.done():
            orders.poll()
        assert asked.result() == (True, "heard shape line")


def test_of_too_many_callers_the_one_that_came_first_is_dropped(tmp_path: Path) -> None:
    with OrderSocket(tmp_path, echo) as orders, ExitStack() as calling:
        callers = [calling.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(MAX_CALLERS + 1)]
        for caller in callers:
            caller.connect(str(tmp_path / "orders.sock"))
            caller.setblocking(False)
            orders.poll()
        assert callers[0].recv(1) == b""
        callers[1].sendall(b"shape line\n")
        orders.poll()
        assert b"heard shape line" in callers[1].recv(MAX_BYTES)


@pytest.mark.parametrize(
    ("order", "status", "said"),
    [
        ("spacing -3", 2, "found '-3'; allowed: a number of m, more than 0"),
        ("heading -30", 3, "no flight answers"),
        ("speed -5", 2, "found '-5'; allowed: a number from 0 to 1000 m/s"),
        ("stats", 2, "land, status (did you mean 'status'?)"),
    ],
)
def test_an_order_is_read_before_any_is_asked(order: str, status: int, said: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["tell", str(tmp_path), *order.split()])
    assert done.exit_code == status
    assert said in done.stderr
