"""Descent follows the parents on record, and the nearest one if there are several."""

from dataclasses import replace

from evolve.analysis.genealogy import descent, nearest_parent
from evolve.analysis.statistics import champions
from evolve.store.candidate import Candidate
from tests.evolve.small_run import PHENOTYPE


def candidate(identity, genome, parents=(), fitness=0.0, failure=None):
    place = (identity, identity // 3, identity % 3)
    return Candidate(*place, genome, PHENOTYPE, 0, fitness, (fitness,), 0.0, 1, 1.0, (), failure, parents)


FAMILY = [
    candidate(0, (0.1, 0.1), fitness=1.0),
    candidate(1, (0.9, 0.9), fitness=3.0),
    candidate(2, (0.5, 0.5), fitness=2.0),
    candidate(3, (0.15, 0.1), (0, 1), fitness=2.5),
    candidate(4, (0.8, 0.9), (0, 1), fitness=9.0, failure="no luck"),
    candidate(5, (0.5, 0.5), (0, 1), fitness=1.0),
    candidate(6, (0.2, 0.1), (3, 4), fitness=7.0),
    candidate(7, (0.2, 0.1), (99,)),
]
KNOWN = {member.id: member for member in FAMILY}


def test_nearest_parent_is_the_nearest_genome_and_the_earliest_of_equals():
    assert nearest_parent(FAMILY[3], KNOWN).id == 0
    assert nearest_parent(FAMILY[4], KNOWN).id == 1
    assert nearest_parent(FAMILY[5], KNOWN).id in (0, 1)
    assert nearest_parent(FAMILY[0], KNOWN) is None
    assert nearest_parent(FAMILY[7], KNOWN) is None, "parents that are not on record are ignored"


def test_line_of_descent_begins_where_nobody_came_before():
    assert [member.id for member in descent(FAMILY[6], FAMILY)] == [0, 3, 6]
    assert [member.id for member in descent(FAMILY[2], FAMILY)] == [2]
    itself = replace(FAMILY[0], parents=(0,))
    assert descent(itself, [itself]) == [itself], "a damaged record must not cause an endless loop"


def test_champions_are_the_best_so_far_and_never_a_failure():
    assert [(generation, best.id) for generation, best in champions(FAMILY)] == [(0, 1), (1, 1), (2, 6)]
    assert champions(FAMILY[4:5]) == []
