"""The gymnasium environment of the examples keeps gymnasium's contract, and is small."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

FILE = Path(__file__).parents[2] / "examples" / "gymnasium_env.py"


@pytest.fixture
def example(tmp_path, monkeypatch) -> Any:
    pytest.importorskip("gymnasium")  # of the extra `test`
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    spec = importlib.util.spec_from_file_location("gymnasium_env", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_has_at_most_sixty_lines():
    assert len(FILE.read_text(encoding="utf-8").splitlines()) <= 60


@pytest.mark.slow
def test_an_episode_is_reproducible_by_its_seed_and_the_action_reaches_the_leader(example):
    def episode(seed: int, actions: tuple[int, ...]) -> tuple[list[Any], float]:
        env = example.LeaderSpeed()
        seen, info = env.reset(seed=seed)
        assert (env.observation_space.contains(seen), info) == (True, {})
        steps = [env.step(action) for action in actions]
        tick = next(env.flight)
        env.close()
        assert all(env.observation_space.contains(step[0]) for step in steps)
        assert [step[2:4] for step in steps] == [(False, False)] * len(steps)
        return [seen, *(step[0] for step in steps)], tick.vehicles[1].setpoint[0]

    first, fast_mps = episode(3, (2, 2))
    again, _ = episode(3, (2, 2))
    slow, slow_mps = episode(3, (0, 0))
    assert all(np.array_equal(*each) for each in zip(first, again, strict=True))
    assert np.array_equal(first[0], slow[0])
    assert not np.array_equal(first[-1], slow[-1])
    assert fast_mps > slow_mps
