"""Parts of the search in isolation: phases, optimizers, the null model and records, with values computed by hand."""

import math
import warnings
from collections import deque
from types import SimpleNamespace

import numpy as np
import pytest

from evolve.config.numbering import Place
from evolve.config.run_config import ConfigError, SearchConfig
from evolve.search import null_model, same_search
from evolve.search import search as search_module
from evolve.search.optimizers import Mutation, Named, Space, _array, _quiet
from evolve.search.same_search import LIBRARIES, SameSearch
from evolve.search.search import Proposal, Search, training_seed
from evolve.store.directory import RunError
from tests.evolve.closed_form import tiny

# --- optimizers


def mutation(population):
    """Return a search by mutation of one real gene, whose mutations are the parents' coordinates plus 1."""
    gene = SimpleNamespace(mutated=lambda u, sigma, normal, step, use: u + 1.0)
    return Mutation(Space([(gene, None)], np.zeros(1), (3,)), SearchConfig(population=population))


def test_parents_come_from_the_last_two_populations():
    """A population of 4 has one parent: the fittest of the last eight candidates with known fitness."""
    found = mutation(4)
    parents = []
    for number in range(12):
        parents.append(found.ask(number)[1])
        found.tell(number, -float(number))
    assert parents == [(), *[(0,)] * 8, (1,), (2,), (3,)]


@pytest.mark.parametrize(("population", "parents"), [(2, 1), (7, 1), (8, 2), (20, 5)])
def test_a_quarter_of_a_population_are_parents(population, parents):
    found = mutation(population)
    for number in range(population):
        found.ask(number)
    for number in reversed(range(population)):
        found.tell(number, 1.0)
    drawn = {found.ask(100 + k)[1] for k in range(60)}
    assert drawn == {(k,) for k in range(parents)}, "of candidates with equal fitness, the lower id has priority"


class Library:
    """Stand-in for an optimizer of nevergrad."""

    def __init__(self, array=None, budget=None, num_workers=None):
        self.given, self.received = (budget, num_workers), []
        self.candidates = deque(
            [
                SimpleNamespace(uid="a", value=np.array([0.25, 9.0]), parents_uids=[]),
                SimpleNamespace(uid="b", value=np.array([-0.5, 9.0]), parents_uids=["foreign", "a"]),
                SimpleNamespace(uid="c", value=np.array([1.5, 9.0]), parents_uids=["b", "a"]),
            ]
        )

    def ask(self):
        return self.candidates.popleft()

    def tell(self, candidate, loss):
        self.received.append((candidate.uid, loss))


def test_candidates_of_other_optimizers(monkeypatch):
    """Coordinates are clipped to [0, 1], padding is ignored, and parents from other sources are omitted."""
    from nevergrad.optimization.optimizerlib import registry

    monkeypatch.setitem(registry, "Library", Library)
    search = SearchConfig(population=6, generations=5, optimizer="Library")
    found = Named(Space([], np.array([0.5]), (3,)), search)
    assert found._optimizer.given == (30, 6)
    assert [found.ask(number) for number in (8, 7, 9)] == [([0.25], ()), ([0.0], (8,)), ([1.0], (7, 8))]
    found.tell(7, 2.5)
    assert found._optimizer.received == [("b", -2.5)], "nevergrad minimises"


@pytest.mark.parametrize(("name", "hint"), [("CMAA", "did you mean 'CMA'?"), ("####", "see nevergrad's list of")])
def test_unknown_names_of_optimizers(name, hint):
    with pytest.raises(ConfigError) as caught:
        Named(Space([], np.array([0.5]), (3,)), SearchConfig(optimizer=name))
    assert hint in str(caught.value)


def test_coordinates_are_bounded_and_a_single_one_is_padded():
    for start, padded in (([0.25], [0.25, 0.5]), ([0.25, 0.75], [0.25, 0.75])):
        array = _array(Space([], np.array(start), (3, 4)), 0.1)
        assert array.value.tolist() == padded
        assert [bound.tolist() for bound in array.bounds] == [[0.0], [1.0]]
        state = np.random.RandomState(np.random.SeedSequence([3, 4]).generate_state(4))
        assert array.random_state.randint(2**31) == state.randint(2**31), "a run can be continued by later versions"


def test_warnings_of_nevergrad_are_suppressed():
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        with _quiet():
            for module in ("nevergrad.optimization", "other"):
                warnings.warn_explicit(f"of {module}", UserWarning, "file.py", 1, module=module)
    assert [str(warning.message) for warning in shown] == ["of other"]


# --- search


class Optimizer:
    """Stand-in for an optimizer, which proposes the start and records the fitness that it receives."""

    def __init__(self, space):
        self.space, self.told = space, []

    def ask(self, candidate_id):
        return self.space.start + 0.01 * (candidate_id + 1), ()

    def tell(self, candidate_id, fitness):
        self.told.append((candidate_id, fitness))


@pytest.fixture
def built(monkeypatch):
    """Return the list of optimizers that searches build."""
    found = []
    monkeypatch.setattr(
        search_module, "build_optimizer", lambda space, search: found.append(Optimizer(space)) or found[-1]
    )
    return found


def test_failures_before_any_success_have_a_fitness_below_all_returns(built):
    """A later failure has the lowest fitness so far."""
    search = Search(tiny())
    search.propose_generation()
    for number, value in ((0, -math.inf), (1, -5.0), (2, -7.0), (3, -math.inf)):
        search.tell([(number, value)])
    assert built[0].told == [(0, -1e9), (1, -5.0), (2, -7.0), (3, -7.0)]


def test_each_phase_has_its_optimizer_which_starts_from_the_best_genome(built):
    """The first of two equal candidates is the best."""
    search = Search(tiny("genome.fov_deg.opens_at=1", "search.generations=3", "seed=6"))
    assert search.proposed == 0
    first = search.propose_generation()
    assert search.proposed == 4
    search.tell([(p.id, float(p.id in (1, 2))) for p in first])
    second = search.propose_generation()
    assert [one.space.seed for one in built] == [(6,), (6, 1)]
    assert [len(one.space.genes) for one in built] == [built[1].space.start.size - 1, built[1].space.start.size]
    np.testing.assert_array_equal(built[1].space.start, first[1].vector)
    assert {proposal.parents for proposal in second} == {(1,)}
    search.tell([(p.id, 0.5) for p in second])
    search.propose_generation()
    assert len(built) == 2, "the third generation belongs to the second phase"
    assert built[1].told == [(p.id, 0.5) for p in second]


def test_seeds_of_trainings_are_those_of_earlier_versions():
    """NumPy guarantees the numbers of SeedSequence. Records contain them."""
    assert [training_seed(0, 0), training_seed(3, 5)] == [2968811710, 3746004709]


# --- null model


def test_searches_of_the_null_model_have_consecutive_seeds(monkeypatch):
    seeds = []

    def one_search(config, measure, generations, spread):
        seeds.append(config.seed)
        return {"x": ([1.0], [2])}

    monkeypatch.setattr(null_model, "_search", one_search)
    null_model.null_model(tiny("seed=3"), None, 1, 3)
    assert seeds == [10_000, 10_001, 10_002]


def test_a_generation_may_have_one_candidate(monkeypatch):
    monkeypatch.setattr(null_model, "_proposals", lambda *_: [[SimpleNamespace(vector=None)]])
    monkeypatch.setattr(null_model, "develop", lambda vector, config: None)
    assert null_model._search(None, lambda animal: {"x": 4.0}, 1, []) == {"x": ([4.0], [1])}


class Proposals:
    """Stand-in for a search, which counts proposals and records the fitness that it receives."""

    made = None

    def __init__(self, config):
        self.population, self.proposed, self.told = config.search.population, 0, []
        Proposals.made = self

    def propose(self):
        self.proposed += 1
        return SimpleNamespace(
            id=self.proposed - 1, vector=None, place=Place.from_id(self.proposed - 1, self.population)
        )

    def propose_generation(self):
        return [self.propose() for _ in range(self.population)]

    def tell(self, fitness):
        self.told += fitness


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("steady", [True, False])
def test_random_fitness_has_the_spread_of_its_generation_minus_costs(monkeypatch, free, steady):
    """No candidate is proposed beyond the last generation, and fitness is received in the order of the proposals."""
    monkeypatch.setattr(null_model, "Search", Proposals)
    monkeypatch.setattr(null_model, "develop", lambda vector, config: "animal")
    costs = SimpleNamespace(free=free, total=lambda animal, eye: 100.0)
    config = SimpleNamespace(seed=5, costs=costs, eye=None, search=SimpleNamespace(steady_state=steady, population=3))
    found = [[proposal.id for proposal in each] for each in null_model._proposals(config, 2, [2.0, 4.0])]
    assert found == [[0, 1, 2], [3, 4, 5]]
    assert Proposals.made.proposed == 6
    numbers = np.random.default_rng(5).normal(size=6)
    expected = numbers if free else numbers * np.repeat([2.0, 4.0], 3) - 100
    count = 3 if steady else 6
    assert [number for number, _ in Proposals.made.told] == list(range(count))
    np.testing.assert_allclose([value for _, value in Proposals.made.told], expected[:count])


def test_p_values_of_several_runs_can_be_reproduced():
    """The mean of three runs is compared with the same 20,000 random groups of three searches each time."""
    ends = np.arange(8.0)
    groups = np.random.default_rng(0).choice(ends, (20_000, 3)).mean(axis=1)
    values = [6.0, 5.5, 5.0]
    assert null_model.p_value(values, ends) == pytest.approx(2 * ((groups >= 5.5).mean() * 8 + 1) / 9, rel=1e-12)


@pytest.mark.parametrize(("off", "equal"), [(0.9e-5, True), (1.1e-5, False), (1.9e-5, False)])
def test_means_that_differ_by_rounding_are_equal(off, equal):
    ends = np.array([2.0, 3.0, 4.0, 5.0])
    p = 2 * (1 + 1) / 5
    assert null_model.p_value([5.0 * (1 + off)], ends) == pytest.approx(p if equal else 2 / 5)
    assert null_model.p_value([2.0 * (1 - off)], ends) == pytest.approx(p if equal else 2 / 5)


# --- the same search


def record(monkeypatch, **then):
    """Return the check of a record that was written with these versions instead of the present ones."""
    present = dict.fromkeys(LIBRARIES, "2")
    monkeypatch.setattr(same_search, "present", lambda: present)
    monkeypatch.setattr(same_search, "recorded", lambda path: {**present, **then})
    return SameSearch(SimpleNamespace(path="run", candidates=[]))


def accepts(same, generation, *off):
    candidate = SimpleNamespace(id=7, generation=generation, vector=np.zeros(len(off)))
    try:
        same.require(Proposal(Place(7, generation, 0), off, ()), candidate)
    except RunError:
        return False
    return True


@pytest.mark.parametrize(("generation", "tolerance"), [(0, 1e-9), (1, 0.02), (2, 0.02)])
def test_differences_up_to_the_tolerance_are_accepted(monkeypatch, generation, tolerance):
    same = record(monkeypatch)
    assert accepts(same, generation, 0.0, tolerance)
    assert accepts(same, generation, -tolerance, 0.0)
    assert not accepts(same, generation, 0.0, 1.1 * tolerance)
    assert not accepts(same, generation, 1.1 * tolerance, 0.0)


@pytest.mark.parametrize("library", LIBRARIES)
def test_another_version_of_one_library_makes_the_check_strict(monkeypatch, library):
    same = record(monkeypatch, **{library: "1"})
    assert accepts(same, 1, 1e-9)
    assert not accepts(same, 1, 1e-3)
    with pytest.raises(RunError) as caught:
        same.require(None, SimpleNamespace(id=7, generation=1))
    then = ", ".join(f"{name} {'1' if name == library else '2'}" for name in LIBRARIES)
    assert f"(started with {then}; here nevergrad 2, cma 2, numpy 2)" in str(caught.value)


@pytest.mark.parametrize(("generations", "lacks"), [((0, 1), True), ((0, 0), False), ((1, 1), True), ((), False)])
def test_later_generations_on_record_require_complete_ones(monkeypatch, generations, lacks):
    same = record(monkeypatch)
    same._run.candidates = [SimpleNamespace(generation=generation) for generation in generations]
    same.require_complete(0, [])
    if not lacks:
        same.require_complete(0, [5, 3])
        return
    with pytest.raises(RunError, match=r"generation 0 lacks evaluations \(candidate 3\)"):
        same.require_complete(0, [5, 3])
