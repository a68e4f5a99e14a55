"""Messages of `evolve run`, `resume` and related commands about unusable runs, machines and clusters, and about
Ctrl-C.
"""

import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from evolve.runs import carry_on
from evolve.store.directory import Run
from tests.evolve.closed_form import tiny

ROOT = Path(__file__).parents[3]


def test_directory_in_use_is_never_overwritten(call, finished):
    before = {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()}
    code, _, err = call("run", "detection", "--preset", "quick", "--out", finished)
    assert code == 2
    assert "is not empty: choose another name, or continue it with: evolve resume" in err
    assert {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("command", ["resume", "status", "report", "export", "replay"])
def test_damaged_record_is_named_by_every_command_that_reads_it(call, tmp_path, command):
    run = Run.create(tmp_path / "run", tiny())
    (run.path / "candidates.jsonl").write_text("{}\n")
    code, _, err = call(command, run.path)
    assert code == 2
    assert "candidates.jsonl, line 1: is damaged" in err
    assert err.count("\n") == 1


def test_run_in_use_is_refused_by_process(call, tmp_path):
    run = Run.create(tmp_path / "run", tiny())
    with run.lock():
        code, _, err = call("resume", run.path)
        standing = json.loads(call("status", run.path, "--json")[1])
    assert code == 2
    assert f"in use by process {os.getpid()}" in err
    assert standing["state"] == "running"
    assert standing["process"].startswith(str(os.getpid()))


@pytest.mark.slow
def test_machine_without_llvm_is_told_the_remedy_before_anything_is_written(tmp_path):
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": "/absent/libLLVM.so"}
    command = [sys.executable, "-m", "evolve", "run", "detection", "--out", str(tmp_path / "run")]
    child = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert child.returncode == 2
    assert "Remedy: install LLVM" in child.stderr
    assert child.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_ctrl_c_saves_says_how_to_go_on_and_exits_130(tmp_path):
    """A terminal sends the interrupt to the whole process group. (If these tests run in the background, interrupts may
    be ignored, and children inherit that.)
    """
    path = tmp_path / "run"
    small = ("search.population=2", "learning.total_steps=500000000", "learning.eval_interval=500000000")
    settings = [part for text in small for part in ("--set", text)]
    command = [sys.executable, "-m", "evolve", "run", "detection", "--preset", "quick", "--workers", "2", *settings]
    with subprocess.Popen(
        [*command, "--out", path],
        cwd=ROOT,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as child:
        assert b"generations" in child.stdout.readline()
        time.sleep(1.0)  # the workers are starting; the test holds at any moment
        os.killpg(child.pid, signal.SIGINT)
        try:
            _, err = child.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            raise
    assert child.returncode == 130
    assert f"Continue with: evolve resume {path}" in err.decode()
    assert "Traceback" not in err.decode()
    assert Run.open(path).candidates == ()
    with Run.open(path).lock():
        pass  # the lock is free again


def test_workers_and_seed_reach_the_run(call, tmp_path, monkeypatch):
    asked = []

    class Recorder:
        def __init__(self, evaluate, count, prepare):
            asked.append(count)

        def __enter__(self):
            raise KeyboardInterrupt

        def __exit__(self, *_):
            """Do nothing."""

    monkeypatch.setattr(carry_on, "LocalExecutor", Recorder)
    code, _, _ = call("run", "detection", "--workers", 3, "--seed", 5, "--out", tmp_path / "run")
    assert (code, asked) == (130, [3])
    assert Run.open(tmp_path / "run").config.seed == 5


class Hostile:
    """A class that leaves a mark when it is unpickled."""

    def __init__(self, mark):
        self.mark = str(mark)

    def __reduce__(self):
        return os.mkdir, (self.mark,)


@pytest.mark.parametrize("command", ["replay", "resume", "report", "export"])
def test_hostile_pickle_is_refused_and_never_run(call, finished, tmp_path, command):
    run, mark = tmp_path / "run", tmp_path / "executed"
    shutil.copytree(finished, run)
    for policy in range(12):
        (run / "policies" / f"{policy:06d}.safetensors").write_bytes(pickle.dumps(Hostile(mark)))
    code, _, err = call(command, run)
    assert code == 2
    assert "is not a rhabdom policy" in err
    assert err.count("\n") == 1
    assert not mark.exists()
    pickle.loads(pickle.dumps(Hostile(mark)))
    assert mark.exists(), "the pickle was executed"


@pytest.mark.parametrize("command", ["replay", "resume", "report", "export"])
def test_deleted_policy_is_named_and_nothing_is_lost(call, finished, tmp_path, command):
    run = tmp_path / "run"
    shutil.copytree(finished, run)
    best = Run.open(run).best.id
    for policy in (run / "policies").iterdir():
        policy.unlink()
    kept = (run / "candidates.jsonl").read_bytes()
    code, _, err = call(command, run)
    assert code == 2
    assert f"no policy at {run}/policies/{best:06d}.safetensors" in err
    assert err.count("\n") == 1
    assert (run / "candidates.jsonl").read_bytes() == kept
    assert call("status", run)[0] == 0


def test_workers_are_not_dasks(call, tmp_path):
    cluster = ("--executor", "dask", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2")
    code, _, err = call("run", "detection", "--out", tmp_path / "run", *cluster)
    assert code == 2
    assert "--workers: is for this machine's processes" in err


@pytest.mark.parametrize(
    "flags",
    [("--executor", "dask"), ("--scheduler", "tcp://127.0.0.1:1"), ("--executor", "dask", "--scheduler", "no:1")],
)
def test_clusters_that_cannot_be_reached_are_refused(call, tmp_path, monkeypatch, flags):
    code, _, err = call("run", "detection", "--out", tmp_path / "run", *flags)
    assert code == 2
    assert err.count("\n") == 1
    assert "--scheduler" in err or "no Dask scheduler answers" in err
