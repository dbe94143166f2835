"""The page's own files, by their addresses: nothing else is ever served."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


class Part(NamedTuple):
    """A file of the page."""

    data: bytes
    kind: str


def served_files() -> dict[str, Part]:
    """Return the page's files by their addresses."""
    root, found = files("gcs_formation.view") / "static", dict[str, Part]()
    for folder, prefix in ((root, ""), (root / "vendor", "vendor/")):
        for each in folder.iterdir():
            kind = TYPES.get(Path(each.name).suffix)
            if kind is not None and each.is_file():
                found[prefix + each.name] = Part(each.read_bytes(), kind)
    return found
