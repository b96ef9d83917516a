"""What survives the server: jobs and works in SQLite, surfaces, results and solutions as files beside it.

A *work* is what has to be computed, known by the SHA-256 of all it depends on; a *job* is one client's wish
for it. Each transition is written here before it is announced. The write-ahead log keeps what was written
when the process is killed at any moment.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import re
import sqlite3
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from isal import igzip
from isal.igzip_lib import IsalError

from hexwrap_server.errors import CodecError, DamagedError, FolderInUseError, StorageError
from hexwrap_server.input.requests import Exploration, Outcome, Wanted
from hexwrap_server.jobs import codec
from hexwrap_server.jobs.disk import make_private, prune, read_whole, surface_file, write_whole

Status = Literal["queued", "running", "done", "failed", "cancelled"]
Kind = Literal["solve", "explore"]
log = logging.getLogger("hexwrap.store")
#: Bytes of the write-ahead log at which it is brought into the database beside the work, and those at which
#: whoever writes has to do it, and every answer waits for the disk.
CHECKPOINT, LATEST_CHECKPOINT = 2**22, 2**26
#: Milliseconds that a write waits, and the event loop with it, while another program holds the database.
PATIENCE = 100
#: Bytes of a page of the database.
PAGE = 4096
HEX_ID = re.compile(r"[0-9a-f]{64}")

_SCHEMA = """
CREATE TABLE IF NOT EXISTS works (
    identity TEXT PRIMARY KEY, surface TEXT NOT NULL, wanted BLOB NOT NULL,
    attempts INTEGER NOT NULL DEFAULT 0, size INTEGER NOT NULL DEFAULT 0,
    timings TEXT NOT NULL DEFAULT '{}', used REAL NOT NULL
);
CREATE TABLE IF NOT EXISTS jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT UNIQUE NOT NULL, identity TEXT NOT NULL,
    name TEXT NOT NULL, status TEXT NOT NULL, stage TEXT NOT NULL,
    progress REAL NOT NULL, created REAL NOT NULL, started REAL,
    finished REAL, timings TEXT NOT NULL, found TEXT NOT NULL, problem TEXT,
    kind TEXT NOT NULL DEFAULT 'solve'
);
CREATE INDEX IF NOT EXISTS jobs_by_work ON jobs (identity);
CREATE INDEX IF NOT EXISTS jobs_by_status ON jobs (status);
"""
#: Of versions before there were explorations.
_ADD_KIND = "ALTER TABLE jobs ADD COLUMN kind TEXT NOT NULL DEFAULT 'solve'"


@dataclass(frozen=True)
class Job:
    """One client's wish. timings: seconds per stage; found: where each came from. Times are Unix times."""

    id: str
    identity: str
    name: str
    status: Status = "queued"
    stage: str = ""
    progress: float = 0.0
    created: float = 0.0
    started: float | None = None
    finished: float | None = None
    timings: dict[str, float] = field(default_factory=dict)
    found: dict[str, str] = field(default_factory=dict)
    problem: dict[str, Any] | None = None
    kind: Kind = "solve"

    @property
    def is_over(self) -> bool:
        return self.status in ("done", "failed", "cancelled")

    def document(self, position: int | None = None) -> dict[str, Any]:
        """The contract's Job. position: jobs that run before it."""
        content = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "identity"}
        for name in ("created", "started", "finished"):
            content[name] = content[name] and _iso(content[name])
        return content | {"queue_position": position}


#: The columns of a job, those that are JSON, and those that change.
_COLUMNS = tuple(f.name for f in fields(Job))
_AS_JSON = ("timings", "found", "problem")
_CHANGING = ("status", "stage", "progress", "started", "finished", *_AS_JSON)


@dataclass(frozen=True)
class Work:
    """size: bytes of its result; 0 until it is finished."""

    identity: str
    surface: str
    wanted: Wanted | Exploration
    attempts: int = 0
    size: int = 0
    timings: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Kept:
    """What pruning leaves: works and surfaces, and the Unix time before which nothing is kept."""

    works: set[str]
    surfaces: set[str]
    oldest: float


class Store:
    """All methods are short; those that read or write whole files say so.

    All raise StorageError where the disk does not take or give it.
    """

    def __init__(self, folder: Path) -> None:
        """Raises FolderInUseError, DamagedError, OSError."""
        self.folder = folder
        self.surfaces = folder / "surfaces"
        self.results = folder / "results"
        self.stages = folder / "stages"
        make_private(folder)
        for path in (self.surfaces, self.results, self.stages):
            path.mkdir(exist_ok=True)
        self._lock = _locked(folder / "lock.sqlite3")
        self._path = path = folder / "hexwrap.sqlite3"
        self._log = folder / "hexwrap.sqlite3-wal"
        self._checked = 0.0
        self._ended: dict[str, Job] = {}  # jobs that are over but not yet written as such
        try:
            self._db = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = NORMAL")
            self._db.execute(f"PRAGMA wal_autocheckpoint = {LATEST_CHECKPOINT // PAGE}")
            self._db.executescript(_SCHEMA)
            if "kind" not in [row[1] for row in self._db.execute("PRAGMA table_info(jobs)")]:
                self._db.execute(_ADD_KIND)
            self._db.execute(f"PRAGMA busy_timeout = {PATIENCE}")
        except sqlite3.DatabaseError as error:
            self._lock.close()
            raise _unusable(path, error) from None

    def close(self) -> None:
        self._db.close()
        self._lock.close()

    def check_point(self) -> None:
        """Bring a long write-ahead log into the database. Waits for the disk; for a thread of its own."""
        state = self._log.stat()
        if state.st_size < CHECKPOINT or state.st_mtime == self._checked:
            return
        self._checked = state.st_mtime
        try:
            with contextlib.closing(sqlite3.connect(self._path, isolation_level=None)) as db:
                db.execute("PRAGMA wal_checkpoint(PASSIVE)")  # nobody waits for it
        except sqlite3.DatabaseError as error:
            raise StorageError.of(error) from error

    # surfaces (files)

    def has_surface(self, id: str) -> bool:
        return HEX_ID.fullmatch(id) is not None and self.surface_path(id).exists()

    def use_surface(self, id: str) -> bool:
        """Whether it is there; if so, no pruning that has begun takes it away."""
        if not self.has_surface(id):
            return False
        try:
            os.utime(self.surface_path(id))
        except FileNotFoundError:
            return False
        except OSError as error:  # it can be read all the same
            log.warning("the use of a surface cannot be noted: %s", error)
        return True

    def surface(self, id: str) -> bytes | None:
        """Reads a file; None where it is gone or damaged, and then it is forgotten."""
        return read_whole(self.surface_path(id), codec.is_whole)

    def surface_path(self, id: str) -> Path:
        return surface_file(self.surfaces, id)

    # works

    def work(self, identity: str) -> Work | None:
        rows = self._rows(
            "SELECT identity, surface, wanted, attempts, size, timings FROM works WHERE identity = ?",
            identity,
        )
        if not rows:
            return None
        identity, surface, wanted, attempts, size, timings = rows[0]
        try:
            asked = codec.decode(wanted)
        except CodecError as error:
            log.warning("a work of another version cannot be read: %s", error)
            return None
        return Work(identity, surface, asked, attempts, size, json.loads(timings))

    def finished_work(self, identity: str) -> Work | None:
        """The work, if its result is there."""
        work = self.work(identity)
        if work is None or not work.size or not self.has_outcome(identity):
            return None
        with contextlib.suppress(StorageError):  # it can be read all the same
            self._write("UPDATE works SET used = ? WHERE identity = ?", time.time(), identity)
        return work

    def keep_outcome(self, identity: str, outcome: Outcome) -> bytes:
        """Write the files of a result, if the worker did not; ``done`` comes after. The packed result.

        Raises StorageError.
        """
        if outcome.solution is not None:
            write_whole(self.solution_path(identity), [outcome.solution])
        if outcome.result is not None:
            write_whole(self.result_path(identity), [outcome.result])
            return outcome.result
        try:
            return self.result_path(identity).read_bytes()
        except OSError as error:
            raise StorageError.of(error) from error

    def result(self, identity: str) -> bytes | None:
        """Reads a packed result; None where it is gone or damaged, and then it is forgotten."""
        return read_whole(self.result_path(identity), _is_packed)

    def has_outcome(self, identity: str) -> bool:
        return self.result_path(identity).exists() and self.solution_path(identity).exists()

    def result_path(self, identity: str) -> Path:
        return self.results / f"{identity}.json.gz"

    def solution_path(self, identity: str) -> Path:
        return self.results / f"{identity}.solution"

    # jobs and their transitions

    def add(self, job: Job, work: Work) -> None:
        with self._transaction():
            self._put(work)
            marks = ", ".join("?" * len(_COLUMNS))
            self._db.execute(f"INSERT INTO jobs ({', '.join(_COLUMNS)}) VALUES ({marks})", _row(job))

    def add_work(self, work: Work) -> None:
        """A work that another one wants, and no job."""
        with self._transaction():
            self._put(work)

    def _put(self, work: Work) -> None:
        self._db.execute(
            "INSERT INTO works (identity, surface, wanted, used) VALUES (?, ?, ?, ?) "
            "ON CONFLICT (identity) DO UPDATE SET used = excluded.used",
            (work.identity, work.surface, codec.encode(work.wanted), time.time()),
        )

    def start_work(self, identity: str) -> None:
        self._write("UPDATE works SET attempts = attempts + 1, size = 0 WHERE identity = ?", identity)

    def take_back(self, identity: str) -> None:
        """The server stops before the work is done, through no fault of the work."""
        self._write("UPDATE works SET attempts = MAX(attempts - 1, 0) WHERE identity = ?", identity)

    def settle(self, identity: str) -> None:
        """The work ended without a result; whoever asks for it again starts from the first attempt."""
        self._write("UPDATE works SET attempts = 0 WHERE identity = ?", identity)

    def finish_work(self, identity: str, outcome: Outcome) -> None:
        self._write(
            "UPDATE works SET attempts = 0, size = ?, timings = ?, used = ? WHERE identity = ?",
            outcome.size,
            json.dumps(outcome.timings),
            time.time(),
            identity,
        )

    def update(self, jobs: Iterable[Job]) -> None:
        """Write the present state of jobs."""
        with self._transaction():
            changes = ", ".join(f"{name} = ?" for name in _CHANGING)
            rows = [(*_row(job, _CHANGING), job.id) for job in jobs]
            self._db.executemany(f"UPDATE jobs SET {changes} WHERE id = ?", rows)

    def end(self, jobs: Iterable[Job]) -> None:
        """Write the end of jobs, or keep it here until it can be written: a full disk must not keep a job
        from ending. If the server dies before, the job is taken up again as if it had still been running."""
        self._ended |= {job.id: job for job in jobs}
        self.catch_up()

    def catch_up(self) -> None:
        """Write the ends that are kept, if they can be written by now."""
        if not self._ended:
            return
        try:
            self.update(self._ended.values())
        except StorageError as error:
            log.error("%d ended jobs cannot be written yet: %s", len(self._ended), error)
        else:
            self._ended.clear()

    def job(self, id: str) -> Job | None:
        return self._ended.get(id) or next(iter(self._jobs("WHERE id = ?", id)), None)

    def jobs(self, limit: int, before: str | None = None) -> list[Job]:
        """Newest first. before: only those older than this one."""
        older = "" if before is None else "WHERE number < (SELECT number FROM jobs WHERE id = ?)"
        values = [limit] if before is None else [before, limit]
        listed = self._jobs(f"{older} ORDER BY number DESC LIMIT ?", *values)
        return [self._ended.get(job.id, job) for job in listed]

    def unfinished(self) -> list[Job]:
        """Oldest first."""
        jobs = self._jobs("WHERE status IN ('queued', 'running') ORDER BY number")
        return [replace(job, status="queued", stage="", progress=0.0, started=None) for job in jobs]

    def forget(self, id: str) -> None:
        self._write("DELETE FROM jobs WHERE id = ?", id)
        self._ended.pop(id, None)

    def prune_rows(self, days: float, result_bytes: float, surfaces: Mapping[str, os.stat_result]) -> Kept:
        """Forget jobs, works and surfaces that are too old or too much, the longest unused first.

        surfaces: what ``surface_files`` found. Each counts once, with the last work that used it.
        """
        oldest = time.time() - days * 86400
        over = "status IN ('done', 'failed', 'cancelled')"
        busy = "SELECT identity FROM jobs WHERE status IN ('queued', 'running')"
        with self._transaction():
            self._db.execute(f"DELETE FROM jobs WHERE {over} AND finished < ?", (oldest,))
            works = self._rows(
                f"SELECT used, identity, surface, size FROM works WHERE identity NOT IN ({busy})"
            )
            loose = [(state.st_mtime, "", id, 0) for id, state in surfaces.items()]
            gone, kept = _divided(sorted([*works, *loose], reverse=True), oldest, result_bytes, surfaces)
            self._db.executemany(f"DELETE FROM jobs WHERE identity = ? AND {over}", gone)
            self._db.executemany("DELETE FROM works WHERE identity = ?", gone)
        left = self._rows("SELECT identity, surface FROM works")
        return Kept({identity for identity, _ in left}, kept | {surface for _, surface in left}, oldest)

    def surface_files(self) -> dict[str, os.stat_result]:
        """The kept surfaces by id. Looks at many files. Raises StorageError."""
        found = {}
        try:
            for path in self.surfaces.glob("*.surface"):
                with contextlib.suppress(FileNotFoundError):  # deleted meanwhile
                    found[path.stem] = path.stat()
            return found
        except OSError as error:
            raise StorageError.of(error) from error

    def prune_files(self, kept: Kept, stage_bytes: float) -> None:
        """Delete files that are no longer needed. Touches many files."""
        prune(self.results, 0.0, keep=lambda name: name.partition(".")[0] in kept.works)
        prune(self.surfaces, 0.0, keep=lambda name: name.partition(".")[0] in kept.surfaces)
        prune(self.stages, stage_bytes, oldest=kept.oldest)

    def _jobs(self, clause: str, *values: Any) -> list[Job]:
        return [_job(row) for row in self._rows(f"SELECT {', '.join(_COLUMNS)} FROM jobs {clause}", *values)]

    def _rows(self, statement: str, *values: Any) -> list[Any]:
        try:
            return self._db.execute(statement, values).fetchall()
        except sqlite3.DatabaseError as error:
            raise StorageError.of(error) from error

    def _write(self, statement: str, *values: Any) -> None:
        with self._transaction():
            self._db.execute(statement, values)

    @contextlib.contextmanager
    def _transaction(self) -> Any:
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield
            self._db.execute("COMMIT")
        except sqlite3.DatabaseError as error:
            self._roll_back()
            raise StorageError.of(error) from error
        except BaseException:
            self._roll_back()
            raise

    def _roll_back(self) -> None:
        if self._db.in_transaction:  # on a full disk SQLite may have done so already
            with contextlib.suppress(sqlite3.DatabaseError):
                self._db.execute("ROLLBACK")


def _divided(
    listed: list[tuple[float, str, str, int]],
    oldest: float,
    limit_bytes: float,
    surfaces: Mapping[str, os.stat_result],
) -> tuple[list[tuple[str]], set[str]]:
    """Works to forget, and surfaces to keep.

    listed: last use, work (or none), its surface, size of its result; the last used first.
    """
    gone: list[tuple[str]] = []
    kept: set[str] = set()
    total = 0
    counted: set[str] = set()
    for used, identity, surface, size in listed:
        total += size
        if surface in surfaces and surface not in counted:
            counted.add(surface)
            total += surfaces[surface].st_size
        if total <= limit_bytes and used >= oldest:
            kept.add(surface)
        elif identity:
            gone.append((identity,))
    return gone, kept


def _is_packed(data: bytes) -> bool:
    """Whether gzip data is complete and its checksum right."""
    try:
        return bool(igzip.decompress(data))  # type: ignore[no-untyped-call]
    except (OSError, EOFError, IsalError):  # type: ignore[misc]
        return False


def _locked(path: Path) -> sqlite3.Connection:
    """A lock that every system frees when the process ends, even by a crash."""
    try:
        lock = sqlite3.connect(path, timeout=0, check_same_thread=False, isolation_level=None)
    except sqlite3.DatabaseError as error:
        raise _unusable(path, error) from None
    try:
        lock.execute("PRAGMA locking_mode = EXCLUSIVE")
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.DatabaseError as error:
        lock.close()
        if error.sqlite_errorcode != sqlite3.SQLITE_BUSY:
            raise _unusable(path, error) from None
        raise FolderInUseError(
            f"Another hexwrap server works in {path.parent}; give this one its own --data."
        ) from None
    return lock


def _unusable(path: Path, error: sqlite3.DatabaseError) -> DamagedError:
    return DamagedError(
        f"{path} cannot be used ({error}). If the folder can be written, the file is damaged: move it "
        "away to start with an empty list of jobs, or give another --data."
    )


def _row(job: Job, columns: Sequence[str] = _COLUMNS) -> list[Any]:
    values = ((name, getattr(job, name)) for name in columns)
    return [json.dumps(value) if name in _AS_JSON and value is not None else value for name, value in values]


def _job(row: tuple[Any, ...]) -> Job:
    values = dict(zip(_COLUMNS, row, strict=True))
    return Job(**values | {name: values[name] and json.loads(values[name]) for name in _AS_JSON})


def _iso(moment: float) -> str:
    return datetime.fromtimestamp(moment, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
