"""Everything that the service refuses or fails at, besides what the solver refuses.

HexwrapError                    (hexwrap_solver.errors) one sentence for the client; 422
├── FormError                   the body does not have the form it should
│   ├── NotJsonError            400
│   ├── UploadError             the form around an uploaded file is broken
│   └── TooManyVerticesError
├── SurfaceError                (hexwrap_solver.errors)
│   ├── FileTypeError           ┐
│   ├── UnreadableFileError     ├ a file, as opposed to the surface in it
│   ├── SeveralObjectsError     │
│   └── NoObjectError           ┘
├── DrawingError                points and curves for ``lift`` that cannot be read or followed
├── NotMadeError                a file shows something that was not asked for
├── SheetError                  a panel is larger than the sheet it should be cut from
├── HttpError                   about the request as such: no such job, host not allowed, queue full …
│   ├── HopsError               the call does not fit the Hops component
│   └── JobFailedError          the problem of a job, repeated
├── GoneError                   410: the result was pruned
└── WorkError                   no result, and not because of what was asked
    ├── TimeLimitError          ┐
    ├── MemoryLimitError        ├ 422
    ├── AttemptsError           ┘
    ├── WorkerDiedError         ┐
    ├── ClusterError            │
    ├── ShuttingDownError       ├ 503
    ├── StorageError            │
    │   └── BusyError           ┘
    └── InternalError           500: a bug
StartError                      the server cannot start; one sentence for whoever started it
├── PortTakenError
├── FolderInUseError
└── DamagedError
UsageError                      what was typed on the command line makes no sense
CodecError                      stored bytes that are damaged or of another version
"""

from __future__ import annotations

import errno
import sqlite3
from collections.abc import Sequence
from typing import Any, ClassVar

from hexwrap_solver.errors import HexwrapError, SurfaceError

#: More faults than these are not listed, the first ones tell enough.
MOST_LISTED = 100


class FormError(HexwrapError):
    """The body is not what the route takes. faults: (JSON pointer, what is wrong there)."""

    slug: ClassVar[str] = "invalid-request"
    title: ClassVar[str] = "The request does not have the right form"

    def __init__(self, faults: Sequence[tuple[str, str]] | str) -> None:
        """faults: a sentence where no place can be named."""
        if isinstance(faults, str):
            super().__init__(faults)
            self.faults: list[tuple[str, str]] = []
            return
        pointer, detail = faults[0]
        more = f" ({len(faults) - 1} more faults are listed in 'errors'.)" if len(faults) > 1 else ""
        end = "" if detail.endswith("?") else "."
        super().__init__(f"{pointer or 'The body'}: {detail.rstrip('.')}{end}{more}")
        self.faults = list(faults[:MOST_LISTED])

    @classmethod
    def at(cls, pointer: str, detail: str, kind: type[HexwrapError] | None = None) -> FormError:
        """One fault. kind: the solver's error for the same fault; a client need not tell the two apart.

        A fault in the arrays of the mesh names its vertex or face by index too.
        """
        error = cls([(pointer, detail)])
        steps = pointer.removeprefix("/surface").split("/")
        if len(steps) > 2 and steps[1] in ("vertices", "faces") and steps[2].isdecimal():
            setattr(error, steps[1], [int(steps[2])])
        if kind is not None:
            error.__dict__.update(slug=kind.slug, title=kind.title)
        return error


class NotJsonError(FormError, slug="not-json", title="The body is not JSON", status=400): ...


class UploadError(FormError, slug="upload", title="The upload cannot be read"): ...


class TooManyVerticesError(
    FormError, slug="too-many-vertices", title="The surface has too many vertices"
): ...


class FileTypeError(SurfaceError, slug="file-type", title="The file type is not known"): ...


class UnreadableFileError(SurfaceError, slug="unreadable-file", title="The file cannot be read"): ...


class SeveralObjectsError(
    SurfaceError, slug="several-objects", title="The file holds more than one surface"
): ...


class NoObjectError(SurfaceError, slug="no-such-object", title="The file does not hold the object"): ...


class DrawingError(HexwrapError, slug="drawing", title="The drawing cannot be read"): ...


class NotMadeError(HexwrapError, slug="not-made", title="The file needs a stage that was left out"): ...


class SheetError(HexwrapError, slug="sheet", title="The panels do not fit on the sheets"): ...


class HttpError(HexwrapError):
    """A refusal by the service itself."""

    def __init__(
        self,
        status: int,
        slug: str,
        title: str,
        detail: str,
        headers: dict[str, str] | None = None,
        errors: Sequence[dict[str, Any]] = (),
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.__dict__.update(slug=slug, title=title)
        self.headers = headers or {}
        self.errors = list(errors)


#: Slug of a refusal → its status and title.
REFUSALS = {
    "not-gzip": (400, "The body is not gzip"),
    "incomplete": (400, "The body is incomplete"),
    "token": (401, "A token is needed"),
    "cross-site": (403, "Requests from other sites are refused"),
    "cancelled": (409, "The job was cancelled"),
    "not-finished": (409, "The job is not finished"),
    "exploration": (409, "The job is an exploration"),
    "body-too-large": (413, "The body is too large"),
    "content-encoding": (415, "The content encoding is not supported"),
    "host-not-allowed": (421, "This host name is not served here"),
    "not-ready": (503, "Not ready"),
    "queue-full": (503, "The queue is full"),
    "shutting-down": (503, "The server is shutting down"),
    "too-many-bodies": (503, "Too many large bodies at once"),
}


def refusal(slug: str, detail: str, headers: dict[str, str] | None = None) -> HttpError:
    """One of those."""
    status, title = REFUSALS[slug]
    return HttpError(status, slug, title, detail, headers)


def not_found(what: str, detail: str) -> HttpError:
    return HttpError(404, "not-found", f"No such {what}", detail)


def bad_parameters(detail: str, listed: Sequence[tuple[str, str]]) -> HttpError:
    """Faults in the path or the query. listed: parameters, and what is wrong with each."""
    errors = [{"pointer": "", "parameter": name, "detail": fault} for name, fault in listed]
    return HttpError(422, FormError.slug, FormError.title, detail, errors=errors)


class HopsError(HttpError):
    def __init__(self, detail: str) -> None:
        super().__init__(422, "hops", "The call does not fit the component", detail)


class JobFailedError(HttpError):
    """Carries a failed job's own problem."""

    def __init__(self, document: dict[str, Any]) -> None:
        super().__init__(document["status"], "", document["title"], document["detail"])
        self.document = document


class GoneError(HexwrapError):
    slug = "gone"
    title = "The result is no longer kept"
    status = 410

    def __init__(self, detail: str = "The result is no longer kept on the server; send the job again."):
        super().__init__(detail)


class WorkError(HexwrapError):
    """The work ended without a result, and not because of what was asked."""


class TimeLimitError(WorkError, slug="time-limit", title="The work took too long"): ...


class MemoryLimitError(WorkError, slug="memory-limit", title="The work needed too much memory"): ...


class AttemptsError(WorkError, slug="too-many-attempts", title="The job was given up"): ...


class WorkerDiedError(WorkError, slug="worker-died", title="The worker process died", status=503): ...


class ClusterError(WorkError, slug="cluster", title="The cluster could not run the job", status=503): ...


class ShuttingDownError(WorkError):
    slug = "shutting-down"
    title = "The server is shutting down"
    status = 503

    def __init__(self, detail: str = "The server is shutting down; send the request again when it runs."):
        super().__init__(detail)


class InternalError(WorkError, slug="internal", title="A fault in hexwrap", status=500): ...


class StorageError(WorkError):
    slug = "storage"
    title = "The server cannot use its files"
    status = 503

    @staticmethod
    def of(error: Exception) -> StorageError:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_BUSY:
            return BusyError(
                "Another program is using the server's list of jobs (hexwrap.sqlite3 in its data folder); "
                "close it, and send the request again."
            )
        if getattr(error, "errno", None) in (errno.EMFILE, errno.ENFILE):
            return BusyError("Too many files and connections are open; send the request again in a moment.")
        reason = getattr(error, "strerror", None) or error
        return StorageError(
            f"The server could not read or write in its data folder ({reason}); make room there, or start it "
            "with another --data, and send the request again."
        )


class BusyError(StorageError):
    """A moment later it may work."""


class StartError(Exception):
    """Why the server does not start."""


class PortTakenError(StartError):
    """Another program listens there."""


class FolderInUseError(StartError):
    """Another server works in this folder."""


class DamagedError(StartError):
    """The folder's list of jobs cannot be read or written."""


class UsageError(Exception):
    """What was typed makes no sense; the sentence says why."""


class CodecError(ValueError):
    """Bytes that were not written by ``codec.encode``, or were damaged since."""
