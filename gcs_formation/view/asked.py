"""What requests hold, read with bounds: numbers of a query, and a small object of JSON."""

from __future__ import annotations

import json
import math
from typing import Any

from starlette.requests import Request

MAX_BODY = 2000


def number(text: str) -> float | None:
    """Return a finite number that a query holds; None if it holds something else."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


async def small_object(request: Request) -> dict[str, Any] | None:
    """Return a small JSON object that a request carries; None if it carries something else."""
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        return None
    data = b""
    async for chunk in request.stream():
        data += chunk
        if len(data) > MAX_BODY:
            return None
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
