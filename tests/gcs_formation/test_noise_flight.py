"""Flights with telemetry noise other than declared, against flights with the right declaration.

The sensors' errors come from the same random numbers in both, so they differ in size only.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

import gcs_formation

NOISE = Path(__file__).parents[2] / "configs" / "noise.yaml"
DECLARED = {"position_sigma_m": 0.3, "velocity_sigma_mps": 0.1, "airspeed_sigma_mps": 0.2, "heading_sigma_deg": 0.5}
"""The noise in configs/noise.yaml."""
SETTLED_S, END_S = 25.0, 60.0
Errors = tuple[float, float]


def times(share: float) -> dict[str, float]:
    """Return the declared noise times `share`."""
    return {key: sigma * share for key, sigma in DECLARED.items()}


def fly(true: dict[str, float], declared: dict[str, float] | None, delay_ms: float) -> Errors:
    """Return the worst follower's rms of the true errors along x and y, m; `declared` is None for exact telemetry."""
    noisy = {"source": "noisy", **DECLARED}
    with TemporaryDirectory() as out:
        summary = gcs_formation.run(
            NOISE,
            clock="virtual",
            out=Path(out) / "run",
            duration_s=END_S,
            vehicles={
                "count": 4,
                "navigation": {"source": "truth"} if declared is None else noisy | declared,
                "true_navigation": noisy | (declared or {}) | true,
            },
            links={"default": {"delay_ms": delay_ms}},
            disturbances=[],
            expect=[{"metric": f"error_{axis}_m.rms", "from_s": SETTLED_S, "above": 0.0} for axis in "xy"],
        )
    found = [(v.expectation.metric, v.value) for v in summary.verdicts if v.value is not None]
    x_m, y_m = (max(value for metric, value in found if metric == f"error_{axis}_m.rms") for axis in "xy")
    return x_m, y_m


@cache
def rightly_declared(share: float, delay_ms: float) -> Errors:
    """Return the errors with the noise of configs/noise.yaml times `share`, declared as such."""
    return fly({}, times(share), delay_ms)


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0.0, 300.0])
@pytest.mark.parametrize("share", [0.3, 2.0, 4.0])
def test_noise_that_is_not_as_declared_costs_half_as_much_again_at_most(share: float, delay_ms: float) -> None:
    found, right = fly(times(share), DECLARED, delay_ms), rightly_declared(share, delay_ms)
    assert found[0] <= 1.5 * right[0]
    assert found[1] <= 1.5 * right[1]


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0.0, 300.0])
def test_noise_of_which_nothing_is_declared_is_found_in_flight(delay_ms: float) -> None:
    found, right = fly({}, None, delay_ms), rightly_declared(1.0, delay_ms)
    assert found[0] <= 1.5 * right[0]
    assert found[1] <= 1.5 * right[1]


@pytest.mark.slow
def test_a_receiver_three_times_as_noisy_as_declared_leaves_a_third_of_its_error() -> None:
    assert max(fly({"position_sigma_m": 1.0}, DECLARED, 0.0)) <= 0.35


@pytest.mark.slow
def test_ten_times_the_declared_noise_is_flown_through() -> None:
    """Position is known to 3 m, airspeed to 2 m/s: errors stay below a single sample's, and don't grow."""
    assert max(fly(times(10.0), DECLARED, 300.0)) <= 3.0


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0.0, 300.0])
def test_outliers_are_ridden_through(delay_ms: float) -> None:
    """One sample in twenty is 20 m off."""
    found, without = (
        fly({"outlier_share": 0.05, "outlier_m": 20.0}, DECLARED, delay_ms),
        rightly_declared(1.0, delay_ms),
    )
    assert found[0] <= 1.5 * without[0]
    assert found[1] <= 1.5 * without[1]


def test_errors_that_last_are_no_reason_to_follow_the_model_past_a_gust() -> None:
    """A gust of 3 m/s on both; errors last for 20 s. If declared so, the follower was 18 m aside, otherwise 0.9 m."""
    keys = {"source": "noisy", **DECLARED, "correlation_s": 20}
    with TemporaryDirectory() as out:
        summary = gcs_formation.run(
            {
                "vehicles": [{"id": 1, "role": "leader"}, {"id": 2, "navigation": keys}],
                "path": {"waypoints_m": [[0, 0, 100], [6000, 0, 100]]},
                "formation": {"shape": "custom", "slots_m": {2: [-15, 15, 0]}},
                "duration_s": 45,
                "start": {"in_air": True},
                "disturbances": [{"at_s": 20, "kind": "step", "velocity_mps": [3, 3, 0]}],
            },
            clock="virtual",
            out=Path(out) / "run",
        )
    assert max(summary.figures["followers"]["2"][f"error_{axis}_m"]["max"] for axis in "xy") < 3.0
