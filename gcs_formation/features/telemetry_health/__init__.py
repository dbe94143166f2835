"""Telemetry that can't be true: found by what its quantities say of one another, named, and flown around.

`consistency` is the arithmetic of one vehicle, `monitor` looks after all, `before_take_off` examines those that stand.
"""
