"""Settings of all tests."""

import gc

from hypothesis import settings

# How long an example takes says nothing on a busy machine; the same examples in every run do.
settings.register_profile("everywhere", deadline=None, derandomize=True)
settings.load_profile("everywhere")


def pytest_collection_finish() -> None:
    """Look for garbage seldom, and not among what is there for good: a tenth of the time that the tests take."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000)
