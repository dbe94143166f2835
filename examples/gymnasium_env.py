"""A gymnasium environment: choose the leader's speed every 2 s so that followers over bad links keep their slots.

pip install gymnasium; python examples/gymnasium_env.py
"""

import math
import tempfile
from pathlib import Path

import gymnasium
import numpy as np

import gcs_formation

SCENARIO = Path(__file__).parent / "diamond.yaml"
SPEEDS_MPS = (20, 22, 24)
TICKS = 20


class LeaderSpeed(gymnasium.Env):
    """Observation: each follower's formation error forward and right, m; reward: minus their RMS, plus the speed."""

    def __init__(self, delay_ms=300.0):
        self.delay_ms, self.flight = delay_ms, None
        self.followers = [each.vehicle_id.system for each in gcs_formation.load_scenario(SCENARIO).followers]
        self.action_space = gymnasium.spaces.Discrete(len(SPEEDS_MPS))
        self.observation_space = gymnasium.spaces.Box(-math.inf, math.inf, (len(self.followers), 2), np.float32)

    def reset(self, *, seed=None, options=None):  # noqa: ARG002 - as gymnasium calls it
        super().reset(seed=seed)
        self.close()
        out = Path(tempfile.mkdtemp()) / "run"
        self.flight = gcs_formation.Flight(SCENARIO, clock="virtual", seed=int(self.np_random.integers(2**31)), out=out)
        self.flight.__enter__()
        self.flight.link(self.followers, delay_ms=self.delay_ms, loss=0.05)
        return self._seen(next(tick for tick in self.flight if tick.phase == "flying")), {}

    def step(self, action):
        self.flight.tell(f"speed {SPEEDS_MPS[action]}")
        ticks = [tick for _, tick in zip(range(TICKS), self.flight, strict=False) if tick.phase == "flying"]
        seen = self._seen(ticks[-1]) if ticks else np.zeros(self.observation_space.shape, np.float32)
        reward = 0.1 * SPEEDS_MPS[action] - float(np.sqrt(np.mean(seen**2)))
        return seen, reward, len(ticks) < TICKS, False, {}

    def close(self):
        if self.flight is not None:
            self.flight.__exit__(None, None, None)
            self.flight = None

    def _seen(self, tick):
        return np.nan_to_num([tick.vehicles[each].error_m[:2] for each in self.followers]).astype(np.float32)


if __name__ == "__main__":
    env = LeaderSpeed()
    seen, _ = env.reset(seed=3)
    for action in (1, 2, 2, 0):
        seen, reward, over, _, _ = env.step(action)
        print(f"{SPEEDS_MPS[action]} m/s: reward {reward:.2f}, largest error {abs(seen).max():.2f} m")
    env.close()
