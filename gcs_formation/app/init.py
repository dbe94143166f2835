"""`gcs-formation init`: writes a copy of an example scenario."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from gcs_formation.errors import ExampleError

SUFFIX = ".yaml"
IN_THE_TREE = "configs"
"""Directory of the examples in the sources; an installed package contains them."""


def example_names() -> list[str]:
    """Return the names of the examples that come with the package."""
    return sorted(path.name.removesuffix(SUFFIX) for path in _directory().iterdir() if path.name.endswith(SUFFIX))


def write_example(name: str, directory: Path) -> Path:
    """Write an example into a directory, which is created if necessary; return the file.

    Raises:
        ExampleError: the file exists already, or can't be written.
    """
    path = directory / f"{name}{SUFFIX}"
    text = (_directory() / path.name).read_text(encoding="utf-8").replace(f"{IN_THE_TREE}/", "")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        if path.exists():
            found = f"found {path}; allowed: a file that isn't there yet, as init overwrites nothing"
            raise ExampleError(found) from error
        raise ExampleError(f"cannot write {path}: {error.strerror}; allowed: a writable directory") from error
    return path


def _directory() -> Path:
    package = Path(str(files("gcs_formation")))
    packaged = package / "examples"
    return packaged if packaged.is_dir() else package.parent / IN_THE_TREE
