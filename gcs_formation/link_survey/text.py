"""A survey's figures in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield what was found of each vehicle's link, and what it means."""
    for name, each in found["vehicles"].items():
        yield from _vehicle(name, each)
    means = found.get("meaning")
    if means is None:
        yield "too few answers to say what that means for a formation"
    else:
        yield _meaning(means)


def _vehicle(name: str, each: Mapping[str, Any]) -> Iterator[str]:
    delay, loss, bursts = each["delay_ms"], each["loss"], each["bursts"]
    yield f"vehicle {name} at {each['endpoint']}: {each['answers']} of {each['requests']} requests answered"
    for direction in ("round_trip", "up", "down"):
        yield f"  delay {direction.replace('_', ' ')}: {_spread(delay[direction])}"
    yield f"  loss: {_share(loss['up'])} up, {_share(loss['down'])} down; in a row down: {_bursts(bursts['down'])}"
    seen, capacity = each["rate_kbps"], each["capacity_kbps"]
    yield (
        f"  seen: {seen['up']['mean']:g} kbit/s up, {seen['down']['mean']:g} down (at most {seen['down']['peak']:g} "
        f"in a second); {_capacity(capacity)}"
    )
    radio = each["radio"]
    if radio is not None:
        yield (
            f"  radio: rssi {radio['rssi']['p50']:g} (least {radio['rssi']['worst']:g}), at the other end "
            f"{radio['remote_rssi']['p50']:g} ({radio['remote_rssi']['worst']:g}), noise {radio['noise']['p50']:g} "
            f"and {radio['remote_noise']['p50']:g}, buffer free {radio['txbuf_percent']['worst']:g} % at least, "
            f"{radio['errors']} errors"
        )
    clock = each["clock"]
    if clock["drift_ppm"] is not None:
        yield (
            f"  clock: {clock['offset_s']:.4f} s ahead of ours, known to {clock['offset_deviation_ms']:.2g} ms; "
            f"drifts by {clock['drift_ppm']:.1f} ppm, known to {clock['drift_deviation_ppm']:.2g}"
        )


def _spread(delays_ms: Mapping[str, Any]) -> str:
    if delays_ms["p50"] is None:
        return "too few answers"
    return ", ".join(f"{name} {delays_ms[name]:.1f}" for name in ("p50", "p95", "p99", "mean", "jitter")) + " ms"


def _share(loss: float | None) -> str:
    return "unknown" if loss is None else f"{loss:.2%}"


def _bursts(found: Mapping[str, float]) -> str:
    return f"{found['mean']:.1f} on average, {found['longest']:.0f} at most" if found["count"] else "none"


def _capacity(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return "how much it carries wasn't probed (--probe-capacity)"
    full = ", full above" if found["full_above"] else " at least, as much as was tried"
    return f"carries {found['each_way']:g} kbit/s each way at once{full}"


def _meaning(means: Mapping[str, Any]) -> str:
    count, rate_hz = means["vehicles"], means["rate_hz"]
    needs = f"{means['needs_up_kbps']:g} kbit/s up and {means['needs_down_kbps']:g} down"
    if means["carries"] is None:
        carries = f"{count} at {rate_hz:g} Hz need {needs}: whether the links carry that wasn't probed"
    elif means["carries"]:
        carries = f"carries {count} at {rate_hz:g} Hz ({needs} of {means['capacity_kbps']:g} kbit/s)"
    else:
        carries = f"doesn't carry {count} even at {rate_hz:g} Hz ({needs} of {means['capacity_kbps']:g} kbit/s)"
    if not means["flies"]:
        return f"{carries}; the rehearsal doesn't fly: {means['reason']}"
    used = means["margin_used"]
    margin = "no delay margin" if used is None else f"{used:.0%} of the delay margin"
    errors = f"foretold {means['rms_m']:.2g} m RMS, {means['max_m']:.2g} m at most"
    return f"{carries}; {errors}; {margin}; spacing from {means['spacing_from_m']:g} m"
