"""The loop: the same history without interruption, with interruption at any point, and with any number of workers."""

import heapq

import numpy as np
import pytest

from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve
from evolve.search.search import training_seed
from evolve.search.successive_halving import finished
from evolve.store.directory import Run, RunError
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import bowl, calls, fails_for_some, slow_for_some, tiny


class SilentWatcher:
    """A watcher that interrupts the run after a number of candidates."""

    def __init__(self, until=None):
        self.until, self.seen, self.steps = until, [], 0

    def training(self, candidate_id, steps, planned):
        self.steps += 1

    def evaluated(self, candidate):
        self.seen.append(candidate.id)
        if len(self.seen) == self.until:
            raise KeyboardInterrupt


def history(run):
    return [(c.id, c.generation, c.index, c.genome, c.seed, c.fitness, c.phenotype) for c in run.candidates]


def carry(path, config, evaluate=bowl, workers=1, until=None):
    run = Run.open(path) if path.exists() else Run.create(path, config)
    run.repair()
    onlooker = SilentWatcher(until)
    with LocalExecutor(evaluate, workers) as executor:
        evolve(run, executor, onlooker)
    return Run.open(path), onlooker


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    run, onlooker = carry(tmp_path_factory.mktemp("whole") / "run", tiny())
    assert onlooker.seen == list(range(12))
    assert onlooker.steps == 12
    return run


def test_run_holds_every_candidate_with_its_seed(whole):
    assert finished(whole)
    assert [c.seed for c in whole.candidates] == [training_seed(0, i) for i in range(12)]
    assert calls(whole.path) == dict.fromkeys(range(12), 1)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("until", [1, 4, 6])
def test_interrupted_run_continues_to_the_same_history(tmp_path, whole, until):
    path = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        carry(path, tiny(), until=until)
    assert len(Run.open(path).candidates) == until
    run, onlooker = carry(path, tiny())
    assert history(run) == history(whole)
    assert onlooker.seen == list(range(until, 12)), "candidates on record are not evaluated again"


def test_history_does_not_depend_on_workers_or_order(tmp_path, whole):
    run, onlooker = carry(tmp_path / "run", tiny(), slow_for_some, workers=2)
    assert onlooker.seen != sorted(onlooker.seen), "the order must be mixed for this test to be valid"
    assert history(run) == history(whole)


def test_failures_do_not_end_a_run(tmp_path):
    run, _ = carry(tmp_path / "run", tiny(), fails_for_some)
    assert finished(run)
    assert sum(c.failure is not None for c in run.candidates) == 6
    assert run.best.id % 2 == 0


def test_other_search_than_the_one_on_record_is_refused(tmp_path):
    path = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        carry(path, tiny(), until=6)
    config = path / "config.toml"
    config.write_text(config.read_text().replace("\nseed = 0", "\nseed = 1"))
    kept = (path / "candidates.jsonl").read_bytes()
    with pytest.raises(RunError, match="cannot be continued: candidate 0 differs from the search's proposal") as caught:
        carry(path, tiny())
    assert "nevergrad 1." in str(caught.value)
    assert (path / "candidates.jsonl").read_bytes() == kept


def test_finished_run_can_be_given_more_generations(tmp_path, whole):
    longer, _ = carry(tmp_path / "run", tiny("search.generations=4"))
    assert history(longer)[:12] == history(whole)


UTILISATION = {8: {"false": 0.67, "true": 0.99}, 16: {"false": 0.46, "true": 0.92}}
STEADY = ("search.steady_state=true", "search.population=4")


@pytest.fixture(scope="module")
def steady(tmp_path_factory):
    return carry(tmp_path_factory.mktemp("steady") / "run", tiny(*STEADY))[0]


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("optimizer", "until"), [("CMA", 4), ("CMA", 7), ("mutation", 4), ("DE", 1), ("DE", 7)])
def test_interrupted_steady_state_continues_to_the_same_history(tmp_path, optimizer, until):
    """One worker finishes candidates in order, so that even the steady state has only one history."""
    config = tiny(*STEADY, f"search.optimizer={optimizer}", "genome.fov_deg.opens_at=1")
    whole, _ = carry(tmp_path / "whole", config)
    with pytest.raises(KeyboardInterrupt):
        carry(tmp_path / "run", config, until=until)
    run, _ = carry(tmp_path / "run", config)
    assert history(run) == history(whole)
    assert max(calls(run.path).values()) <= 2, "only unfinished candidates may start again"


@pytest.mark.slow
def test_steady_state_proposes_from_what_is_known_by_then(tmp_path, steady):
    """The fifth candidate is proposed when the first is done, without waiting for the others and without their
    results.
    """
    assert [c.id for c in steady.in_order_of_finish] == list(range(12))
    by_generations, _ = carry(tmp_path / "run", tiny("search.population=4"))
    assert history(steady)[:4] == history(by_generations)[:4]
    assert history(steady)[4:] != history(by_generations)[4:]
    mixed, onlooker = carry(tmp_path / "mixed", tiny(*STEADY), slow_for_some, workers=2)
    assert onlooker.seen != sorted(onlooker.seen)
    assert [c.id for c in mixed.in_order_of_finish] == onlooker.seen
    resumed, _ = carry(mixed.path, tiny(*STEADY))
    assert history(resumed) == history(mixed)


class Imagined:
    """Simulated workers with simulated time; a candidate's seed determines its duration, which is log-normal."""

    def __init__(self, workers):
        self.workers, self.now, self.busy = workers, 0.0, 0.0

    def run(self, jobs, progress):
        working = []
        while jobs or working:
            while jobs and len(working) < self.workers:
                job = jobs.popleft()
                seconds = float(np.random.default_rng(job.seed).lognormal(0.0, 0.5))
                self.busy += seconds
                heapq.heappush(working, (self.now + seconds, job.id, job))
            self.now, _, job = heapq.heappop(working)
            fitness = -abs(job.phenotype.fov_deg - 70)
            yield job, Evaluation(fitness, (fitness,))

    @property
    def utilisation(self):
        return self.busy / (self.workers * self.now)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [8, 16])
def test_steady_state_keeps_workers_busy_that_would_wait_for_a_generation(tmp_path, workers):
    """Sixteen workers for a generation of sixteen all wait for the slowest. docs/cluster.md has the numbers."""
    found = {}
    for steady in ("false", "true"):
        run = Run.create(
            tmp_path / steady, tiny(f"search.steady_state={steady}", "search.population=16", "search.generations=20")
        )
        executor = Imagined(workers)
        evolve(run, executor, SilentWatcher())
        assert finished(run)
        found[steady] = executor.utilisation
    assert found == pytest.approx(UTILISATION[workers], abs=0.005)
