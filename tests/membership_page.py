"""The page of docs about membership in the formation: `python -m tests.membership_page` writes it again."""

from __future__ import annotations

from pathlib import Path

from gcs_formation.fleet.membership_table import TRANSITIONS
from gcs_formation.vehicle.member import Member

PAGE = Path(__file__).parents[1] / "docs" / "membership.md"
HEAD = """# Membership in the formation

What a vehicle is in the formation, and what changes that: the table of `gcs_formation/fleet/membership_table.py`, from
which `python -m tests.membership_page` writes this page. It is read from the top at every tick; the first row that
holds decides. `gcs_formation/fleet/membership.py` says what is known of a vehicle, and sends the commands of a new
membership; events of kind `member` tell it.

"""
DIAGRAM = """
## Diagram

The numbers are those of the rows.

"""


def page() -> str:
    """Return the page."""
    rows = ["| row | of a vehicle that is | when | it is then |", "| --- | --- | --- | --- |"]
    arrows = dict[tuple[Member, Member], list[str]]()
    for number, row in enumerate(TRANSITIONS, 1):
        of = "anything" if set(row.of) == set(Member) else ", ".join(f"`{each.name}`" for each in row.of)
        rows.append(f"| {number} | {of} | {row.when} | `{row.to.name}` |")
        for each in row.of:
            if each is not row.to and row.to is not Member.STARTING:
                arrows.setdefault((each, row.to), []).append(str(number))
    states = ["| name | in events |", "| --- | --- |", *(f"| `{each.name}` | {each.value} |" for each in Member)]
    lines = ["```mermaid", "stateDiagram-v2", "  [*] --> STARTING: 1"]
    lines += [f"  {one.name} --> {other.name}: {', '.join(by)}" for (one, other), by in arrows.items()]
    text = "\n".join([*states, "", "## Table", "", *rows]) + "\n"
    return HEAD + text + DIAGRAM + "\n".join([*lines, "```"]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
