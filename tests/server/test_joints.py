"""Sizes chosen for the joints they leave, from the command line to the Result."""

from __future__ import annotations

import json

import pytest

from hexwrap_server.cli.main import main


def solve(tmp_path, *options):
    out = tmp_path / "result.json"
    status = main(["solve", "sample:facade", "-q", "-o", str(out), *options])
    return status, json.loads(out.read_text(encoding="utf-8")) if status == 0 else None


def test_fewest_sizes_leave_no_joint_wider_than_asked(tmp_path):
    _, result = solve(tmp_path, "--sizes", "fewest", "--max-gap", "0.05")
    gap = result["quality"]["gap"]
    assert gap["tangential"]["max"] <= 0.05 * (1 + 1e-9)
    assert gap["over"] == 0
    _, plain = solve(tmp_path, "--sizes", str(len(result["sizes"]) - 1), "--max-gap", "0.05")
    assert plain["quality"]["gap"]["tangential"]["max"] > 0.05
    assert 0 < plain["quality"]["gap"]["over"] <= len(plain["panels"]["face"])


def test_without_a_greatest_joint_none_is_counted(tmp_path):
    _, result = solve(tmp_path)
    assert result["quality"]["gap"]["over"] is None
    curve = result["quality"]["trade_off"]
    assert len(curve["joint_max"]) == len(curve["joint_mean"]) == len(curve["sizes"])
    assert (curve["joint_max"][10]) == pytest.approx(result["quality"]["gap"]["tangential"]["max"], rel=0.1)


def test_fewest_sizes_without_a_greatest_joint_are_refused(tmp_path, capsys):
    status, _ = solve(tmp_path, "--sizes", "fewest")
    assert status == 1
    assert "max_gap" in capsys.readouterr().err
