"""The page starts with the animal: its description, its replay, its head and eyes, and the first animal next to the
best.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

import sim
from evolve.analysis.statistics import champions
from evolve.config.run_config import RunConfig
from evolve.learning.animal_task import azimuths
from evolve.report import lineup as cards
from evolve.report.agent_figure import agent_figure
from evolve.report.markup import duration
from evolve.store.candidate import Candidate
from evolve.store.evaluation import Evaluation
from tests.evolve.learning.test_task_module import BALL, small, written
from tests.evolve.report.reported import BEST


def polygons(drawn, kind):
    """Return the points of polygons; `kind` is the markup before the points."""
    return [
        np.array([[float(v) for v in point.split(",")] for point in found.split()])
        for found in re.findall(rf'{kind} points="([^"]+)"', drawn.markup)
    ]


def area(points):
    x, y = points.T
    return abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2


def test_the_replay_comes_first_and_numbers_later(content, page):
    order = re.findall(r'<section id="(\w+)">', content)
    assert order[:3] == ["episode", "animals", "best"]
    assert order.index("numbers") > 2
    links = re.findall(r'<a href="#(\w+)">', content[content.index("<nav") : content.index("</nav>")])
    assert links == order
    assert "Candidate 3, the best of 6, has 2 eyes of 4 × 5 receptors" in " ".join(page.texts["all"].split())


def test_first_and_best_are_the_records(run, content):
    expected = [(str(generation), str(candidate.id)) for generation, candidate in champions(run.candidates)]
    found = re.findall(r'data-generation="(\d+)">.*?<dt>candidate</dt><dd>(\d+)</dd>', content, re.DOTALL)
    assert found == [expected[0], *expected]
    assert found[-1][1] == str(BEST)


def test_the_first_animal_is_of_the_first_generation_that_has_one(run, content):
    assert "<h4>Generation 0’s best</h4>" in content
    failed = Evaluation.failed("no luck")
    fell = {c.id: Candidate.from_evaluation(c.place, c.genome, c.phenotype, c.seed, failed) for c in run.generation(0)}
    late = replace(run, record=replace(run.record, candidates=tuple(fell.get(c.id, c) for c in run.candidates)))
    shown = cards.lineup(late).markup
    assert "<h4>Generation 1’s best, the first to succeed</h4>" in shown
    assert "first generation" not in shown


def test_a_long_run_shows_its_first_and_its_last(run):
    best = champions(run.candidates)
    long = [(number, best[0][1]) for number in range(1000)]
    thinned = cards._thinned(long)
    assert len(thinned) == cards.MOST
    assert (thinned[0][0], thinned[-1][0]) == (0, 999)
    assert cards._thinned(best) == best


@pytest.mark.parametrize("n_eyes", [1, 2, 8])
def test_every_eye_is_drawn_with_its_field(n_eyes):
    eyes = sim.Eyes(n_eyes=n_eyes, resolution=(4, 4), fov_deg=30, placement_range_deg=90)
    drawn = agent_figure(eyes, "it", eyes.azimuths())
    fields, disks = polygons(drawn, "<polygon"), polygons(drawn, 'class="eye"')
    assert len(fields) == len(disks) == n_eyes
    wide = agent_figure(replace(eyes, fov_deg=60), "it", eyes.azimuths())
    for narrow, wider in zip(fields, polygons(wide, "<polygon"), strict=True):
        assert 1.5 < area(wider) / area(narrow) < 2.5


def test_eyes_in_front_hide_those_behind():
    """Eyes are all around the head. Eyes on the far side are drawn before the head, which covers them."""
    eyes = sim.Eyes(n_eyes=8, resolution=(1, 1), fov_deg=20, placement_range_deg=180)
    drawn = agent_figure(eyes, "it", eyes.azimuths())
    before, after = drawn.markup.split("<circle r=")
    assert before.count('class="eye"') > 0
    assert after.count('class="eye"') > before.count('class="eye"'), "the animal faces the reader"


def test_the_family_tree_leads_to_the_table(run, content):
    targets = set(re.findall(r'xlink:href="#(candidate-\d+)"', content))
    assert targets == {f"candidate-{c.id}" for c in run.candidates if c.failure is None}
    assert {f'<tr id="{name}"' in content or f' id="{name}">' in content for name in targets} == {True}


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.4, "0.40 s"), (90, "90 s"), (179, "3.0 min"), (7199, "120 min"), (9e4, "25 h"), (2e6, "23 days")],
)
def test_durations_are_said_as_people_say_them(seconds, said):
    assert duration(seconds) == said


def test_eyes_are_drawn_where_a_task_of_ones_own_has_them(tmp_path):
    """A task's `place` method puts the eyes at the sides and behind. `fan`, the default, is the same as for built-in
    tasks.
    """
    eyes_at = "[sim.Mount('cart', a, offset=(9, 0, 9)) for a in (90, -170)]"
    place = f"    def place(self, n, *where):\n        return {eyes_at}\n\n"
    drawn = []
    for named in (f"{BALL}:FindBall", written(tmp_path, "    def succeeded", f"{place}    def succeeded")):
        config, animal = small("genome.n_eyes.start=2", named=named)
        found, eyes = azimuths(animal, config), animal.eyes(config.eye)
        drawn.append(polygons(agent_figure(eyes, "a", found), 'class="eye"'))
        if not drawn[1:]:
            np.testing.assert_allclose(found, eyes.azimuths(), atol=1e-9)
            np.testing.assert_allclose(
                drawn[0], polygons(agent_figure(eyes, "a", eyes.azimuths()), 'class="eye"'), atol=0.11
            )
    assert found == pytest.approx(np.radians([90, -170]))
    lone = polygons(agent_figure(replace(eyes, n_eyes=1), "a", [np.pi / 2]), 'class="eye"')
    assert any(np.allclose(lone[0], one, atol=0.11) for one in drawn[1])
    built_in = RunConfig("detection")
    np.testing.assert_array_equal(azimuths(animal, built_in), animal.eyes(built_in.eye).azimuths())


def test_eyes_that_are_close_are_drawn_small():
    eyes = sim.Eyes(n_eyes=3)
    wide, close = (
        area(polygons(agent_figure(eyes, "a", placed), 'class="eye"')[0]) for placed in ([0, 2, 4], [0, 0.2, 4])
    )
    assert close < wide / 4
