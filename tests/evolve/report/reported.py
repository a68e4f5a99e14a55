"""A run for reports, and a browser's view of its page."""

import base64
import io
import json
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
from matplotlib.image import imread

from evolve.config.numbering import Place
from evolve.config.run_config import EyeConfig, RunConfig, SearchConfig
from evolve.genome.genotype import Genotype
from evolve.learning.fitness import evaluate
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.small_run import LEARNING, PHENOTYPE

HOSTILE = "</td></table><script>alert('x')</script><img src=http://evil.example/x> & \"quoted\""
SEEING = replace(
    PHENOTYPE,
    relative_aperture=0.3,
    relief=(0.2, 0.5, 0.5, 0.2, 0.5, 0.8, 0.8, 0.5, 0.5, 0.8, 0.8, 0.5, 0.2, 0.5, 0.5, 0.2),
    refractive_index=1.5,
)
FITNESS = (-12.5, 3.25, None, 41.75, -0.5, 7.0)  # None: failed
BEST = 3
VOID = {"meta", "input", "br", "img", "link"}


class Page(HTMLParser):
    """A browser's view of a page, as far as these tests need it."""

    def __init__(self, content):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.attributes, self.ids = [], Counter(), [], []
        self.rows, self.texts = {}, {}
        self._table = self._cell = None
        self.feed(content)
        self.close()
        assert not self.open, f"left open: {self.open}"

    def handle_starttag(self, tag, attributes):
        self.tags[tag] += 1
        self.attributes += [(tag, name, value or "") for name, value in attributes]
        self.ids += [value for name, value in attributes if name == "id"]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self._table = self.rows.setdefault(dict(attributes)["id"], [])
        elif tag == "tr":
            self._table.append([])
        elif tag in ("td", "th"):
            self._table[-1].append("")
        elif tag == "section":
            self._section = dict(attributes)["id"]

    def handle_startendtag(self, tag, attributes):
        self.ids += [value for name, value in attributes if name == "id"]
        self.attributes += [(tag, name, value or "") for name, value in attributes]

    def handle_endtag(self, tag):
        assert self.open[-1:] == [tag], f"</{tag}> closes another element"
        self.open.pop()

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.texts["all"] = self.texts.get("all", "") + data
        if {"td", "th"} & set(self.open):
            self._table[-1][-1] += data


def make_run(path, fitness=FITNESS, failure=HOSTILE):
    """Create a run of two generations of three candidates. All values except the fitness and some traits come from one
    candidate with real training.
    """
    config = RunConfig(
        "detection", eye=EyeConfig(rays_per_receptor=1), search=SearchConfig(3, 2, 0.2), learning=LEARNING
    )
    run = Run.create(path, config)
    trained = evaluate(SEEING, config, 5, run.policy_path(BEST))
    genome = tuple(Genotype(config.genome).start.tolist())
    for i, value in enumerate(fitness):
        outcome = Evaluation.failed(failure, 2.0)
        if value is not None:
            outcome = replace(trained, fitness=value, returns=(value - 1, value + 1), seconds=90.0)
        phenotype = replace(SEEING, fov_deg=30.0 + i, neurons=16 + (i != BEST) * i)
        run.append(Candidate.from_evaluation(Place.from_id(i, 3), genome, phenotype, 1000 + i, outcome))
    return run


def film_of(content):
    return json.loads(re.search(r'class="film">(.*?)</script>', content, re.DOTALL)[1])


def picture(uri):
    """Return the pixels (y, x, 3) of a PNG, decoded by another library."""
    file = io.BytesIO(base64.b64decode(uri.removeprefix("data:image/png;base64,")))
    return np.rint(255 * imread(file, format="png")[..., :3]).astype(np.uint8)
