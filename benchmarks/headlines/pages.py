"""Figures that documents state, where the command writes and compares them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
MARKED = re.compile(r"(<!-- figure: (?P<name>[\w.-]+) -->)(?P<stated>[^<]*)(<!-- /figure -->)")


def documents() -> list[Path]:
    """Return the documents that may state figures."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def stated(document: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each figure that a document states."""
    for each in MARKED.finditer(document.read_text(encoding="utf-8")):
        yield each["name"], each["stated"]


def write(document: Path, texts: Mapping[str, str]) -> bool:
    """Put figures into a document, by their names; return whether that changed it."""
    before = document.read_text(encoding="utf-8")
    after = MARKED.sub(lambda each: f"{each[1]}{texts.get(each['name'], each['stated'])}{each[4]}", before)
    if after != before:
        document.write_text(after, encoding="utf-8")
    return after != before
