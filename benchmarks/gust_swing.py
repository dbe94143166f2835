"""The least error, as a share of the allowed one, of a follower whose crab against a gust swings its own slot.

Equation (8) in the follower's own frame, linear about straight flight: after a step D of relative velocity along x and
y, known to the law after the round trip T, the errors are

e_x = D (T + t) + y_rc theta - the double integral of a,   |a| <= a_max
e_y = D (T + t) - v * the integral of theta - x_rc theta,  |theta'| <= psi'_max

with the crab theta and the acceleration a free from then on. A linear programme gives the least share of the allowed
errors within which any law could keep both. Takes a few seconds.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from gcs_formation.report.gusts import allowed_gust_error_m
from gcs_formation.stability.pid_margins import loop_delay_s
from gcs_formation.studies.markdown import markdown

DELAYS_MS = (20, 50, 100, 200, 300)
SLOTS_M = ((30.0, 30.0), (60.0, 0.0))
GUST_MPS, SPEED_MPS, ACCEL_MPS2, TURN_RPS = 0.6, 22.0, 1.5, 0.25
STEP_S, STEPS = 0.02, 250


def min_share(round_trip_s: float, x_rc_m: float, y_rc_m: float) -> float:
    """Return the share for the slot on that side on which its swing adds to the gust."""
    time_s, each = np.arange(1, STEPS + 1) * STEP_S, np.eye(STEPS)
    integral = np.tril(np.ones((STEPS, STEPS))) * STEP_S
    limits = np.array((ACCEL_MPS2, SPEED_MPS * TURN_RPS))
    allowed = allowed_gust_error_m(GUST_MPS, round_trip_s, limits)[:, None]
    carried = np.tile(GUST_MPS * (round_trip_s + time_s), 2)
    acts = np.block(
        [[-integral @ integral, y_rc_m * each], [np.zeros_like(integral), -SPEED_MPS * integral - x_rc_m * each]]
    )
    share = -np.repeat(allowed, STEPS, axis=0)
    turned = np.block([np.zeros_like(each), each - np.eye(STEPS, k=-1), np.zeros((STEPS, 1))])
    rows = np.vstack((np.hstack((acts, share)), np.hstack((-acts, share)), turned, -turned))
    bounds_max = np.concatenate((-carried, carried, np.full(2 * STEPS, TURN_RPS * STEP_S)))
    # At the end the follower moves at the speed of its slot.
    settled = np.concatenate((np.full(STEPS, STEP_S), np.zeros(STEPS + 1)))[None]
    bounds = [(-ACCEL_MPS2, ACCEL_MPS2)] * STEPS + [(None, None)] * STEPS + [(0.0, None)]
    cost = np.append(np.zeros(2 * STEPS), 1.0)
    min_m = linprog(cost, rows, bounds_max, settled, [GUST_MPS], bounds, method="highs").fun
    assert min_m is not None
    return float(min_m)


def main() -> None:
    """Print a row for each delay."""
    rows: list[list[str]] = []
    for delay_ms in DELAYS_MS:
        round_trip_s = loop_delay_s(delay_ms / 1e3, delay_ms / 1e3, 10.0, 10.0)
        shares = [f"{min_share(round_trip_s, *slot):.2f}" for slot in SLOTS_M]
        rows.append([f"{delay_ms} ms", f"{round_trip_s:.3f}", *shares])
    print(
        markdown(["links each way", "T, s", *(f"slot {x:g} m behind, {y:g} m to the side" for x, y in SLOTS_M)], rows)
    )


if __name__ == "__main__":
    main()
