from collections.abc import Callable

import pytest

from formation_scenario import Scenario, ScenarioError, load_scenario


def minimal() -> dict[str, object]:
    return {
        "vehicles": [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3}, {"id": 4}],
        "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]},
    }


@pytest.fixture
def load() -> Callable[..., Scenario]:
    """Load the shortest scenario, a leader and three followers on a straight path, with overrides."""
    return lambda *overrides: load_scenario(minimal(), overrides)


@pytest.fixture
def refusal(load: Callable[..., Scenario]) -> Callable[..., list[str]]:
    """Return the lines that refuse the shortest scenario with overrides, without the overrides' names."""

    def lines(*overrides: str) -> list[str]:
        with pytest.raises(ScenarioError) as refused:
            load(*overrides)
        return [f"{p.key}: {p.found}; {p.allowed}" for p in refused.value.problems]

    return lines
