"""Log lines as JSON, in the server and in its workers."""

from __future__ import annotations

import json
import logging
import sys
from datetime import UTC, datetime

#: Fields of a log record that are passed on when somebody sets them.
FIELDS = ("job", "job_name", "seconds", "found", "method", "path", "status")
#: The job that a worker process is at.
_JOB: list[str] = []


def at_work_for(job: str) -> None:
    """Log lines of this process name the job from now on; empty: none."""
    _JOB[:] = [job] if job else []


class JsonLines(logging.Formatter):
    """One JSON object per line."""

    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        line |= {name: getattr(record, name) for name in FIELDS if getattr(record, name, None) is not None}
        if _JOB:
            line.setdefault("job", _JOB[0])
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


def set_up_logging(level: str) -> None:
    """Log lines of hexwrap, uvicorn and Python's warnings to standard error."""
    logging.captureWarnings(True)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    for name in ("hexwrap", "uvicorn", "py.warnings"):
        logger = logging.getLogger(name)
        logger.handlers = [handler]
        logger.propagate = False
        logger.setLevel(level.upper() if name == "hexwrap" else "WARNING")
