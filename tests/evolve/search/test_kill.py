"""Kill a real run with `kill -9`: it resumes, evaluates no candidate twice, and ends with the same result."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.slow_part import number, slow

ROOT = Path(__file__).parents[3]
KILLS = int(os.environ.get("RHABDOM_KILLS", "50"))
TRAINING_KILLS = int(os.environ.get("RHABDOM_TRAINING_KILLS", "2"))
SMALL = """
seed = 11
workers = 1
[search]
population = 2
generations = 2
[learning]
total_steps = 128
n_envs = 8
n_steps = 16
batch_size = 64
n_epochs = 1
eval_interval = 100000
[eye]
optics = false
[evaluation]
episodes = 2
"""
LIFE = ("id", "generation", "index", "genome", "phenotype", "seed", "fitness", "returns", "success_rate", "curve")


def begin(*arguments):
    command = [sys.executable, "-m", "evolve", *map(str, arguments)]
    return subprocess.Popen(command, cwd=ROOT, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def record(path):
    return [json.loads(line) for line in (path / "candidates.jsonl").read_text().splitlines()]


def lives(path):
    """Return the contents of a record by candidate, without durations."""
    return sorted(tuple(json.dumps(line[name]) for name in LIFE) for line in record(path))


def tensors(policy):
    """Return the numbers of a safetensors file, after its header, whose entries have no fixed order."""
    content = policy.read_bytes()
    return content[8 + int.from_bytes(content[:8], "little") :]


@pytest.mark.slow
def test_killed_run_resumes_to_the_history_of_an_uninterrupted_one(tmp_path, call, monkeypatch):
    """The run that is killed has processes of its own. The others write no report."""
    monkeypatch.setattr("evolve.cli.commands.run._finish", lambda run, *rest: 0)
    config = tmp_path / "small.toml"
    config.write_text(SMALL)
    run = ("run", "detection", "--preset", "quick", "--config", config, "--out")
    killed = begin(*run, tmp_path / "killed")
    lines = tmp_path / "killed" / "candidates.jsonl"
    while not lines.exists() or lines.read_bytes().count(b"\n") < 1:
        assert killed.poll() is None, killed.stderr.read().decode()
        time.sleep(0.05)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    kept = lines.read_bytes()
    policies = {path: path.stat().st_mtime_ns for path in (tmp_path / "killed" / "policies").iterdir()}
    done = [line["id"] for line in record(tmp_path / "killed")]
    assert 1 <= len(done) < 4, "the kill was too late for the test"

    code, out, err = call("resume", tmp_path / "killed")
    assert code == 0, err
    assert "on record" in out
    code, _, err = call(*run, tmp_path / "whole")
    assert code == 0, err
    assert lines.read_bytes().startswith(kept)
    assert sorted(line["id"] for line in record(tmp_path / "killed")) == [0, 1, 2, 3]
    assert all(line["failure"] is None for line in record(tmp_path / "killed"))
    assert all(path.stat().st_mtime_ns == time for path, time in policies.items() if int(path.stem) in done)
    assert lives(tmp_path / "killed") == lives(tmp_path / "whole")
    for policy in (tmp_path / "whole" / "policies").iterdir():
        assert tensors(policy) == tensors(tmp_path / "killed" / "policies" / policy.name)


@pytest.mark.parametrize(
    ("script", "kills"),
    [("kills.py", number(KILLS, 5)), slow("training_kills.py", TRAINING_KILLS)],
    ids=["search", "training"],
)
def test_kills_at_random_moments_change_nothing(tmp_path, script, kills):
    """The test runs in a separate process, because it forks. The printed seed allows a failure to be repeated."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)}
    command = [sys.executable, Path(__file__).with_name(script), str(kills)]
    child = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stdout + child.stderr
    assert "finished as if nothing had happened" in child.stdout
