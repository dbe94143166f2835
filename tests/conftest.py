"""Settings of all tests."""

import gc
import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

from airlink.cli import OBJECTS, calculate_in_one_thread

calculate_in_one_thread()  # as commands do; saves a third of the processor time where eigenvalues are tested
gc.set_threshold(OBJECTS)  # as commands do, too
# The duration of an example says nothing on a busy machine; the same examples in every run do.
settings.register_profile("nightly", deadline=None, derandomize=True)
settings.register_profile("push", settings.get_profile("nightly"), max_examples=50)


def pytest_configure(config: pytest.Config) -> None:
    """Try half as many examples if slow tests are left to the night, where each test has the usual hundred."""
    settings.load_profile("push" if config.option.markexpr == "not slow" else "nightly")


def pytest_collection_finish() -> None:
    """Exclude objects that stay from garbage collection, which saves a tenth of the tests' time."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which tests of the page were left out, and why: they need a browser."""
    skipped = {
        str(each.longrepr[2]) for each in terminalreporter.stats.get("skipped", []) if "browser" in str(each.longrepr)
    }
    for reason in sorted(skipped):
        terminalreporter.write_line(f"left out: {reason.removeprefix('Skipped: ')}")


@pytest.fixture
def foreground() -> Iterator[None]:
    """Restore the default handling of Ctrl-C and hang-ups: `nohup … &` has both ignored, and children inherit that."""
    before = {
        signal.SIGINT: signal.signal(signal.SIGINT, signal.default_int_handler),
        signal.SIGHUP: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    }
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
