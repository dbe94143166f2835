"""Hooks of `mkdocs.yml`: README and changelog become pages, and what documents link to beside them comes with them."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from markdown.extensions.toc import slugify
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = {"index.md": "README.md", "changelog.md": "CHANGELOG.md"}
SHIM = "iframe-worker.js"
VERSION = "MIKE_DOCS_VERSION"
"""Set by mike, which keeps a copy of the site for each version beside the others."""
FETCHED = "https://unpkg.com/iframe-worker/shim"
"""What the theme would fetch for the search of a site that is opened as files; it is served from the site instead."""
OUTSIDE = re.compile(r"\]\(\.\./([^)#]+)(#[^)]*)?\)")
NUMBERED = re.compile(r"\]\(#([\w-]+)-(\d+)\)")
"""A link to the second of two headings of one name, as GitHub numbers them."""


def on_config(config: Any) -> Any:  # noqa: ANN401 - MkDocs' own
    """Put documents that have no place in the navigation at its end; offer other versions where there are some."""
    placed = set(re.findall(r"[\w-]+\.md", str(config.nav)))
    others = sorted(each.name for each in DOCS.glob("*.md") if each.name not in placed)
    if others:
        config.nav.append({"More": others})
    if VERSION in os.environ:  # a copy that is built by itself has no others to choose from, and looks for none
        config.extra["version"] = {"provider": "mike", "default": "latest"}
    return config


def on_files(files: Files, config: Any) -> Files:  # noqa: ANN401 - MkDocs' own
    """Add the pages of the root, and every file outside the documents' folder that one of them links to."""
    texts = [each.read_text(encoding="utf-8") for each in DOCS.glob("*.md")]
    for name, source in PAGES.items():
        texts.append(_seen_from_docs((ROOT / source).read_text(encoding="utf-8")))
        files.append(File.generated(config, name, content=texts[-1]))
    shim = (ROOT / ".ci" / SHIM).read_bytes()
    files.append(File.generated(config, f"assets/{SHIM}", content=shim))
    linked = {found.group(1) for text in texts for found in OUTSIDE.finditer(text)} - set(PAGES.values())
    for path in sorted(linked):
        source_file = _file(path)
        files.append(File.generated(config, _target(path), content=source_file.read_bytes()))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Turn links out of the documents' folder into links to what was added, and GitHub's anchors into MkDocs'."""
    headings = {slugify(line.lstrip("# "), "-") for line in markdown.splitlines() if line.startswith("#")}

    def numbered(found: re.Match[str]) -> str:
        name, number = found.groups()
        return found.group() if f"{name}-{number}" in headings else f"](#{name}_{number})"

    return NUMBERED.sub(numbered, OUTSIDE.sub(_inside, markdown))


def on_post_page(output: str, **_: Any) -> str:
    """Let a page fetch nothing from outside."""
    return output.replace(FETCHED, f"assets/{SHIM}")


def _seen_from_docs(text: str) -> str:
    """Return the text of a document of the root with its links as seen from the documents' folder."""
    text = re.sub(r"\]\((?!docs/|https?:|#)([^)]+)\)", r"](../\1)", text)
    return re.sub(r'(\]\(|src="|srcset=")docs/', r"\1", text)


def _file(path: str) -> Path:
    found = ROOT / path
    return found / "README.md" if found.is_dir() else found


def _target(path: str) -> str:
    """Return where a file is in the site; Markdown is a text to read there, not a page."""
    name = _file(path).relative_to(ROOT).as_posix()
    return f"{name}.txt" if name.endswith(".md") else name


def _inside(found: re.Match[str]) -> str:
    path, anchor = found.group(1), found.group(2) or ""
    page = next((page for page, source in PAGES.items() if path == source), None)
    return f"]({page}{anchor})" if page is not None else f"]({_target(path)})"
