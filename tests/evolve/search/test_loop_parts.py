"""Parts of the main loop, with stand-ins for the search, the executor and the record."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from evolve.config.numbering import Place
from evolve.learning.training_rung import TrainingRung
from evolve.search import loop
from evolve.search.job import Job
from evolve.search.search import Proposal
from evolve.store.candidate import Candidate
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny
from tests.evolve.small_run import PHENOTYPE


def proposal(number, population=4):
    return Proposal(Place.from_id(number, population), (0.25, number / 100), (7,))


class Record:
    """Stand-in for a run that stores candidates in a list."""

    def __init__(self, *settings):
        self.config, self.lines, self.forgotten = tiny(*settings), [], []

    @property
    def in_order_of_finish(self):
        return tuple(self.lines)

    def generation(self, number):
        latest = {one.id: one for one in self.lines if one.generation == number}
        return [latest[number] for number in sorted(latest)]

    def evaluated_at(self, rung):
        return {one.id for one in self.lines if one.rung == rung}

    def on_record(self, number, rung):
        return next((one for one in self.lines if (one.id, one.rung) == (number, rung)), None)

    def checkpoint_path(self, number, rung):
        return f"checkpoint {number} {rung}"

    def policy_path(self, number):
        return f"policy {number}"

    def forget_trainings(self, ids):
        self.forgotten.append(sorted(ids))

    def append(self, candidate):
        self.lines.append(candidate)


@pytest.fixture(autouse=True)
def digests(monkeypatch):
    monkeypatch.setattr(loop, "digest", lambda path: f"digest of {path}")
    monkeypatch.setattr(loop, "develop", lambda vector, config: replace(PHENOTYPE, fov_deg=45 + vector[1]))


class Unchecked:
    """Stand-in for the comparison with the record, which stores what it is asked."""

    def __init__(self, run):
        self.asked = run.asked = []

    def require(self, proposal, candidate):
        self.asked.append((None if proposal is None else proposal.id, candidate.id))

    def require_complete(self, generation, missing):
        self.asked.append((generation, list(missing)))


class Search:
    """Stand-in for a search, which records the fitness that it receives."""

    def __init__(self, config):
        self.population, self.proposed, self.told = config.search.population, 0, []

    def propose(self):
        self.proposed += 1
        return proposal(self.proposed - 1, self.population)

    def propose_generation(self):
        return [self.propose() for _ in range(self.population)]

    def tell(self, fitness):
        self.told.append(fitness)


class Executor:
    """Stand-in for an executor with fitness 10 minus the id, which evaluates the last job first."""

    def __init__(self, last_first=False):
        self.last_first, self.started = last_first, []

    def run(self, jobs, progress):
        assert progress == "training"
        while jobs:
            job = jobs.pop() if self.last_first else jobs.popleft()
            self.started.append((job.id, job.rung and job.rung.number))
            yield job, Evaluation(10.0 - job.id, (10.0 - job.id,), seconds=1.0)


def watcher():
    seen = []
    return SimpleNamespace(training="training", evaluated=lambda one: seen.append(one.id), seen=seen)


def test_a_generation_is_reported_after_all_its_rungs(monkeypatch):
    """The better half continues to the second rung. Candidates on record are compared with the proposals."""
    monkeypatch.setattr(loop, "SameSearch", Unchecked)
    monkeypatch.setattr(TrainingRung, "set_aside_unusable", lambda *_: None)
    run = Record("search.rungs=2", "search.generations=2", "learning.total_steps=16384")
    executor, search, seen = Executor(last_first=True), Search(run.config), watcher()
    loop._by_generations(run, search, executor, seen)
    assert executor.started == [
        *((k, 0) for k in (3, 2, 1, 0)),
        (1, 1),
        (0, 1),
        *((k, 0) for k in (7, 6, 5, 4)),
        (5, 1),
        (4, 1),
    ]
    assert seen.seen == [number for number, _ in executor.started]
    assert search.told == [[(k, 10.0 - k) for k in first] for first in (range(4), range(4, 8))]
    assert run.forgotten == [[0, 1, 2, 3], [4, 5, 6, 7]]
    assert run.asked == [(0, [0, 1, 2, 3]), (0, [0, 1]), (1, [4, 5, 6, 7]), (1, [4, 5])]
    again, search = Executor(), Search(run.config)
    loop._by_generations(run, search, again, seen)
    assert again.started == []
    assert run.asked == [
        *((k, k) for k in range(4)), (0, []), (0, []), *((k, k) for k in range(4, 8)), (1, []), (1, [])
    ]  # fmt: skip


@pytest.mark.parametrize("steady", [True, False])
def test_the_mode_follows_the_settings(monkeypatch, steady):
    called = []
    monkeypatch.setattr(loop, "Search", lambda config: "search")
    for name in ("_steadily", "_by_generations"):
        monkeypatch.setattr(loop, name, lambda *given, name=name: called.append((name, *given)))
    run = Record(f"search.steady_state={str(steady).lower()}")
    loop.evolve(run, "executor", "watcher")
    assert called == [("_steadily" if steady else "_by_generations", run, "search", "executor", "watcher")]


def test_the_steady_state_replaces_each_finished_candidate(monkeypatch):
    """Two candidates are on record: the second and the first one. At most four are in evaluation, and twelve in all."""
    monkeypatch.setattr(loop, "SameSearch", Unchecked)
    run = Record("search.steady_state=true")
    run.lines = [SimpleNamespace(id=number, fitness=-float(number)) for number in (1, 0)]
    executor, search, seen = Executor(), Search(run.config), watcher()
    proposed = []
    monkeypatch.setattr(executor, "run", lambda jobs, progress: watched(jobs, progress))

    def watched(jobs, progress):
        assert [job.id for job in jobs] == [2, 3, 4, 5]
        for outcome in Executor.run(executor, jobs, progress):
            yield outcome
            proposed.append(search.proposed)

    loop._steadily(run, search, executor, seen)
    assert run.asked == [(1, 1), (0, 0)]
    assert seen.seen == list(range(2, 12))
    assert search.told == [[(1, -1.0)], [(0, 0.0)], *([(k, 10.0 - k)] for k in range(2, 12))]
    assert proposed == [7, 8, 9, 10, 11, 12, 12, 12, 12, 12]


def test_a_job_without_rungs():
    job = loop._job(Record(), proposal(5))
    assert (job.id, job.policy_path, job.rung) == (5, "policy 5", None)
    assert job.phenotype.fov_deg == 45.05
    assert job.seed == loop.training_seed(0, 5)
    assert job.arguments == (job.phenotype, job.config, job.seed, "policy 5")


@pytest.mark.parametrize(("rung", "ends"), [(0, (4096,)), (1, (4096, 8192)), (2, (4096, 8192, 16384))])
def test_a_job_of_a_rung_has_the_checkpoints_up_to_it(monkeypatch, rung, ends):
    """Unusable checkpoints are set aside before the job starts."""
    asked = []
    monkeypatch.setattr(TrainingRung, "set_aside_unusable", lambda own, *given: asked.append((own, *given)))
    run = Record("search.rungs=3", "learning.total_steps=16384")
    job = loop._job(run, proposal(5), rung)
    assert job.rung == TrainingRung(ends, tuple(f"checkpoint 5 {k}" for k in range(rung + 1)), 5)
    assert asked == [(job.rung, job.phenotype, run.config, job.seed)]
    assert job.arguments[4:] == (job.rung,)
    assert loop._job(run, proposal(5)).rung.number == 0


def written(run, outcome, rung=None):
    job = Job(5, PHENOTYPE, run.config, 3, "path", rung)
    seen = watcher()
    found = loop._record(run, proposal(5), job, outcome, seen)
    assert run.lines[-1] is found
    assert seen.seen == [5]
    return found


def test_a_candidate_is_written_with_its_costs_and_its_policy():
    run = Record("costs.per_eye=2")
    found = written(run, Evaluation(2.5, (2.0, 3.0), 0.5, 40, 0.25, ((20, 1.0),)))
    assert (found.id, found.generation, found.index, found.rung) == (5, 1, 1, 0)
    assert (found.genome, found.parents, found.seed) == ((0.25, 0.05), (7,), 3)
    assert (found.costs, found.fitness, found.policy) == (4.0, -1.5, "digest of path")
    failed = written(run, Evaluation.failed("it fell", 0.5))
    assert (failed.policy, failed.failure) == (None, "it fell")


@pytest.mark.parametrize("fails", [False, True])
def test_a_later_rung_continues_the_former_line(fails):
    """Seconds and failures of episodes are summed. Steps and curve of the former rung are kept if training fails."""
    run = Record("search.rungs=2", "learning.total_steps=16384")
    first = TrainingRung((8,), ("a",), 5)
    before = written(run, Evaluation(1.0, (1.0,), 0.5, 8, 0.25, ((8, 1.0),), episode_failures=(("fell", 2),)), first)
    assert (before.rung, before.seconds) == (0, 0.25)
    outcome = Evaluation(3.0, (3.0,), 0.5, 16, 0.5, ((8, 1.0), (16, 3.0)), episode_failures=(("fell", 1),))
    outcome = Evaluation.failed("broken", 0.5) if fails else outcome
    after = written(run, outcome, TrainingRung((8, 16), ("a", "b"), 5))
    assert (after.rung, after.seconds) == (1, 0.75)
    assert (after.steps, after.curve) == ((8, before.curve) if fails else (16, ((8, 1.0), (16, 3.0))))
    assert after.episode_failures == (("fell", 2 if fails else 3),)
    assert isinstance(after, Candidate)
