"""The law's two sets of gains, for exact telemetry and for telemetry as noisy as GNSS; `auto` is `auto_gains`'."""

from __future__ import annotations

from formation_scenario.source import Key, Plain

Group = dict[Key, Plain]
"""A mapping of keys."""

AUTO, CLEAN, NOISE = "auto", "clean", "noise"
LEADER, FOLLOWER = "leader_heading", "follower_heading"

GROUPS: dict[str, dict[str, Group]] = {
    CLEAN: {
        "mixer": {"k_v": 0.1, "k_x": 1.0, "k_psi": 0.1, "k_y": 0.05, "k_z": 1.0},
        "speed": {"kp": 3.0, "ki": 0.8, "kd": 6.5, "error_scale": 1.0, "rate_scale": 1.0},
        "height": {"kp": 2.0, "ki": 0.4, "kd": 4.0, "error_scale": 2.0, "rate_scale": 2.0},
    },
    NOISE: {
        "mixer": {"k_v": 0.5, "k_x": 0.5, "k_psi": 0.1, "k_y": 0.05, "k_z": 1.0},
        "speed": {"kp": 1.0, "ki": 0.1, "kd": 1.0, "error_scale": 1.0, "rate_scale": 1.0},
        "height": {"kp": 1.0, "ki": 0.1, "kd": 1.0, "error_scale": 2.0, "rate_scale": 2.0},
    },
}
HEADING: dict[str, dict[str, Group]] = {
    CLEAN: {
        LEADER: {"kp": 1.2, "ki": 0.5, "kd": 1.8, "error_scale": 0.1, "rate_scale": 0.1},
        FOLLOWER: {"kp": 1.0, "ki": 0.6, "kd": 0.1, "error_scale": 0.1, "rate_scale": 0.1},
    },
    NOISE: {
        LEADER: {"kp": 0.5, "ki": 0.1, "kd": 0.05, "error_scale": 0.1, "rate_scale": 0.1},
        FOLLOWER: {"kp": 0.5, "ki": 0.1, "kd": 0.05, "error_scale": 0.1, "rate_scale": 0.1},
    },
}
FILTERS: dict[str, Group] = {
    CLEAN: {"derivative_filter_s": 0.1, "disturbance_observer_radps": 2.0},
    NOISE: {"derivative_filter_s": 1.0, "disturbance_observer_radps": 0.3},
}


def gain_groups(gains: str, frame: str) -> dict[str, Group]:
    """Return the groups of keys that a set of gains fills, for a slot frame; those of `clean` for an unknown set."""
    known = gains if gains in GROUPS else CLEAN
    heading = HEADING[known].get(frame, HEADING[known][LEADER])
    return GROUPS[known] | {"heading": heading}


def filters(gains: str) -> Group:
    """Return the single keys that a set of gains fills."""
    return FILTERS.get(gains, FILTERS[CLEAN])
