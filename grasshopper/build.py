"""Builds ``dist/`` from ``src/``: user objects, examples, packages for Rhino's package manager.

One folder and one package per form of script component: ``rhino7`` (Rhino 6 and later), ``rhino8``.

Run ``python grasshopper/build.py``. The same sources give the same files, whenever and wherever it runs.
"""

from __future__ import annotations

import io
import re
import sys
import zipfile
from pathlib import Path

if __package__ in (None, ""):  # started as a script: its own folder is on the path, the repository is not
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from grasshopper import components, icons, network
from grasshopper.archive import deflate

DIST = Path(__file__).resolve().parent / "dist"
#: The earliest time a ZIP can hold; a real one would make every build differ.
LONG_AGO = (1980, 1, 1, 0, 0, 0)
MANIFEST = """---
name: hexwrap
version: {version}
authors:
- the hexwrap authors
description: >-
  Seamless hexagonal, quad and triangle panels on tube-like surfaces by periodic discrete conformal maps.
  Needs the program hexwrap on the same computer.
keywords:
- panelization
- facade
- hexagon
- conformal
- grasshopper
"""


def version() -> str:
    """The project's version, from the solver's source, which is not imported: it needs more than this."""
    source = (DIST.parents[1] / "solver" / "hexwrap_solver" / "__init__.py").read_text(encoding="utf-8")
    (found,) = re.findall(r'^__version__ = "(.+)"$', source, re.MULTILINE)
    return str(found)


def draw_icons() -> dict[Path, bytes]:
    """The icons, by path."""
    return {folder / "icon.png": icons.icon(folder.name) for folder in components.folders()}


def built() -> dict[str, bytes]:
    """Every file of ``dist/``, by its path in there."""
    all_components = [components.load(folder) for folder in components.folders()]
    files = {}
    for form in components.FORMS:
        made = {f"hexwrap-{c.folder}.ghuser": components.user_object(c, form) for c in all_components}
        for wanted in network.EXAMPLES:
            made[f"hexwrap-{wanted.name}.gh"] = deflate(network.example(all_components, form, wanted))
        files |= {f"{form.name}/{name}": data for name, data in made.items()}
        files[f"hexwrap-{version()}-{form.yak}.yak"] = package(made)
    return files


def package(files: dict[str, bytes]) -> bytes:
    """The ``.yak`` file: a ZIP with the manifest on top."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in [("manifest.yml", MANIFEST.format(version=version()).encode()), *files.items()]:
            entry = zipfile.ZipInfo(name, LONG_AGO)
            entry.create_system = 3  # else the builder's own system is written here
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED, 9)
    return buffer.getvalue()


def main() -> None:
    for path, data in draw_icons().items():
        path.write_bytes(data)
    for stale in DIST.rglob("*.*"):
        stale.unlink()
    for name, data in built().items():
        path = DIST / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        print(f"{name}: {len(data)} bytes")


if __name__ == "__main__":
    main()
