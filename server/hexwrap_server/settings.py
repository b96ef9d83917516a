"""What an operator can set. Each setting is data (name, default, help); flags, environment variables and
the README's table are made from it.

A flag (``--job-seconds 60``) goes before its environment variable (``HEXWRAP_JOB_SECONDS=60``), which goes
before the default.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any

MIB = 1024 * 1024


def _setting(default: Any, help: str, metavar: str = "N") -> Any:
    return field(default=default, metadata={"help": help, "metavar": metavar})


def _processors() -> int:
    """Those that this process may use, where the system tells; a container often has fewer than its host."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(8, usable or 1))


@dataclass(frozen=True)
class Settings:
    """Everything that can be set about a running server."""

    host: str = _setting(
        "127.0.0.1", "address to listen on; anything but a loopback address needs a token", "ADDRESS"
    )
    port: int = _setting(6789, "port to listen on")
    workers: int = field(
        default_factory=_processors,
        metadata={"help": "worker processes, one job each", "metavar": "N", "shown": "processors, at most 8"},
    )
    data: str = _setting(
        "", "folder for jobs and results; empty: in the user's data folder, one for each port", "FOLDER"
    )
    token: str = _setting("", "secret that clients must send as 'Authorization: Bearer TOKEN'", "TOKEN")
    allowed_hosts: str = _setting(
        "", "further names in a Host header to answer to, separated by commas", "NAMES"
    )
    engine: str = _setting("process", "where jobs run: 'process' (here) or 'dask' (a cluster)", "NAME")
    scheduler: str = _setting("", "address of the dask scheduler, such as tcp://10.0.0.5:8786", "ADDRESS")
    max_body_mib: float = _setting(256.0, "largest request body, sent or unpacked, in MiB")
    max_vertices: int = _setting(1_000_000, "most vertices of a surface")
    max_panels: int = _setting(200_000, "most panels of a job")
    max_points: int = _setting(1_000_000, "most points of one lift or flatten request")
    readers: int = field(
        default_factory=lambda: min(4, max(2, _processors())),
        metadata={
            "help": "processes that read large bodies and files, one each",
            "metavar": "N",
            "shown": "processors, 2 to 4",
        },
    )
    read_seconds: float = _setting(30.0, "longest reading of a body or file, in seconds")
    read_mib: float = _setting(2048.0, "most memory of a process that reads, in MiB")
    max_queue: int = _setting(100, "most jobs that wait; more are answered 503")
    job_seconds: float = _setting(900.0, "longest run of a job, in seconds")
    explore_seconds: float = _setting(3600.0, "longest run of an exploration, in seconds")
    job_mib: float = _setting(8192.0, "most memory of a worker process, in MiB")
    results_days: float = _setting(30.0, "finished jobs are forgotten after this many days")
    results_mib: float = _setting(4096.0, "disk space for results in MiB; the oldest go first")
    cache_mib: float = _setting(
        2048.0, "disk space for remembered stages in MiB; the longest unused go first"
    )
    memory_cache_mib: float = _setting(
        256.0, "remembered stages in the memory of each worker, in MiB; at most an eighth of --job-mib"
    )
    log_level: str = _setting("info", "debug, info, warning or error", "LEVEL")

    @classmethod
    def from_environment(
        cls, given: Mapping[str, Any] | None = None, environment: Mapping[str, str] = os.environ
    ) -> Settings:
        """given: what flags said; None counts as not said. Raises ValueError with one sentence."""
        given = given or {}
        values: dict[str, Any] = {}
        for item in fields(cls):
            if given.get(item.name) is not None:
                values[item.name] = given[item.name]
            elif variable(item) in environment:
                text = environment[variable(item)]
                try:
                    values[item.name] = _kind(item)(text)
                except ValueError:
                    word = "a whole number" if _kind(item) is int else "a number"
                    raise ValueError(f"{variable(item)} must be {word}, not '{text}'.") from None
        settings = cls(**values)
        settings.check()
        return settings

    @classmethod
    def from_arguments(cls, arguments: argparse.Namespace) -> Settings:
        """From what ``add_arguments`` led to. Raises ValueError with one sentence."""
        return cls.from_environment({f.name: getattr(arguments, f.name, None) for f in fields(cls)})

    def check(self) -> None:
        """Raises ValueError where settings contradict each other or make no sense."""
        for item in fields(self):
            value = getattr(self, item.name)
            least = 0 if item.name == "port" else 1e-9  # port 0: any free one
            if isinstance(value, (int, float)) and not value >= least:
                raise ValueError(f"{flag(item)} must be greater than 0, not {value}.")
        if self.port > 65535:
            raise ValueError(f"--port must be at most 65535, not {self.port}.")
        if not self.is_loopback and not self.token:
            raise ValueError(
                f"--host {self.host} would open the service to the network; give a --token with it."
            )
        if not all("!" <= letter <= "~" for letter in self.token):  # clients differ in how they send others
            raise ValueError("--token may hold only letters, digits and signs of ASCII, and no spaces.")
        if self.engine not in ("process", "dask"):
            raise ValueError(f"--engine must be 'process' or 'dask', not '{self.engine}'.")
        if self.engine == "dask" and not self.scheduler:
            raise ValueError("--engine dask needs --scheduler, such as tcp://10.0.0.5:8786.")
        if self.log_level not in ("debug", "info", "warning", "error"):
            raise ValueError(f"--log-level must be debug, info, warning or error, not '{self.log_level}'.")

    @property
    def is_loopback(self) -> bool:
        return self.host in ("127.0.0.1", "::1", "localhost")


def variable(item: Field[Any]) -> str:
    """Name of a setting's environment variable."""
    return "HEXWRAP_" + item.name.upper()


def flag(item: Field[Any]) -> str:
    """A setting's flag."""
    return "--" + item.name.replace("_", "-")


def shown_default(item: Field[Any]) -> str:
    """A setting's default as the README and ``--help`` say it."""
    if item.default is MISSING:
        return str(item.metadata["shown"])
    return f"{item.default:g}" if isinstance(item.default, float) else str(item.default) or "none"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One flag per setting."""
    for item in fields(Settings):
        parser.add_argument(
            flag(item),
            dest=item.name,
            type=_kind(item),
            default=None,
            metavar=item.metadata["metavar"],
            help=f"{item.metadata['help']} (default: {shown_default(item)})",
        )


def readme_table() -> str:
    """The settings as a Markdown table."""
    rows = [
        f"| `{flag(f)}` | `{variable(f)}` | {shown_default(f)} | {f.metadata['help']} |"
        for f in fields(Settings)
    ]
    return "\n".join(["| flag | environment | default | meaning |", "|---|---|---|---|", *rows])


def _kind(item: Field[Any]) -> type[int] | type[float] | type[str]:
    return {"int": int, "float": float, "str": str}[str(item.type)]
