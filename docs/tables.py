"""Writes the tables of the README and of these pages anew from the code: python docs/tables.py"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hexwrap_server import samples
from hexwrap_server.cli.options import explore_table, table
from hexwrap_server.settings import readme_table

ROOT = Path(__file__).resolve().parents[1]
EXPLORE = "| option of `hexwrap explore` | field of its body | what it does |\n|---|---|---|\n"
OPTIONS = "| option of `hexwrap solve` | field of a request | what it does | words |\n|---|---|---|---|\n"
#: File → marker → what stands after it.
TABLES: dict[str, dict[str, Callable[[], str]]] = {
    "README.md": {"samples": lambda: ", ".join(f"`{name}`" for name in samples.names())},
    "docs/concepts/explore.md": {"explore": lambda: f"\n{EXPLORE}{explore_table()}\n"},
    "docs/settings.md": {"options": lambda: f"\n{OPTIONS}{table()}\n"},
    "docs/service.md": {"settings": lambda: f"\n{readme_table()}\n"},
}


def filled(name: str) -> str:
    """The text of a file with its tables as they should be."""
    text = (ROOT / name).read_text(encoding="utf-8")
    for marker, made in TABLES[name].items():
        before, rest = text.split(f"<!-- {marker} -->")
        text = (
            f"{before}<!-- {marker} -->{made()}<!-- end of {marker} -->"
            + rest.split(f"<!-- end of {marker} -->")[1]
        )
    return text


def main() -> None:
    for name in TABLES:
        (ROOT / name).write_text(filled(name), encoding="utf-8")


if __name__ == "__main__":
    main()
