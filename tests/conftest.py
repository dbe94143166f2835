"""Settings of all tests."""

import gc
import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

from airlink.cli import OBJECTS, calculate_in_one_thread

calculate_in_one_thread()  # as commands do; a third less processor time where eigenvalues are tested
gc.set_threshold(OBJECTS)  # as commands do, too
# How long an example takes says nothing on a busy machine; the same examples in every run do.
settings.register_profile("nightly", deadline=None, derandomize=True)
settings.register_profile("push", settings.get_profile("nightly"), max_examples=50)


def pytest_configure(config: pytest.Config) -> None:
    """Try half of the examples where slow tests are left to the night; those of the night are the usual hundred."""
    settings.load_profile("push" if config.option.markexpr == "not slow" else "nightly")


def pytest_collection_finish() -> None:
    """Look for garbage not among what is there for good: a tenth of the time that the tests take."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def foreground() -> Iterator[None]:
    """Ctrl-C and hang-ups as a job in a shell's foreground meets them: `nohup … &` ignores both, and hands that on."""
    before = {
        signal.SIGINT: signal.signal(signal.SIGINT, signal.default_int_handler),
        signal.SIGHUP: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    }
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
