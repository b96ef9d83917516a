"""Files that are there whole or not at all."""

from __future__ import annotations

import contextlib
import logging
import os
import time
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path

from hexwrap_server.errors import StorageError

#: Seconds for which pruning leaves a file alone.
YOUNG = 300.0
#: Seconds between two attempts to put a file in the place of one that is open.
PAUSES = (0.01, 0.05, 0.2, 0.5)
#: Suffix of files that are being written.
PART = ".part"
log = logging.getLogger("hexwrap.disk")


def make_private(folder: Path) -> None:
    """Make a folder that only its owner can look into. One that is there already stays as it is."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)


def write_whole(path: Path, content: Iterable[bytes | memoryview]) -> None:
    """Write a file that other processes see whole or not at all. Raises StorageError."""
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex}{PART}")
    try:
        with part.open("wb") as file:
            file.writelines(content)
        put_in_place(part, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink()
        raise StorageError.of(error) from error


def surface_file(folder: Path, id: str) -> Path:
    return folder / f"{id}.surface"


def keep_file(path: Path, data: bytes) -> None:
    """Write a file, unless it is there as it should be. Raises StorageError."""
    try:
        is_kept = path.read_bytes() == data
        os.utime(path)  # touch() would make an empty one in the place of one that was just pruned
    except OSError:
        is_kept = False
    if not is_kept:
        write_whole(path, [data])


def put_in_place(part: Path, path: Path) -> None:
    """Rename part to path. Windows refuses that for the moment that somebody reads what is there."""
    for pause in PAUSES:
        try:
            os.replace(part, path)
            return
        except PermissionError:
            time.sleep(pause)
    os.replace(part, path)


def read_whole(path: Path, is_whole: Callable[[bytes], bool]) -> bytes | None:
    """What a file holds, None where there is none. Raises StorageError where it cannot be read.

    A damaged one is deleted, so that its work is done again when asked for.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StorageError.of(error) from error
    if is_whole(data):
        return data
    log.warning("a damaged file was deleted: %s", path.name)
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def prune(
    folder: Path, limit_bytes: float, keep: Callable[[str], bool] = lambda name: False, oldest: float = 0.0
) -> None:
    """Delete what was last used before oldest, and the longest unused until the rest fits into limit_bytes.

    keep: names that stay. Files of the last minutes stay too: their owner may be about to name them. What a
    process that was killed had begun to write goes in any case.
    """
    entries = []
    total = 0
    for path in folder.glob("*"):
        with contextlib.suppress(OSError):
            state = path.stat()
            if path.suffix == PART and state.st_mtime <= time.time() - YOUNG:
                path.unlink()
            elif not keep(path.name):
                entries.append((state.st_mtime, state.st_size, path))
                total += state.st_size
    for used, size, path in sorted(entries):
        if (total <= limit_bytes and used >= oldest) or used > time.time() - YOUNG:
            break
        with contextlib.suppress(OSError):  # in use, on Windows
            path.unlink()
            total -= size
