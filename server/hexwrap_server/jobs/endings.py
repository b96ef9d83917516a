"""The ends of jobs: written, then announced.

A full disk must not keep a job from ending. An end that cannot be written is kept here until it can; if the
server dies before, the job is taken up again as if it had still been running.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable

from hexwrap_server.errors import StorageError
from hexwrap_server.jobs.store import Job, Store

log = logging.getLogger("hexwrap.ledger")


class Ledger:
    """Jobs that are over but not yet written as such, by id."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._kept: dict[str, Job] = {}

    def __contains__(self, id: str) -> bool:
        return id in self._kept

    def get(self, id: str) -> Job | None:
        return self._kept.get(id)

    def end(self, jobs: Iterable[Job]) -> None:
        """Write the end of jobs, now or later."""
        self._kept |= {job.id: job for job in jobs}
        self.catch_up()

    def forget(self, id: str) -> None:
        """Raises StorageError."""
        self._store.forget(id)
        self._kept.pop(id, None)

    def catch_up(self) -> None:
        """Write what is kept, if it can be written by now."""
        if not self._kept:
            return
        try:
            self._store.update(self._kept.values())
        except StorageError as error:
            log.error("%d ended jobs cannot be written yet: %s", len(self._kept), error)
        else:
            self._kept.clear()
