"""The loop: same history in one go, interrupted anywhere, and with any number of workers."""

import numpy as np
import pytest
from closed_form import bowl, calls, fails_for_some, slow_for_some, takes_its_time, tiny

from evolve.ancestor import starts_from
from evolve.config import ConfigError
from evolve.config_source import assemble
from evolve.development import develop
from evolve.executors import Job, LocalExecutor
from evolve.genotype import Genotype
from evolve.loop import evolve
from evolve.progress import Tally
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


def job_arguments(run):
    genome = np.full(Genotype(run.config.genome).dimension, 0.5)
    return develop(genome, run.config), run.config, 0, run.policy_path(0)


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


STEADY = ("search.steady_state=true", "search.population=4")


@pytest.fixture(scope="module")
def steady(tmp_path_factory):
    return carry(tmp_path_factory.mktemp("steady") / "run", tiny(*STEADY))[0]


@pytest.mark.parametrize("until", [1, 4, 7])
@pytest.mark.parametrize("optimizer", ["CMA", "mutation", "DE"])
def test_interrupted_steady_state_continues_to_the_same_history(tmp_path, optimizer, until):
    """One worker finishes candidates in their order, so even the steady state has only one history."""
    config = tiny(*STEADY, f"search.optimizer={optimizer}", "genome.fov_deg.opens_at=1")
    whole, _ = carry(tmp_path / "whole", config)
    with pytest.raises(KeyboardInterrupt):
        carry(tmp_path / "run", config, until=until)
    run, _ = carry(tmp_path / "run", config)
    assert history(run) == history(whole)
    assert max(calls(run.path).values()) <= 2, "only those under way may be begun again"


def test_steady_state_proposes_from_what_is_known_by_then(tmp_path, steady):
    """The fifth candidate is proposed when the first is done, so it cannot know of the others; nor does it wait."""
    assert [c.id for c in steady.in_order_of_finish] == list(range(12))
    by_generations, _ = carry(tmp_path / "run", tiny("search.population=4"))
    assert history(steady)[:4] == history(by_generations)[:4]
    assert history(steady)[4:] != history(by_generations)[4:]
    mixed, onlooker = carry(tmp_path / "mixed", tiny(*STEADY), slow_for_some, workers=2)
    assert onlooker.seen != sorted(onlooker.seen)
    assert [c.id for c in mixed.in_order_of_finish] == onlooker.seen
    resumed, _ = carry(mixed.path, tiny(*STEADY))
    assert history(resumed) == history(mixed)


def test_steady_state_keeps_workers_busy_that_would_wait_for_a_generation(tmp_path):
    """Some candidates take four times as long, and all of a generation waits for the last."""
    busy = {}
    for name in ("true", "false"):
        config = tiny(f"search.steady_state={name}", "search.generations=4")
        run = Run.create(tmp_path / name, config)
        with LocalExecutor(takes_its_time, 3) as executor:
            list(executor.run([Job(100 + i, *job_arguments(run)) for i in range(3)]))  # workers are there
            tally = Tally(run, 3)
            onlooker = Onlooker()
            onlooker.evaluated = tally.evaluated
            evolve(run, executor, onlooker)
            busy[name] = tally.utilisation
    assert busy["true"] > busy["false"] + 0.1, busy


def test_animals_start_from_one_of_another_run(tmp_path, whole):
    starts = starts_from(f"{whole.path}:7")
    ancestor = whole.candidate(7).phenotype
    config = assemble("detection", assignments=["search.population=2"], starts=starts)
    assert develop(Genotype(config.genome).start, config) == ancestor
    assert starts_from(str(whole.path)).name == f"--from {whole.path}:{whole.best.id}"
    with pytest.raises(RunError, match="there is no candidate 99; 12 have been evaluated"):
        starts_from(f"{whole.path}:99")
    fov = ancestor.fov_deg
    narrow = [f"genome.fov_deg.high={fov / 2}"]
    with pytest.raises(ConfigError, match=rf"genome\.fov_deg\.start = .*--from {whole.path}:7"):
        assemble("detection", assignments=narrow, starts=starts)
    wins = assemble("detection", assignments=[f"genome.fov_deg.start={fov / 2}"], starts=starts)
    assert wins.genome["fov_deg"].start == fov / 2
