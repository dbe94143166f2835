"""Settings of all tests."""

from hypothesis import settings

# How long an example takes says nothing on a busy machine; the same examples in every run do.
settings.register_profile("everywhere", deadline=None, derandomize=True)
settings.load_profile("everywhere")
