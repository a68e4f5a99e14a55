"""Numbers of candidates: ids, generations and indices are consistent."""

import pytest

from evolve.config.numbering import Place, generation_ids


@pytest.mark.parametrize("population", [2, 7])
def test_generations_follow_each_other_and_places_count_within_them(population):
    ids = [i for generation in range(4) for i in generation_ids(generation, population)]
    assert ids == list(range(4 * population))
    for generation in range(4):
        places = [Place.from_id(i, population) for i in generation_ids(generation, population)]
        assert [place.generation for place in places] == [generation] * population
        assert [place.index for place in places] == list(range(population))
