"""Flights of vehicles whose lags differ from those of the station's model, with 300 ms each way."""

from pathlib import Path

import pytest

import gcs_formation

PAPER = Path(__file__).parents[2] / "configs" / "paper.yaml"
BELIEVED = {"tau_v_s": 4.0, "tau_psi_s": 1.5, "tau_ha_s": 1.0, "tau_hb_s": 3.0}
DISTURBED_S = 60.0


def errors_m(out, *ratios):
    """Return the largest errors, x and y, after 0.6 m/s north and east on all; ratios of four lags for each vehicle."""
    vehicles = [
        {
            "id": number,
            "role": "leader" if number == 1 else "follower",
            "true_model": {lag: tau_s * ratio for (lag, tau_s), ratio in zip(BELIEVED.items(), each, strict=True)},
        }
        for number, each in enumerate(ratios, 1)
    ]
    summary = gcs_formation.run(
        PAPER,
        clock="virtual",
        out=out / "run",
        duration_s=DISTURBED_S + 20,
        vehicles=vehicles,
        links={"default": {"delay_ms": 300}},
        disturbances=[{"at_s": DISTURBED_S, "vehicles": "all", "velocity_mps": [0.6, 0.6, 0.0]}],
        expect=[{"metric": f"error_{axis}_m.max", "from_s": DISTURBED_S, "above": 0.0} for axis in "xy"],
    )
    found = [(v.expectation.metric, v.value) for v in summary.verdicts if v.value is not None]
    return [max(value for metric, value in found if metric == f"error_{axis}_m.max") for axis in "xy"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratios", "x_m", "y_m"),
    [
        ([(1.3, 1.3, 1.3, 1.3)] * 4, 0.0091, 0.011),
        ([(0.5, 0.5, 1.0, 1.0)] * 4, 0.05, 0.06),
        ([(1.3, 0.7, 1.3, 0.7), (0.7, 1.3, 0.7, 1.3), (1.3, 1.3, 0.7, 0.7), (0.7, 0.7, 1.3, 1.3)], 0.05, 0.06),
    ],
    ids=["30 % longer", "half as long", "each its own"],
)
def test_time_constants_that_are_not_the_models_are_estimated_within_a_minute(tmp_path, ratios, x_m, y_m):
    """The first bounds are 1.3 times the measured errors; with unlearned lags, errors would be 0.071 and 0.149 m."""
    found = errors_m(tmp_path, *ratios)
    assert found[0] <= x_m
    assert found[1] <= y_m
