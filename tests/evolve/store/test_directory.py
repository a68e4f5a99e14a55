"""The record: read back bit for bit, never overwritten, whole after any crash, and damage named by file and line."""

import json
import math
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from evolve.config.numbering import Place
from evolve.config.run_config import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError, next_directory
from evolve.store.evaluation import Evaluation
from evolve.store.lock import LockedError
from evolve.store.versions import altered, present, record_start, recorded
from tests.evolve.closed_form import tiny

CONFIG = tiny()
DIMENSION = Genotype(CONFIG.genome).dimension


def candidate(identity, fitness=1.0, failure=None):
    genome = np.random.default_rng(identity).random(DIMENSION)
    outcome = Evaluation(fitness, (fitness, 1 / 3), 0.5, 4096, 0.1, ((2048, 0.1), (4096, math.pi)), failure)
    return Candidate.of(
        Place.of(identity, 4), tuple(genome.tolist()), develop(genome, CONFIG), 2**32 - 1 - identity, outcome
    )


@pytest.fixture
def run(tmp_path):
    return Run.create(tmp_path / "run", CONFIG)


def test_record_reads_back_bit_for_bit(run):
    written = [candidate(2, 0.1 + 0.2), candidate(0, -1e-300), candidate(1)]
    for entry in written:
        run.append(entry)
    again = Run.open(run.path)
    assert again.candidates == (written[1], written[2], written[0]) == run.candidates
    assert again.config == CONFIG


def test_failures_have_the_worst_fitness_and_valid_json(run):
    run.append(candidate(0, -5.0))
    run.append(candidate(1, math.nan))
    run.append(
        Candidate.of(Place(2, 0, 2), (0.5,) * DIMENSION, run.candidates[0].phenotype, 1, Evaluation.failed("it\nbroke"))
    )
    lines = (run.path / "candidates.jsonl").read_text().splitlines()
    assert [json.loads(line, parse_constant=pytest.fail)["fitness"] for line in lines] == [-5.0, None, None]
    _, nan, broken = Run.open(run.path).candidates
    assert nan.fitness == broken.fitness == -math.inf
    assert (nan.failure, broken.failure) == ("fitness is nan", "it broke")
    assert Run.open(run.path).best.id == 0


def test_best_is_the_earliest_of_the_fittest(run):
    assert run.best is None
    for identity, fitness in ((3, 2.0), (1, 2.0), (0, 1.0)):
        run.append(candidate(identity, fitness))
    assert run.best.id == 1


def test_candidate_is_written_once(run):
    run.append(candidate(0))
    with pytest.raises(RunError, match="candidate 0 has been evaluated already"):
        run.append(candidate(0, 9.0))


@pytest.mark.parametrize("begun_anew", [True, False], ids=["begun anew", "deleted"])
def test_a_run_that_is_somebody_elses_by_now_gets_no_more_lines(run, begun_anew):
    """Its directory was deleted under its process, and perhaps another run begun in the same place."""
    run.append(candidate(0))
    record = run.path / "candidates.jsonl"
    record.unlink()
    if begun_anew:
        record.write_text(candidate(0).to_line() + candidate(1).to_line())
    with pytest.raises(RunError, match="no longer as this process left it"):
        run.append(candidate(2))
    assert len(record.read_text().splitlines()) == 2 * begun_anew


@pytest.mark.parametrize("kept", [1, 40, -2, -1])
def test_unfinished_last_line_is_dropped_with_a_notice_and_cut_off_on_repair(run, kept):
    """At any byte but the newline, which makes a line whole."""
    run.append(candidate(0))
    whole = (run.path / "candidates.jsonl").read_bytes()
    torn = candidate(1).to_line().encode()[:kept]
    (run.path / "candidates.jsonl").write_bytes(whole + torn)
    again = Run.open(run.path)
    assert [c.id for c in again.candidates] == [0]
    assert "line 2 is unfinished" in again.notice
    assert (run.path / "candidates.jsonl").read_bytes() == whole + torn, "reading must not write"
    again.repair()
    again.append(candidate(1))
    assert [c.id for c in Run.open(run.path).candidates] == [0, 1]
    assert Run.open(run.path).notice is None


def damaged(change):
    record = json.loads(candidate(1).to_line())
    change(record)
    return json.dumps(record) + "\n"


DAMAGE = {
    "no JSON": ("{]\n", "Expecting"),
    "not UTF-8": (b"\xff\xfe\n", "utf-8"),
    "zeros": (b"\0" * 64 + b"\n", "Expecting"),
    "no record": ("[1]\n", "must hold exactly"),
    "missing": (damaged(lambda r: r.pop("genome")), "must hold exactly"),
    "wrong type": (damaged(lambda r: r.update(genome=None)), "wrong type"),
    "wrong phenotype": (damaged(lambda r: r["phenotype"].pop("n_eyes")), "n_eyes"),
    "wrong genome": (damaged(lambda r: r["genome"].pop()), f"{DIMENSION} genes are open"),
    "wrong place": (damaged(lambda r: r.update(index=3)), "can't be number 3 of generation 0"),
    "twice": (candidate(0).to_line(), "candidate 0 is there twice"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_named_by_file_and_line(run, kind):
    line, reason = DAMAGE[kind]
    run.append(candidate(0))
    with (run.path / "candidates.jsonl").open("ab") as file:
        file.write(line if isinstance(line, bytes) else line.encode())
    with pytest.raises(RunError, match=r"candidates\.jsonl, line 2: is damaged") as caught:
        Run.open(run.path)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_directory_with_something_in_it_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("all of it")
    with pytest.raises(RunError, match=r"is not empty: choose another name, or continue it with: evolve resume"):
        Run.create(tmp_path, CONFIG)
    assert [entry.name for entry in tmp_path.iterdir()] == ["thesis.tex"]


def test_two_that_create_at_once_do_not_mix(tmp_path, monkeypatch):
    """The second comes while the first is between its look at the directory and its config."""

    def meanwhile(*arguments):
        with pytest.raises(LockedError, match=f"in use by process {os.getpid()}"):
            Run.create(tmp_path / "run", tiny("seed=2"))
        record_start(*arguments)

    monkeypatch.setattr("evolve.store.directory.record_start", meanwhile)
    Run.create(tmp_path / "run", CONFIG)
    assert Run.open(tmp_path / "run").config == CONFIG


def test_file_in_the_way_and_unwritable_place_are_named(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "run", "/proc/run"):
        with pytest.raises(RunError, match="cannot be written: "):
            Run.create(path, CONFIG)


def test_what_is_no_run_is_named(tmp_path):
    with pytest.raises(RunError, match="there is no such directory"):
        Run.open(tmp_path / "absent")
    with pytest.raises(RunError, match=r"it holds no config\.toml"):
        Run.open(tmp_path)


def test_damaged_config_is_named(run):
    (run.path / "config.toml").write_text("task = 'detection'\n[serch]\n")
    with pytest.raises(ConfigError, match=r"config\.toml, line 2: unknown key 'serch'"):
        Run.open(run.path)
    (run.path / "candidates.jsonl").unlink()
    (run.path / "config.toml").write_text("task = 'detection'\n")
    with pytest.raises(RunError, match=r"candidates\.jsonl: cannot be read"):
        Run.open(run.path)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_full_disk_is_named(run):
    (run.path / "candidates.jsonl").unlink()
    (run.path / "candidates.jsonl").symlink_to("/dev/full")
    with pytest.raises(RunError, match=r"candidates\.jsonl: cannot be written: No space left"):
        run.append(candidate(0))
    assert run.candidates == (), "what is not on disk is not on record"


def test_a_record_that_may_not_grow_loses_nothing(run):
    """A limit of the file's size stands for a disk that is full from here on."""
    run.append(candidate(0))
    record = run.path / "candidates.jsonl"
    kept = record.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(kept), hard))
    try:
        with pytest.raises(RunError, match=r"candidates\.jsonl: cannot be written: File too large"):
            run.append(candidate(1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert record.read_bytes() == kept
    assert [c.id for c in run.candidates] == [0], "what is not on disk is not on record"


def test_versions_are_recorded_at_each_start(run):
    assert recorded(run.path) == present()
    assert {"nevergrad", "cma", "torch", "drjit", "python"} <= present().keys()
    record_start(run.path, 7)
    starts = json.loads((run.path / "versions.json").read_text())
    assert [start["candidates"] for start in starts] == [0, 7]


def test_settings_that_change_meanwhile_are_noticed(run):
    """What decides nothing may change: how many work, and for how long."""
    config = run.path / "config.toml"
    began = config.read_text()
    changes = (
        ("workers = ", "workers = 1", False),
        ("generations = ", "generations = 1", False),
        ("[eye]", "# what eyes have in common\n\n[eye]", False),
        ("noise_sigma = ", "noise_sigma = 1", True),
    )
    for setting, other, noticed in changes:
        changed = began.replace(setting, other)
        assert changed != began
        config.write_text(changed)
        assert altered(run.path) == noticed
    record_start(run.path, 3)
    assert not altered(run.path), "it was told once"
    (run.path / "versions.json").unlink()
    assert not altered(run.path)


def test_default_directory_is_the_first_that_is_free(tmp_path):
    assert next_directory("detection", "quick", tmp_path).name == "detection-quick-1"
    (tmp_path / "detection-quick-1").mkdir()
    (tmp_path / "detection-quick-3").mkdir()
    assert next_directory("detection", "quick", tmp_path).name == "detection-quick-2"


def test_run_killed_while_it_is_created_can_be_begun_again(tmp_path):
    """config.toml is written last; before it there is nothing to lose."""
    for left in ((), ("versions.json",), ("versions.json", "candidates.jsonl", ".config.toml.123.unfinished")):
        path = tmp_path / str(len(left))
        (path / "policies").mkdir(parents=True)
        for name in left:
            (path / name).touch()
        assert Run.create(path, CONFIG).candidates == ()
        assert Run.open(path).config == CONFIG
    (tmp_path / "other" / "policies").mkdir(parents=True)
    (tmp_path / "other" / "policies" / "mine").touch()
    with pytest.raises(RunError, match="is not empty"):
        Run.create(tmp_path / "other", CONFIG)


def test_repair_removes_what_was_half_written(run):
    for folder in (run.path, run.path / "policies"):
        (folder / ".000001.77.unfinished").touch()
    run.repair()
    assert not list(run.path.rglob("*.unfinished"))
    assert (run.path / "config.toml").exists()


def test_read_only_directory_is_named_and_can_still_be_read(tmp_path):
    """In a process of its own, which gives up root's rights if it has them: root may write anywhere."""
    run = Run.create(tmp_path / "run", CONFIG)
    run.append(candidate(0))
    kept = (run.path / "candidates.jsonl").read_bytes()
    script = (
        "import os, sys\n"
        "sys.path[:0] = sys.argv[2:]\n"
        "from tests.evolve.store.test_directory import Run, candidate\n"
        "Run.open(sys.argv[1])\n"
        "os.setuid(65534) if os.geteuid() == 0 else None\n"
        "run = Run.open(sys.argv[1])\n"
        "print([c.id for c in run.candidates])\n"
        "for change in (lambda: run.append(candidate(1)), lambda: run.lock().__enter__(), run.repair):\n"
        "    try:\n"
        "        change()\n"
        "    except Exception as error:\n"
        "        print(f'{type(error).__name__}: {error}')\n"
    )
    for place in (tmp_path, *tmp_path.parents):  # all that pytest made, however deep its workers nest it
        if "pytest" in str(place):
            place.chmod(0o755)
    run.path.chmod(0o555)
    for file in run.path.iterdir():
        file.chmod(0o555 if file.is_dir() else 0o444)
    command = [sys.executable, "-c", script, str(run.path), str(Path(__file__).parents[3])]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = child.stdout.splitlines()
    assert lines[0] == "[0]", child.stderr
    assert len(lines) == 4
    assert all("cannot be written: Permission denied" in line for line in lines[1:]), lines
    assert (run.path / "candidates.jsonl").read_bytes() == kept
