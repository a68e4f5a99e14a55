"""The command line: bad input gets one line on stderr and exit code 2, never a traceback; help comes at once."""

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
from closed_form import bowl, tiny

import evolve.commands.run
from evolve.cli import main
from evolve.config import TASKS
from evolve.executors import LocalExecutor
from evolve.genotype import GENES
from evolve.loop import evolve as carry_on
from evolve.scalars import Scalars
from evolve.store import Run

ROOT = Path(__file__).parents[2]


@pytest.fixture
def call(capsys):
    """Runs a command; returns exit code, what it printed, and its complaint."""

    def run(*arguments):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
        return code, *capsys.readouterr()

    return run


class Silent:
    """Watches and says nothing."""

    def training(self, candidate_id, steps, planned):
        """Nothing."""

    def evaluated(self, candidate):
        """Nothing."""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished run of closed-form fitness."""
    run = Run.create(tmp_path_factory.mktemp("cli") / "run", tiny())
    with LocalExecutor(bowl, 1) as executor:
        carry_on(run, executor, Silent())
    return run.path


BAD = {
    "no command": ((), "COMMAND"),
    "unknown command": (("rnu", "detection"), "'rnu'"),
    "unknown task": (("run", "detecton"), "unknown task 'detecton'; did you mean 'detection'?"),
    "unknown preset": (("run", "detection", "--preset", "quik"), "did you mean 'quick'?"),
    "unknown gene": (("run", "detection", "--set", "genome.n_eye.open=false"), "did you mean 'n_eyes'?"),
    "unknown key": (("run", "detection", "--set", "serch.sigma=1"), "did you mean 'search'?"),
    "out of range": (("run", "detection", "--set", "search.population=1"), "must be in [2, 10000]"),
    "wrong type": (("run", "detection", "--seed", "one"), "invalid int value: 'one'"),
    "seed out of range": (("run", "detection", "--seed", "-1"), "seed = -1: must be in [0, "),
    "absent config": (("run", "detection", "--config", "/absent.toml"), "/absent.toml: cannot be read"),
    "unwritable place": (("run", "detection", "--out", "/proc/run"), "/proc/run cannot be written"),
    "resume of nothing": (("resume", "/absent"), "/absent is no run: there is no such directory"),
    "status of nothing": (("status", "/tmp"), "/tmp is no run: it holds no config.toml"),
    "report of nothing": (("report", "/absent"), "/absent is no run"),
    "export of nothing": (("export", "/absent"), "/absent is no run"),
    "replay of nothing": (("replay", "/absent"), "/absent is no run"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_line_and_exit_code_2(call, case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, complaint = BAD[case]
    code, out, err = call(*arguments)
    assert code == 2
    assert complaint in err
    assert err.count("\n") == 1
    assert out == ""
    assert list(tmp_path.iterdir()) == [], "nothing may be left behind"


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


def test_machine_without_llvm_is_told_the_remedy_before_anything_is_written(tmp_path):
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": "/absent/libLLVM.so"}
    command = [sys.executable, "-m", "evolve", "run", "detection", "--out", str(tmp_path / "run")]
    child = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert child.returncode == 2
    assert "Remedy: install LLVM" in child.stderr
    assert child.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_status_tells_what_the_record_holds(call, finished):
    run = Run.open(finished)
    standing = json.loads(call("status", finished, "--json")[1])
    assert standing["state"] == "finished"
    assert standing["candidates"] == {"evaluated": 12, "failed": 0, "planned": 12}
    assert standing["best"]["id"] == run.best.id
    assert standing["steps"] == 12 * 4096
    fitness = sorted(candidate.fitness for candidate in run.generation(1))
    assert standing["generations"][1]["median"] == pytest.approx((fitness[1] + fitness[2]) / 2)
    text = call("status", finished)[1]
    assert f"best: candidate {run.best.id}, fitness {run.best.fitness:.4g}" in text


def test_tables_name_every_task_and_gene(call):
    assert [line.split()[0] for line in call("tasks")[1].splitlines()] == list(TASKS)
    lines = call("genes")[1].splitlines()
    table = lines[1 : lines.index("")]
    assert [line.split()[0] for line in table] == list(GENES)
    assert "[1, 512]" in table[list(GENES).index("neurons")]
    records = json.loads(call("genes", "--json")[1])
    assert [record["name"] for record in records] == list(GENES)
    assert all(record["meaning"] and record["mutation"] in ("Gaussian", "±1") for record in records)


def test_help_comes_at_once_and_names_the_commands():
    """Imports decide: 0.1 s without, 1.4 s with any one of the heavy libraries. Seconds differ by machine."""
    code = (
        "import sys; from evolve.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('torch', 'numpy', 'drjit', 'nevergrad', 'rich', 'mitsuba', 'mujoco') if m in sys.modules])"
    )
    child = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert child.stdout.splitlines()[-1] == "[]"
    for command in ("run", "resume", "status", "replay", "report", "export", "validate", "doctor", "tasks", "genes"):
        assert f"\n    {command} " in child.stdout


def test_ctrl_c_saves_says_how_to_go_on_and_exits_130(tmp_path):
    """As a terminal does it: the interrupt goes to the whole process group. (Where these tests run in the background,
    interrupts may be ignored, and children inherit that.)"""
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
        time.sleep(1.0)  # into the workers' start; any moment must do
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
        pass  # free again


def test_workers_and_seed_reach_the_run(call, tmp_path, monkeypatch):
    asked = []

    class Recorder:
        def __init__(self, evaluate, count, prepare):
            asked.append(count)

        def __enter__(self):
            raise KeyboardInterrupt

        def __exit__(self, *_):
            """Nothing to end."""

    monkeypatch.setattr(evolve.commands.run, "LocalExecutor", Recorder)
    code, _, _ = call("run", "detection", "--workers", 3, "--seed", 5, "--out", tmp_path / "run")
    assert (code, asked) == (130, [3])
    assert Run.open(tmp_path / "run").config.seed == 5


class Hostile:
    """Leaves a mark where it is unpickled."""

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
    assert mark.exists(), "it would have been run"


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


def test_compare_puts_runs_side_by_side(call, finished, tmp_path):
    other = Run.create(tmp_path / "other", tiny("seed=3", "search.sigma=0.1"))
    code, out, _ = call("compare", finished, other.path, "--html", tmp_path / "page.html")
    assert code == 0
    rows = {line.split("  ")[0]: line.split()[-1] for line in out.splitlines()}
    assert rows["search.sigma"] == "0.1"
    assert rows["fitness"] == "-"
    assert "search.population" not in rows
    assert "best fitness so far" in (tmp_path / "page.html").read_text().lower()
    both = json.loads(call("compare", finished, finished, "--json")[1])
    assert both["settings"] == {}
    assert both["runs"][0]["best"] == Run.open(finished).best.id
    assert both["runs"][0]["best_so_far"] == sorted(both["runs"][0]["best_so_far"])


def test_watch_ends_with_the_run(call, finished):
    code, out, _ = call("status", finished, "--watch", "--json")
    assert code == 0
    assert [json.loads(line)["state"] for line in out.splitlines()] == ["finished"]


@pytest.mark.parametrize(
    "flags",
    [("--executor", "dask"), ("--scheduler", "tcp://127.0.0.1:1"), ("--executor", "dask", "--scheduler", "no:1")],
)
def test_clusters_that_cannot_be_reached_are_refused(call, tmp_path, monkeypatch, flags):
    code, _, err = call("run", "detection", "--out", tmp_path / "run", *flags)
    assert code == 2
    assert err.count("\n") == 1
    assert "--scheduler" in err or "no Dask scheduler answers" in err


def test_scalars_are_the_records(finished, tmp_path):
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run = Run.open(shutil.copytree(finished, tmp_path / "run"))
    with Scalars(run):
        pass
    shown = {}
    for name in ("candidates", "generations"):
        events = accumulator.EventAccumulator(str(run.path / "tensorboard" / name))
        events.Reload()
        shown[name] = {tag: {e.step: e.value for e in events.Scalars(tag)} for tag in events.Tags()["scalars"]}
    assert shown["candidates"]["fitness"] == pytest.approx({c.id: c.fitness for c in run.candidates}, rel=1e-6)
    assert shown["candidates"]["genes/fov_deg"] == pytest.approx({c.id: c.phenotype.fov_deg for c in run.candidates})
    best = {g: max(c.fitness for c in run.generation(g)) for g in range(3)}
    assert shown["generations"]["fitness/best"] == pytest.approx(best, rel=1e-6)
