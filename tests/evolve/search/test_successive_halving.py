"""Successive halving: promotion, cost, and a training run in rungs that equals a whole one."""

import random
from dataclasses import replace
from types import SimpleNamespace

import pytest

from evolve.config.assemble import assemble
from evolve.config.run_config import ConfigError, LearningConfig, SearchConfig
from evolve.interactive.opened_run import OpenedRun
from evolve.learning.checkpoint import load_checkpoint
from evolve.learning.checkpoint_file import CheckpointWarning
from evolve.learning.fitness import evaluate
from evolve.learning.training_rung import TrainingRung
from evolve.runs import progress
from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve
from evolve.search.successive_halving import (
    budgets,
    evaluations,
    finished,
    promoted,
    sizes,
    steps,
)
from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run, RunError
from tests.evolve.closed_form import tiny
from tests.evolve.remote_form import MISHAPS, fails_late, in_stages
from tests.evolve.search.test_loop import SilentWatcher
from tests.evolve.small_run import PHENOTYPE, small_config
from tests.evolve.store.handwriting import records_of, write_records

THREE = SearchConfig(population=7, generations=5, rungs=3, promoted=0.5)
HALVING = ("search.population=7", "search.rungs=3", "learning.total_steps=16384")


def test_budgets_and_sizes_halve():
    learning = LearningConfig(total_steps=100_000)
    assert budgets(THREE, learning) == (25_000, 50_000, 100_000)
    assert sizes(THREE) == (7, 4, 2)
    assert evaluations(THREE) == 5 * 13
    quarters = replace(THREE, rungs=2, promoted=0.25)
    assert budgets(quarters, learning) == (25_000, 100_000)
    assert sizes(quarters) == (7, 2)
    assert sizes(replace(THREE, population=2, rungs=4)) == (2, 1, 1, 1), "at least one candidate is trained to the end"
    one = SearchConfig(population=7)
    assert (budgets(one, learning), sizes(one)) == ((100_000,), (7,))


def test_steps_are_those_of_all_stages():
    config = tiny(*HALVING)
    assert steps(config) == 3 * (7 * 4096 + 4 * 4096 + 2 * 8192)
    assert steps(tiny()) == 12 * 4096


def test_the_better_half_is_promoted_and_nobody_who_failed():
    fitness = [(0, 1.0), (1, 5.0), (2, 3.0), (3, 3.0), (4, -9.0), (5, 3.0), (6, 2.0)]
    assert promoted(THREE, 0, fitness) == {1, 2, 3, 5}
    assert promoted(THREE, 1, [(identity, told) for identity, told in fitness if identity in (1, 2, 3, 5)]) == {1, 2}
    assert promoted(THREE, 2, fitness) == set()
    failed = float("-inf")
    assert promoted(THREE, 0, [(identity, failed if identity else 1.0) for identity, _ in fitness]) == {0}


def carry(path, config, monkeypatch, evaluate=in_stages, until=None):
    monkeypatch.setenv("RHABDOM_TEST", str(path.parent))
    run = Run.open(path) if path.exists() else Run.create(path, config)
    run.repair()
    onlooker = SilentWatcher(until)
    with LocalExecutor(evaluate, 2) as executor:
        evolve(run, executor, onlooker)
    return Run.open(path), onlooker


def lines(run):
    """Return the record independently of the order of finishing."""
    return sorted((c.id, c.rung, c.genome, c.fitness, c.steps, c.curve) for c in run.in_order_of_finish)


def test_the_better_go_on_and_the_search_is_told_how_far_each_came(tmp_path, monkeypatch):
    run, onlooker = carry(tmp_path / "run", tiny(*HALVING), monkeypatch)
    assert finished(run)
    assert len(onlooker.seen) == 3 * 13
    for generation in range(3):
        rungs = [c.rung for c in run.generation(generation)]
        assert (len(rungs), sum(r > 0 for r in rungs), sum(r > 1 for r in rungs)) == (7, 4, 2)
        first = {c.id: c.fitness for c in run.in_order_of_finish if c.rung == 0 and c.generation == generation}
        gone_on = [c.id for c in run.generation(generation) if c.rung > 0]
        assert set(gone_on) == set(sorted(first, key=first.get)[-4:])
    assert {c.rung: c.steps for c in run.candidates} == {0: 4096, 1: 8192, 2: 16384}
    trained = next(c for c in run.candidates if c.rung == 2)
    assert run.policy_path(trained.id).read_text().count(" to ") == 3
    assert not list((run.path / "trainings").iterdir()), "a finished generation leaves no training state behind"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return an uninterrupted run."""
    with pytest.MonkeyPatch.context() as patch:
        return carry(tmp_path_factory.mktemp("whole") / "run", tiny(*HALVING), patch)[0]


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("until", [9, 3, 13, 20])
def test_interrupted_anywhere_it_goes_on_to_the_same_history(tmp_path, monkeypatch, whole, until):
    path = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        carry(path, tiny(*HALVING), monkeypatch, until=until)
    kept = (path / "candidates.jsonl").read_bytes()
    run, _ = carry(path, None, monkeypatch)
    assert (path / "candidates.jsonl").read_bytes().startswith(kept)
    assert lines(run) == lines(whole)


def test_who_is_killed_after_the_last_line_leaves_no_trainings_behind(tmp_path, monkeypatch, call):
    run, _ = carry(tmp_path / "run", tiny(*HALVING, "search.generations=1"), monkeypatch)
    for resume in (lambda: call("resume", run.path, "--quiet"), lambda: OpenedRun.open(run.path).resume()):
        left = run.checkpoint_path(6, 1)
        write_whole(left, b"a training")
        resume()
        assert not left.exists()


def test_what_was_lived_before_a_stage_that_fails_is_kept(tmp_path, monkeypatch):
    """Steps, curve and failures of episodes in the rung before are kept. Failures of episodes are also kept if no rung
    fails.
    """
    run, _ = carry(tmp_path / "run", tiny(*HALVING, "search.generations=1"), monkeypatch, fails_late)
    failed = [c for c in run.candidates if c.failure is not None]
    assert {c.rung for c in failed} == {1}
    for candidate in run.in_order_of_finish:
        before = run.on_record(candidate.id, candidate.rung - 1)
        if candidate.failure is not None:
            assert candidate.steps == before.steps == 4096
            assert candidate.curve == before.curve != ()
            assert candidate.episode_failures == before.episode_failures == MISHAPS
    whole = next(c for c in run.candidates if c.rung == 2)
    assert whole.steps == 16384
    # Four kinds and others, three times. The others are failures that are not named.
    assert dict(whole.episode_failures) == {said: 3 * number for said, number in MISHAPS}


def test_progress_of_a_stage_that_fails_never_runs_backwards(tmp_path, monkeypatch):
    class Counting:
        def __init__(self):
            self.tally, self.paces = None, []

        def training(self, candidate_id, steps, planned):
            """Do nothing."""

        def evaluated(self, candidate):
            self.tally.evaluated(candidate)
            self.paces.append(self.tally.steps_per_second)

    monkeypatch.setenv("RHABDOM_TEST", str(tmp_path))
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: 0.0))  # only steps distinguish the paces
    run, counting = Run.create(tmp_path / "run", tiny(*HALVING, "search.generations=1")), Counting()
    counting.tally = progress.Tally(run)
    with LocalExecutor(fails_late, 1) as executor:
        evolve(run, executor, counting)
    assert counting.paces == sorted(counting.paces)


@pytest.mark.slow
def test_a_lost_checkpoint_is_trained_again(tmp_path, monkeypatch, whole):
    with pytest.raises(KeyboardInterrupt):
        carry(tmp_path / "run", tiny(*HALVING), monkeypatch, until=9)
    lost = list((tmp_path / "run" / "trainings").iterdir())
    assert lost
    for path in lost:
        path.unlink()
    assert lines(carry(tmp_path / "run", None, monkeypatch)[0]) == lines(whole)


def test_a_damaged_checkpoint_is_set_aside_and_trained_again(tmp_path, monkeypatch):
    """The run says which files it does not use. Damages are drawn at random, and one file is that of another candidate.

    The closed-form evaluation of this test reads checkpoints as a worker does. A candidate would fail if it received a
    damaged file.
    """
    (tmp_path / "a").mkdir()
    whole, _ = carry(tmp_path / "a" / "run", tiny(*HALVING, "search.generations=1"), monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        carry(tmp_path / "run", tiny(*HALVING, "search.generations=1"), monkeypatch, until=7)
    kept = sorted((tmp_path / "run" / "trainings").iterdir())
    contents = {path.name: damaged(path.read_bytes()) for path in kept}
    contents[kept[0].name] = kept[1].read_bytes()
    for path in kept:
        path.write_bytes(contents[path.name])
    with pytest.warns(CheckpointWarning) as said:
        run, _ = carry(tmp_path / "run", None, monkeypatch)
    assert lines(run) == lines(whole)
    aside = {path.name.removesuffix(".unused"): path.read_bytes() for path in (run.path / "trainings").iterdir()}
    assert len(aside) == len(said) == 4, "four candidates go on"
    assert aside.items() <= contents.items()
    for name, warning in zip(sorted(aside), said, strict=True):
        assert str(warning.message).startswith(f"{run.path / 'trainings' / name}: it ")


def damaged(content):
    """Return the content with one bit flipped, or cut off at a random byte."""
    at = random.randrange(len(content))
    if random.random() < 0.5:
        return content[:at]
    return content[:at] + bytes([content[at] ^ 1 << random.randrange(8)]) + content[at + 1 :]


def test_a_record_whose_rungs_do_not_follow_each_other_is_damaged(tmp_path, monkeypatch):
    run, _ = carry(tmp_path / "run", tiny(*HALVING), monkeypatch)
    record = run.path / "candidates.jsonl"
    orphan = next(line for line in records_of(record) if line["rung"] == 1)
    write_records(record, [orphan])
    with pytest.raises(RunError, match=r"line 1: is damaged: .* is on rung 1, but the rung below is missing"):
        Run.open(run.path)
    write_records(record, [{**orphan, "rung": 3}])
    with pytest.raises(RunError, match=r"rung = 3: must be at least 0 and below search\.rungs = 3"):
        Run.open(run.path)


def test_stages_that_cannot_be_are_refused():
    with pytest.raises(ConfigError, match=r"search\.rungs = 2: successive halving needs generations"):
        assemble("detection", assignments=["search.rungs=2", "search.steady_state=true"])
    with pytest.raises(ConfigError, match="the first rung, 3906 steps, is less than one rollout of 4096"):
        assemble("detection", assignments=["search.rungs=9"])
    with pytest.raises(ConfigError, match=r"search\.promoted = 1\.0: must be in \(0, 0\.9\]"):
        assemble("detection", assignments=["search.promoted=1.0"])


def test_a_training_in_stages_is_one_training(tmp_path, short_episodes):
    """The result is the same bit for bit, whether each rung continues from stored state or all rungs run in one
    process.
    """
    plain = small_config()
    whole_training = replace(plain.learning, total_steps=1024)
    # the configuration of a whole run
    config = replace(plain, learning=whole_training, search=replace(plain.search, rungs=3))

    def life(name, ends):
        kept = tuple(tmp_path / f"{name}-{number}" for number in range(len(ends)))
        outcome = evaluate(PHENOTYPE, config, 5, tmp_path / name, rung=TrainingRung(ends, kept))
        return outcome, kept

    ends = (256, 512, 1024)
    by_stage = [life("pieces", ends[: number + 1])[0] for number in range(3)]
    whole, kept = life("whole", ends)
    assert by_stage[2].returns == whole.returns
    assert by_stage[2].curve == whole.curve
    assert [steps for steps, _ in whole.curve] == [256, 512, 1024]
    assert (tmp_path / "pieces").read_bytes() == (tmp_path / "whole").read_bytes()
    assert (tmp_path / "pieces-2").read_bytes() == kept[2].read_bytes()
    owners = TrainingRung(ends, kept).owners(PHENOTYPE, config, 5)
    before, end = (load_checkpoint(kept[number], owners[number]) for number in (1, 2))
    assert (end.steps, end.adam["steps"] > before.adam["steps"]) == (1024, True)


def test_the_first_stage_is_a_short_training_and_the_next_goes_on_from_it(tmp_path, short_episodes):
    config = small_config()
    short = replace(config, learning=replace(config.learning, total_steps=256))
    plain = evaluate(PHENOTYPE, short, 5, tmp_path / "plain")
    kept = (tmp_path / "0", tmp_path / "1")
    first = evaluate(PHENOTYPE, config, 5, tmp_path / "policy", rung=TrainingRung((256,), kept[:1]))
    assert (first.returns, first.curve) == (plain.returns, plain.curve)
    told = []
    goes_on = evaluate(
        PHENOTYPE, config, 5, tmp_path / "policy", lambda *s: told.append(s), TrainingRung((256, 512), kept)
    )
    assert told == [(512, 512)]
    assert goes_on.curve[0] == plain.curve[0]
