"""The report: every number in it comes from the store, and it loads no external content and executes no content of the
run.
"""

import re
import shutil
from collections import Counter

import pytest

from evolve.config.assemble import assemble
from evolve.config.numbering import Place
from evolve.config.run_config import RunConfig
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.report import figures
from evolve.report.markup import exact, rounded
from evolve.report.page import genes_section, render
from evolve.report.tables import best_genes
from evolve.report.write import write
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.report.reported import BEST, HOSTILE, SEEING, Page, film_of
from tests.evolve.store.handwriting import records_of, write_records


def test_table_holds_every_candidate_with_the_stores_fitness(run, page):
    rows = page.rows["all-candidates"][1:]
    assert [row[0] for row in rows] == [str(c.id) for c in run.candidates]
    assert [row[2] for row in rows] == ["−12.5", "3.25", "failed", "41.8", "−0.500", "7.00"]
    assert [row[3] for row in rows] == ["−13.5", "2.25", "–", "40.8", "−1.50", "6.00"]
    assert [row[8] for row in rows] == ["30.0", "31.0", "32.0", "33.0", "34.0", "35.0"]


def test_best_candidate_is_the_stores(run, content, page):
    assert run.best.id == BEST
    assert "41.75" in page.texts["all"]
    assert re.findall(r"<tr class=best id=\"candidate-\d+\"><td>(\d+)</td>", content) == [str(BEST)]
    genes = {row[0]: row[2] for row in page.rows["genes-of-the-best"][1:]}
    assert genes["fov_deg"] == "33.0"
    assert genes["doe_10 … doe_13"].split() == ["0.500", "0.800", "0.800", "0.500"]


def test_headline_counts(page):
    text = " ".join(page.texts["all"].split())
    assert "6of 6 planned; 1 failed" in text
    assert "7.5 min" in text


def test_every_section_and_every_open_gene_is_there(run, page):
    assert {"fitness", "genes", "best", "animals", "numbers", "episode", "candidates", "facts"} <= set(page.ids)
    opened = [name for name in run.config.genes if run.config.genome[name].open]
    assert len(opened) > 20
    for name in opened:
        if not name.startswith("doe_"):
            assert f"{name}:" in page.texts["all"], name
    for caption in (
        "Fitness over generations",
        "Pupil.",
        "Point spread function",
        "Modulation transfer",
        "Views at",
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
    assert page.tags["script"] == 3  # the film, the player and the slider
    assert page.rows["failures"][1] == ["2", "0", " ".join(HOSTILE.split())]
    assert "<script>alert" not in content


def test_ids_are_unique(page):
    assert not [name for name, count in Counter(page.ids).items() if count > 1]


def test_references_inside_figures_lead_somewhere(content, page):
    targets = set(re.findall(r'(?:url\(#|href="#)([^")]+)', content))
    assert targets
    assert targets <= set(page.ids)


@pytest.mark.slow
def test_same_run_same_bytes_other_data_other_page(run, episode, content, tmp_path):
    assert render(run, episode).decode() == content
    other = shutil.copytree(run.path, tmp_path / run.path.name)
    lines = records_of(other / "candidates.jsonl")
    assert lines[-1]["fitness"] == 7.0
    write_records(other / "candidates.jsonl", [*lines[:-1], {**lines[-1], "fitness": 8.5}])
    changed = render(Run.open(other), episode).decode()
    assert changed != content
    assert [row[2] for row in Page(changed).rows["all-candidates"][1:]][-1] == "8.50"


@pytest.mark.slow
def test_write_records_and_names_the_file(run):
    path = write(run)
    assert path == run.path / "report.html"
    assert path.stat().st_size < 5e6
    assert film_of(path.read_text())["total"]


def test_a_run_of_failures_is_reported(tmp_path):
    run = Run.create(tmp_path / "failed", RunConfig("detection"))
    genome = tuple(Genotype(run.config.genome).start.tolist())
    for i in range(2):
        run.append(Candidate.from_evaluation(Place(i, 0, i), genome, SEEING, i, Evaluation.failed(f"reason {i}")))
    page = Page(write(run).read_text())
    assert [row[-1] for row in page.rows["failures"][1:]] == ["reason 0", "reason 1"]
    assert "No candidate has been evaluated successfully" in page.texts["all"]


def test_a_run_without_candidates_is_reported(tmp_path):
    run = Run.create(tmp_path / "empty", RunConfig("navigation"))
    assert "No candidate has been evaluated yet" in Page(write(run).read_text()).texts["all"]


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
    assert rounded(value) == shown


def test_exact_settings():
    assert [exact(v) for v in (16.0, 0.01, -0.5)] == ["16", "0.01", "−0.5"]


@pytest.mark.slow
def test_reliefs_of_more_genes_and_receptors_of_genes_are_reported(tmp_path):
    asked = ("eye.relief_points=5", "eye.receptors=genes", "genome.spectral.open=true", "search.population=2")
    config = assemble("foraging", assignments=asked)
    run = Run.create(tmp_path / "fine", config)
    genome = Genotype(config.genome).start
    animal = develop(genome, config)
    run.append(
        Candidate.from_evaluation(Place(0, 0, 0), tuple(genome.tolist()), animal, 1, Evaluation(1.0, (0.5, 1.5), 0.5))
    )
    genes = {row[0]: row[2] for row in Page(best_genes(run, run.best).markup).rows["genes-of-the-best"][1:]}
    assert genes["doe_40 … doe_44"].split() == ["0.500"] * 5
    assert genes["lambda_max_3_nm"] == "–", "three types have no fourth peak"
    text = Page(genes_section(run).markup).texts["all"]
    assert "doe_00 … doe_44: the genes of the relief" in text
    assert "lambda_max_0_nm:" in text


def test_symmetric_reliefs_are_reported_by_the_genes_that_they_have(tmp_path):
    config = assemble("detection", assignments=("eye.relief_symmetric=true", "search.population=2"))
    run = Run.create(tmp_path / "symmetric", config)
    genome = Genotype(config.genome).start
    outcome = Evaluation(1.0, (0.5, 1.5), 0.5)
    run.append(Candidate.from_evaluation(Place(0, 0, 0), tuple(genome.tolist()), develop(genome, config), 1, outcome))
    genes = {row[0]: row[2] for row in Page(best_genes(run, run.best).markup).rows["genes-of-the-best"][1:]}
    assert [name for name in genes if name.startswith("doe_")] == ["doe_00 … doe_01", "doe_11"]
    text = Page(genes_section(run).markup).texts["all"]
    assert "Frozen genes, and genes that mirror others, are left out." in text


def test_a_population_is_drawn_as_its_median_between_its_tenth_and_its_ninetieth_part():
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    figures._spread(axes, [0, 1, 2], [1.0, 2.0, 3.0], [2.0, 3.0, 5.0], [4.0, 5.0, 6.0])
    figures._generation_axis(axes, [0, 1, 2])
    assert axes.get_xlim() == (-0.5, 2.5)
    (line,) = axes.lines
    assert line.get_xydata().tolist() == [[0, 2], [1, 3], [2, 5]]
    (band,) = axes.collections
    assert {tuple(corner) for corner in band.get_paths()[0].vertices} >= {(0, 1), (2, 3), (0, 4), (2, 6)}


def test_who_waits_is_told_what_is_made_and_how_much_has_been(rendered):
    """Progress names every section once, and each champion whose view is computed."""
    _, told = rendered
    shares = [share for _, share in told]
    assert shares[0] == 0
    assert shares == sorted(shares)
    assert 0.5 < shares[-1] < 1
    assert {"the best eye", "facts of the run", f"views of candidate {BEST}"} <= {what for what, _ in told}
    assert len({what for what, _ in told}) == len(told)
