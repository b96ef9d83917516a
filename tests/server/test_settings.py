"""Settings are data: flags, environment and documentation say the same."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from hexwrap_server.errors import FolderInUseError
from hexwrap_server.http.service import open_store
from hexwrap_server.settings import Settings, add_arguments, flag, readme_table, variable

PAGE = Path(__file__).parents[2] / "docs" / "service.md"


def parsed(*words: str) -> Settings:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return Settings.from_arguments(parser.parse_args(words))


def test_every_setting_is_in_the_documentation_as_it_is() -> None:
    assert readme_table() in PAGE.read_text(encoding="utf-8")


def test_every_setting_has_a_flag_a_variable_and_help() -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    shown = parser.format_help()
    for item in fields(Settings):
        assert flag(item) in shown
        assert variable(item) == "HEXWRAP_" + item.name.upper()
        assert item.metadata["help"]


def test_flags_go_before_variables_before_defaults() -> None:
    environment = {"HEXWRAP_PORT": "7000", "HEXWRAP_WORKERS": "3"}
    settings = Settings.from_environment({"port": 8000, "token": None}, environment)
    assert (settings.port, settings.workers, settings.max_queue) == (8000, 3, 100)
    assert parsed("--job-seconds", "5.5", "--data", "x").job_seconds == 5.5


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--host", "0.0.0.0"), "--token"),
        (("--engine", "abacus"), "--engine"),
        (("--engine", "dask"), "--scheduler"),
        (("--port", "70000"), "--port"),
        (("--workers", "0"), "--workers"),
        (("--job-seconds", "-1"), "--job-seconds"),
        (("--job-mib", "nan"), "--job-mib"),
        (("--log-level", "loud"), "--log-level"),
        (("--token", "geheimnisträger"), "--token"),
        (("--token", "open sesame"), "--token"),
        (("--token", "sesame\n"), "--token"),
    ],
)
def test_settings_that_make_no_sense_are_refused(words: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        parsed(*words)


def test_variable_of_the_wrong_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="HEXWRAP_PORT must be a whole number"):
        Settings.from_environment(environment={"HEXWRAP_PORT": "many"})


def test_network_address_with_a_token_is_taken() -> None:
    assert not parsed("--host", "0.0.0.0", "--token", "secret").is_loopback


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="not told by this system")
def test_there_are_no_more_workers_than_processors_they_may_use() -> None:
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        assert Settings().workers == 1
    finally:
        os.sched_setaffinity(0, allowed)


def test_port_alone_decides_where_the_jobs_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platformdirs.user_data_dir", lambda *_, **__: str(tmp_path / "hexwrap"))

    def folders(*ports: int) -> dict[int, Path]:
        """Of servers that are started one after the other."""
        stores = {port: open_store(Settings(port=port)) for port in ports}
        for store in stores.values():
            store.close()
        return {port: store.folder for port, store in stores.items()}

    first = folders(7001, 6789, 7002)
    assert len(set(first.values())) == 3
    assert folders(7002, 7001, 6789) == folders(7001, 6789, 7002) == first
    open_first = open_store(Settings(port=7001))
    with pytest.raises(FolderInUseError, match="--data"):
        open_store(Settings(port=7001))
    open_first.close()


@pytest.mark.skipif(sys.platform == "win32", reason="modes of POSIX")
def test_data_is_nobody_elses_business(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platformdirs.user_data_dir", lambda *_, **__: str(tmp_path / "user" / "hexwrap"))
    for settings in (Settings(port=7001), Settings(data=str(tmp_path / "own"))):
        open_store(settings).close()
    for folder in (tmp_path / "user" / "hexwrap", tmp_path / "own"):
        assert folder.stat().st_mode & 0o777 == 0o700
