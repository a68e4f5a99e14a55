"""The loop: same history in one go, interrupted anywhere, and with any number of workers."""

import pytest
from closed_form import bowl, calls, fails_for_some, slow_for_some, tiny

from evolve.executors import LocalExecutor
from evolve.loop import evolve
from evolve.search import training_seed
from evolve.store import Run, RunError


class Onlooker:
    """Watches; interrupts after a number of candidates."""

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
    onlooker = Onlooker(until)
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
    assert whole.finished
    assert [c.seed for c in whole.candidates] == [training_seed(0, i) for i in range(12)]
    assert calls(whole.path) == dict.fromkeys(range(12), 1)


@pytest.mark.parametrize("until", [1, 4, 6])
def test_interrupted_run_continues_to_the_same_history(tmp_path, whole, until):
    path = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        carry(path, tiny(), until=until)
    assert len(Run.open(path).candidates) == until
    run, onlooker = carry(path, tiny())
    assert history(run) == history(whole)
    assert onlooker.seen == list(range(until, 12)), "none on record is evaluated again"


def test_history_does_not_depend_on_workers_or_order(tmp_path, whole):
    run, onlooker = carry(tmp_path / "run", tiny(), slow_for_some, workers=2)
    assert onlooker.seen != sorted(onlooker.seen), "the test must mix the order to show anything"
    assert history(run) == history(whole)


def test_failures_do_not_end_a_run(tmp_path):
    run, _ = carry(tmp_path / "run", tiny(), fails_for_some)
    assert run.finished
    assert sum(c.failure is not None for c in run.candidates) == 6
    assert run.best.id % 2 == 0


def test_other_search_than_the_one_on_record_is_refused(tmp_path):
    path = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        carry(path, tiny(), until=6)
    config = path / "config.toml"
    config.write_text(config.read_text().replace("seed = 0", "seed = 1"))
    kept = (path / "candidates.jsonl").read_bytes()
    with pytest.raises(RunError, match="cannot be continued: candidate 0 is not what the search proposes") as caught:
        carry(path, tiny())
    assert "nevergrad 1." in str(caught.value)
    assert (path / "candidates.jsonl").read_bytes() == kept


def test_finished_run_can_be_given_more_generations(tmp_path, whole):
    longer, _ = carry(tmp_path / "run", tiny("search.generations=4"))
    assert history(longer)[:12] == history(whole)
