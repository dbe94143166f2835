"""A flight over a recorded link."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gcs_formation


def test_a_recorded_lte_link_of_5_hz_is_flown_with_its_own_mean_delay(tmp_path: Path) -> None:
    """332 ms on average, up to 0.87 s, falling no faster than a queue drains.

    Datagrams that answer others come when the uplink has just become quicker, so theirs is a little less.
    """
    random, delays_ms = np.random.default_rng(4), [300.0]
    for _ in range(99):
        delays_ms.append(max(50.0, delays_ms[-1] - 150.0, 1e3 * random.gamma(2.0, 0.13)))
    scale = 332.0 / float(np.mean(delays_ms))
    rows = "".join(f"{0.2 * number:.1f},{2.0 * scale * each:.3f}\n" for number, each in enumerate(delays_ms))
    (tmp_path / "lte.csv").write_text(f"t_s,rtt_ms\n{rows}")
    summary = gcs_formation.run(
        {
            "vehicles": {"count": 2},
            "start": {"in_air": True},
            "path": {"speed_mps": 22.0, "waypoints_m": [[0, 0, 100], [2000, 0, 100]]},
            "links": {"default": {"trace": {"file": str(tmp_path / "lte.csv"), "column": "rtt_ms", "time": "t_s"}}},
        },
        clock="virtual",
        until=20.0,
        out=tmp_path / "run",
    ).to_dict()
    for link in summary["links"].values():
        assert link["injected_up_ms"] == pytest.approx(332.0, rel=0.04)
        assert link["injected_down_ms"] == pytest.approx(332.0, rel=0.10)
        assert link["injected_loss"] == link["injected_loss_up"] == 0.0
    assert summary["followers"]["2"]["error_x_m"]["rms"] < 0.05
