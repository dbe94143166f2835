"""`airlink-proxy --fault`: a fault of telemetry, with the keys of a scenario's `faults`."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import Final

from airlink.telemetry_faults.passing import KEYS, FaultError, LinkFault, fault_of

_COMMA: Final = re.compile(r",(?![^\[]*\])")
NONE: Final = "none"


def parse_fault(text: str) -> LinkFault:
    """Return the fault that a text such as `quantity=position,effect=offset,amount=[0,20,0],vehicles=[3]` describes.

    Raises:
        FaultError: it isn't of that form, or a key or value isn't allowed.
    """
    keys = dict[str, object]()
    for part in _COMMA.split(text):
        name, equals, value = part.strip().partition("=")
        if not equals:
            raise FaultError(f"found '{part}'; allowed: KEY=VALUE,..., KEY one of {KEYS}")
        keys[name.strip()] = _value(value.strip())
    return fault_of(keys)


def changed(faults: tuple[LinkFault, ...], text: str, elapsed_s: float) -> tuple[LinkFault, ...]:
    """Return the faults after a line of standard input: `none`, or one more, which begins `at_s` from now.

    Raises:
        FaultError: as `parse_fault` does.
    """
    if text == NONE:
        return ()
    fault = parse_fault(text)
    return (*faults, replace(fault, at_s=fault.at_s + elapsed_s))


def described(fault: LinkFault) -> str:
    """Return a fault's keys on one line."""
    parts = [f"quantity={fault.quantity}", f"effect={fault.effect}"]
    if fault.amount is not None:
        parts.append(f"amount={[*fault.amount] if isinstance(fault.amount, tuple) else fault.amount}")
    parts.append(f"vehicles={sorted(fault.vehicles) or 'all'}")
    ends = [] if math.isinf(fault.for_s) else [f"for_s={fault.for_s:g}"]
    return f"fault: {','.join([*parts, f'at_s={fault.at_s:g}', *ends])}".replace(" ", "").replace(":", ": ", 1)


def _value(text: str) -> object:
    try:
        return json.loads(text)
    except ValueError:
        return text
