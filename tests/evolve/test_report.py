"""The report: every number in it is the store's, nothing in it comes from elsewhere, nothing in it is executed."""

import base64
import io
import json
import re
import shutil
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.image import imread
from small_run import LEARNING, PHENOTYPE

import sim
from evolve.candidate import Candidate
from evolve.config import EyeConfig, RunConfig, SearchConfig
from evolve.episode import record
from evolve.evaluation import Evaluation
from evolve.fitness import evaluate
from evolve.genotype import GENES, Genotype
from evolve.report import write
from evolve.report.eye_figures import Light, diffraction_limit, relief_heights
from evolve.report.markup import exact, number
from evolve.report.page import render
from evolve.report.picture import data_uri, display, film_sheet, png
from evolve.report.player import write_player
from evolve.report.stage import Stage
from evolve.report.views import through
from evolve.store import Run
from optics.spectrum import daylight

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
    """What a browser would make of a page, as far as these tests want to know."""

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
    """Two generations of three; all but the fitness and some traits is that of one really trained candidate."""
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
        run.append(Candidate.of((i, i // 3, i % 3), genome, phenotype, 1000 + i, outcome))
    return run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("report") / "first")


@pytest.fixture(scope="module")
def episode(run):
    return record(run, radiance_every=64)


@pytest.fixture(scope="module")
def content(run, episode):
    return render(run, episode).decode()


@pytest.fixture(scope="module")
def page(content):
    return Page(content)


def film_of(content):
    return json.loads(re.search(r'class="film">(.*?)</script>', content, re.DOTALL)[1])


def picture(uri):
    """Pixels (y, x, 3) of a PNG, decoded by someone else's code."""
    file = io.BytesIO(base64.b64decode(uri.removeprefix("data:image/png;base64,")))
    return np.rint(255 * imread(file, format="png")[..., :3]).astype(np.uint8)


def test_table_holds_every_candidate_with_the_stores_fitness(run, page):
    rows = page.rows["all-candidates"][1:]
    assert [row[0] for row in rows] == [str(c.id) for c in run.candidates]
    assert [row[2] for row in rows] == ["−12.5", "3.25", "failed", "41.8", "−0.500", "7.00"]
    assert [row[3] for row in rows] == ["−13.5", "2.25", "–", "40.8", "−1.50", "6.00"]
    assert [row[8] for row in rows] == ["30.0", "31.0", "32.0", "33.0", "34.0", "35.0"]


def test_best_candidate_is_the_stores(run, content, page):
    assert run.best.id == BEST
    assert "41.75" in page.texts["all"]
    assert re.findall(r"<tr class=best><td>(\d+)</td>", content) == [str(BEST)]
    genes = {row[0]: row[2] for row in page.rows["genes-of-the-best"][1:]}
    assert genes["fov_deg"] == "33.0"
    assert genes["doe_10 … doe_13"].split() == ["0.500", "0.800", "0.800", "0.500"]


def test_headline_counts(page):
    text = " ".join(page.texts["all"].split())
    assert "6of 6 planned; 1 failed" in text
    assert f"{number(5 * 90 / 3600 + 2 / 3600)} h" in text


def test_every_section_and_every_open_gene_is_there(run, page):
    assert {"fitness", "genes", "best", "episode", "candidates", "facts"} <= set(page.ids)
    opened = [name for name in GENES if run.config.genome[name].open]
    assert len(opened) > 20
    for name in opened:
        if not name.startswith("doe_"):
            assert f"{name}:" in page.texts["all"], name
    for caption in (
        "Fitness over generations",
        "Pupil.",
        "Point spread function",
        "Modulation transfer",
        "What it sees",
    ):
        assert caption in page.texts["all"]


def test_facts_name_config_and_seeds(run, page):
    text = page.texts["all"]
    assert "rays_per_receptor = 1" in text
    assert all(str(c.seed) in text for c in run.candidates)
    assert "drjit 1." in text


def test_nothing_comes_from_outside(content, page):
    assert not re.search(r"https?:", content.replace("http://evil.example", ""))
    for tag, name, value in page.attributes:
        if name in ("src", "href", "xlink:href", "srcset", "data", "action", "poster"):
            assert value.startswith(("data:image/png;base64,", "#")), (tag, name, value[:60])
        assert not name.startswith("on"), (tag, name)
    assert all(target.startswith("#") for target in re.findall(r"url\(['\"]?([^)]*)", content))
    assert not page.tags.keys() & {"link", "iframe", "object", "embed", "base"}
    assert "default-src 'none'" in content


def test_hostile_text_stays_text(content, page):
    assert page.tags["script"] == 2  # the film and the player
    assert page.rows["failures"][1] == ["2", "0", " ".join(HOSTILE.split())]
    assert "<script>alert" not in content


def test_ids_are_unique(page):
    assert not [name for name, count in Counter(page.ids).items() if count > 1]


def test_references_inside_figures_lead_somewhere(content, page):
    targets = set(re.findall(r'(?:url\(#|href="#)([^")]+)', content))
    assert targets
    assert targets <= set(page.ids)


def test_same_run_same_bytes_other_data_other_page(run, episode, content, tmp_path):
    assert render(run, episode).decode() == content
    other = shutil.copytree(run.path, tmp_path / run.path.name)
    lines = (other / "candidates.jsonl").read_text().replace('"fitness": 7.0', '"fitness": 8.5')
    (other / "candidates.jsonl").write_text(lines)
    changed = render(Run.open(other), episode).decode()
    assert changed != content
    assert [row[2] for row in Page(changed).rows["all-candidates"][1:]][-1] == "8.50"


def test_write_records_and_names_the_file(run):
    path = write(run)
    assert path == run.path / "report.html"
    assert path.stat().st_size < 5e6
    assert film_of(path.read_text())["total"]


def test_film_is_the_episode(run, episode, content):
    film = film_of(content)
    assert len(film["times"]) == len(episode) == 256
    assert film["times"][:3] == [0, 0.2, 0.4]
    np.testing.assert_allclose(film["position"], episode.position, atol=6e-4)
    np.testing.assert_allclose(film["objects"], episode.objects[..., :2], atol=6e-4)
    assert film["total"][-1] == pytest.approx(episode.reward.sum(), abs=1e-3)
    assert film["total"][0] == pytest.approx(episode.reward[0], abs=1e-3)
    np.testing.assert_allclose(film["terms"]["progress"], np.cumsum(episode.reward_terms["progress"]), atol=1e-3)
    assert np.degrees(film["eyes"]["fov"]) == pytest.approx(33.0)
    assert np.degrees(film["eyes"]["azimuths"]) == pytest.approx([30, -30], abs=1e-3)


def test_film_shows_what_each_eye_signalled(episode, content):
    film = film_of(content)
    height, width = episode.signals.shape[-2:]
    for sheet, signals, gain in (
        ("seen", episode.signals, 1 / 0.3**2),
        ("perfect", episode.perfect_signals, 1.0),
    ):
        pixels = picture(film["sheets"][sheet])
        for time, eye in ((0, 0), (0, 1), (100, 1), (255, 0)):
            row, column = divmod(time, film["sheet_columns"])
            x = (column * 2 + eye) * width
            cell = pixels[row * height : (row + 1) * height, x : x + width]
            np.testing.assert_array_equal(cell, display(signals[time, eye], gain))


def test_events_are_marked_when_they_happen(episode, content):
    goal = np.flatnonzero(episode.reward_terms["goal"]).tolist()
    adversary = np.flatnonzero(episode.reward_terms["adversary"]).tolist()
    expected = sorted([(t, "goal") for t in goal] + [(t, "adversary") for t in adversary])
    assert [tuple(event) for event in film_of(content)["events"]] == expected


def test_player_is_a_page_of_its_own(run, episode, tmp_path):
    path = write_player(episode, tmp_path / "replay.html")
    text = path.read_text()
    page = Page(text)
    assert page.tags["canvas"] == 2 + 2 * 2
    assert film_of(text)["total"][-1] == pytest.approx(episode.reward.sum(), abs=1e-3)
    assert not re.search(r"https?:", text)


def test_long_films_of_many_receptors_are_thinned(episode, tmp_path):
    fine = np.repeat(np.repeat(episode.signals, 20, axis=-1), 20, axis=-2)
    phenotype = replace(episode.phenotype, resolution=(80, 100))
    many = replace(episode, signals=fine, perfect_signals=fine, phenotype=phenotype)
    film = film_of(write_player(many, tmp_path / "replay.html").read_text())
    steps = np.diff(film["times"])
    assert steps[0] > 0.2
    assert steps == pytest.approx(steps[0])
    assert len(film["times"]) * fine[0, :, 0].size * 3 <= 1.6e6
    assert len(film["position"]) == len(film["total"]) == len(film["times"])


def test_a_run_of_failures_is_reported(tmp_path):
    run = Run.create(tmp_path / "failed", RunConfig("detection"))
    genome = tuple(Genotype(run.config.genome).start.tolist())
    for i in range(2):
        run.append(Candidate.of((i, 0, i), genome, SEEING, i, Evaluation.failed(f"reason {i}")))
    page = Page(write(run).read_text())
    assert [row[-1] for row in page.rows["failures"][1:]] == ["reason 0", "reason 1"]
    assert "No candidate has been evaluated successfully" in page.texts["all"]


def test_a_run_without_candidates_is_reported(tmp_path):
    run = Run.create(tmp_path / "empty", RunConfig("navigation"))
    assert "No candidate has been evaluated yet" in Page(write(run).read_text()).texts["all"]


def test_stage_is_the_world(episode):
    stage = Stage.of(episode)
    assert stage.bounds == pytest.approx((-13, -11, 13, 11))  # 11 x 9 cells of 2 m and walls of 2 m
    assert stage.object_radius == (0.5, 0.5, 0.5)
    assert stage.gain == pytest.approx(1 / 0.3**2)
    assert stage.seconds == pytest.approx(0.2)


def test_ground_plan_of_the_maze_leaves_free_cells_free(episode):
    stage = Stage.of(replace(episode, task="navigation"))
    spots = sim.build_world("navigation").agent_spawn
    gap = np.abs(spots[:, None] - stage.walls[None, :, :2]) - stage.walls[None, :, 2:]
    assert (gap.max(axis=-1) > 0.5).all()  # a cell's centre is 1 m from the next wall
    x0, y0, x1, y1 = stage.bounds
    walls = 4 * stage.walls[:, 2:].prod(axis=1).sum()
    assert 0.3 < walls / ((x1 - x0) * (y1 - y0)) < 0.7


def test_display_is_srgb():
    signals = np.array([-1.0, 0.0, 0.002, 0.2140411, 0.5, 1.0, 2.0]).reshape(1, 1, 7).repeat(3, axis=0)
    assert display(signals)[0, :, 0].tolist() == [0, 0, 7, 127, 188, 255, 255]  # IEC 61966-2-1, table values
    assert display(signals[:1])[0, :, 2].tolist() == display(signals)[0, :, 0].tolist()
    assert display(0.25 * signals, gain=4.0).tolist() == display(signals).tolist()


def test_display_keeps_channels_and_rows_apart():
    signals = np.zeros((3, 2, 2))
    signals[0, 0, 1] = signals[2, 1, 0] = 1.0
    pixels = display(signals)
    assert pixels[0, 1].tolist() == [255, 0, 0]
    assert pixels[1, 0].tolist() == [0, 0, 255]
    assert pixels.sum() == 510


def test_png_reads_back():
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    np.testing.assert_array_equal(picture(data_uri(pixels)), pixels)
    assert png(pixels) == png(pixels.copy())


def test_sheets_break_into_rows():
    frames = np.random.default_rng(0).integers(0, 256, (5, 3, 2, 600, 3)).astype(np.uint8)
    sheet, columns = film_sheet(frames)
    assert columns == 2
    assert sheet.shape == (6, 3600, 3)
    np.testing.assert_array_equal(sheet[2:4, 1800 + 600 : 1800 + 1200], frames[3, 1])


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (1234567.0, "1 234 567"),
        (-8.3391, "−8.34"),
        (0.012345, "0.0123"),
        (9.999, "10.0"),
        (16.0, "16.0"),
        (float("nan"), "–"),
        (-float("inf"), "–"),
    ],
)
def test_numbers_have_sensible_digits(value, shown):
    assert number(value) == shown


def test_exact_settings():
    assert [exact(v) for v in (16.0, 0.01, -0.5)] == ["16", "0.01", "−0.5"]


def test_noise_free_view_is_what_the_animal_sees(run):
    """Convolution of the fine picture against rays drawn from the receptive fields: two ways to the same signals."""
    calm = replace(run.config, eye=replace(run.config.eye, noise_sigma=0.0, rays_per_receptor=64))
    episode = record(Run(run.path, calm, run.candidates), radiance_every=64)
    eye = episode.eyes.eye()
    views = np.array([[through(eye, one) for one in frame] for frame in episode.radiance])
    seen = episode.signals[episode.radiance_frames]
    assert seen.max() > 0.02  # at most a² = 0.09
    # what remains: edges of objects between 64 rays, and the scene beyond the picture, which the view can only guess
    error = np.sqrt(np.mean((views - seen) ** 2))
    assert error < 0.03 * seen.max()
    for turned in (views[..., ::-1, :], views[..., ::-1]):
        assert np.sqrt(np.mean((turned - seen) ** 2)) > 3 * error


def test_height_map_is_the_pupils():
    """A paraboloid is inside the gene's space; its height is a closed form."""
    import optics

    radius, curvature = 30e-6, 8e3
    relief = optics.BSplineRelief.paraboloid(20e-6, curvature, radius)
    heights, inside = relief_heights(optics.Pupil(radius, relief))
    n = len(heights)
    x = radius * ((np.arange(n) + 0.5) / n * 2 - 1)
    np.testing.assert_allclose(heights, 20e-6 - curvature * (x[:, None] ** 2 + x**2) / 2, atol=1e-15)
    assert inside.mean() == pytest.approx(np.pi / 4, abs=0.01)


def test_mtf_of_a_perfect_lens_is_the_diffraction_limit():
    """The PSF's window lacks up to 1 % of the light, which lifts the contrast by as much."""
    import optics

    eye = optics.Eye(optics.Pupil(20e-6, thin_lens_focal_length=100e-6 / np.tan(np.radians(22.5))), (15, 15), 45.0)
    light = Light.through(eye)
    frequency = np.array([0.1, 0.3, 0.5, 0.8]) * optics.mtf(light.psf).cutoff.max()
    contrast = optics.mtf(light.white).profile(frequency)[0]
    np.testing.assert_allclose(contrast, diffraction_limit(light, frequency), atol=0.01)


def test_diffraction_limit_weighs_the_bands_by_their_light():
    """At the shortest band's cutoff nothing passes; at that of the longest, only what the shorter ones pass."""
    import optics

    eye = optics.Eye(optics.Pupil(20e-6, thin_lens_focal_length=241e-6), (15, 15), 45.0, bands=2)
    light = Light.through(eye)
    short, long = optics.mtf(light.psf).cutoff
    s = long / short
    weights = eye.spectral_bands.weights.mean(axis=0) * daylight(eye.spectral_bands.wavelengths)
    expected = weights[0] * 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
    np.testing.assert_allclose(diffraction_limit(light, np.array([0.0, long, short])), [1, expected, 0], atol=1e-6)


def test_height_map_lies_the_right_way_up():
    import optics

    points = np.zeros((4, 4))
    points[3] = 1e-6  # row index and y grow together
    heights, _ = relief_heights(optics.Pupil(30e-6, optics.BSplineRelief(points)))
    assert heights[-1].mean() > 100 * max(heights[0].mean(), 1e-12)
