"""Writes the reference of the pytest fixture `formation` from its docstrings: `python -m tests.testing_reference`.

The output is docs/testing.md; a test compares them.
"""

import inspect
import re
import sys
from collections.abc import Iterator
from typing import Any

from gcs_formation.testing.flight_plan import Formation, Plan
from gcs_formation.testing.flown_flight import FlownFlight

HEAD = """# Flights as test cases

The pytest fixture `formation` flies scenarios inside a test, on the virtual clock unless a plan says otherwise. The one
thing to know: **`formation(…)` is a plan, `.fly()` flies it, and checks on the flown flight raise AssertionError with
the figure, the seed, the record and the command that flies it again.** pytest finds the fixture by itself where this
package is installed; whole tests are in `examples/`. This page is written from the docstrings by
`python -m tests.testing_reference`.

```python
def test_a_late_link(formation):
    flight = formation("scenario.yaml").with_link(vehicle=3, delay_ms=300, loss=0.02).fly(until=60)
    flight.stays_within(1.0, axes="xy", from_s=30)
```
"""
PARTS = (("`formation`: makes a plan", Formation), ("A plan", Plan), ("A flown flight", FlownFlight))


def reference() -> str:
    """Return the page."""
    return "\n".join([HEAD, *(line for title, kind in PARTS for line in _part(title, kind))])


def _part(title: str, kind: type) -> Iterator[str]:
    yield f"## {title}\n\n{inspect.getdoc(kind)}\n"
    for name, member in vars(kind).items():
        if (name.startswith("_") and name != "__call__") or name.startswith("__data"):
            continue
        made: Any = member.fget if isinstance(member, property) else member
        if not inspect.isfunction(made) or made.__doc__ is None:
            continue
        shown = "formation" if name == "__call__" else f".{name}"
        if not isinstance(member, property):
            shown += _arguments(made)
        text = inspect.getdoc(made) or ""
        yield f"### `{shown}`\n"
        for at, block in enumerate(text.split("\n\n")):
            head, _, rest = block.partition("\n")
            yield f"{block}\n" if at == 0 or not head.endswith(":") else f"{head}\n\n```text\n{rest}\n```\n"


def _arguments(made: Any) -> str:
    signature = inspect.signature(made)
    own = [each for name, each in signature.parameters.items() if name != "self"]
    text = str(signature.replace(parameters=own, return_annotation=inspect.Signature.empty))
    return re.sub(r": '([^']*)'", r": \1", text)


if __name__ == "__main__":
    sys.stdout.write(reference())
