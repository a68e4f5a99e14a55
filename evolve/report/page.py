"""The page of a report: its sections, and the captions of its figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from evolve.analysis.acuity import acuity_cpd, acuity_vertical_cpd
from evolve.analysis.fitness_parts import any_costs, fitness_text
from evolve.analysis.statistics import champions, gene_values, trajectory
from evolve.analysis.vision import SCENES, Vision, vision
from evolve.config.settings import FAMILY
from evolve.episodes.episode import Episode
from evolve.episodes.held_out import held_out_episodes
from evolve.genome.genes import CLUSTERS, Gene
from evolve.report import tables
from evolve.report.doing import Doing, in_silence
from evolve.report.eye_figures import eye_figures
from evolve.report.figures import (
    gene_figure,
    relief_figure,
    vision_figure,
)
from evolve.report.fitness_section import POPULATION, fitness_section
from evolve.report.hints import hint
from evolve.report.lineup import lineup
from evolve.report.markup import Html, contents, document, figure, html, joined, key, rounded, section
from evolve.report.player import episode_sentence, player
from evolve.report.views import what_it_sees
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

__all__ = ["render"]

VISION = {
    "image quality": ("IQ", "image_quality", "area between the MTF and the noise level, times throughput"),
    "contrast": ("MTF", "contrast", "contrast (MTF) at half the receptors’ Nyquist frequency, in white daylight"),
    "PSNR": (
        "PSNR [dB]",
        "psnr_db",
        "peak signal-to-noise ratio, relative to the equally bright signals behind a perfect lens",
    ),
    "SSIM": ("SSIM", "ssim", "structural similarity of the signals to those behind a perfect lens"),
}


def header(run: Run) -> Html:
    """Return the header: title, aim of the run, and a sentence on the best candidate if there is one."""
    card = run.config.card
    return html(
        '<header><p class="kicker">rhabdom · evolution report · {}</p>\n<h1>{}</h1>\n'
        "<p>Eyes and brains evolved {}. {}</p>\n</header>\n",
        *(run.path.resolve().name, card.title, card.aim, _best_in_a_sentence(run)),
    )


def _best_in_a_sentence(run: Run) -> Html:
    """Return a sentence on the best candidate's eyes and its success; empty if no candidate has succeeded."""
    if (best := run.best) is None:
        return Html()
    animal = best.phenotype
    eyes = html(
        "{} eye{} of {} × {} {}",
        *(animal.n_eyes, "s" * (animal.n_eyes > 1), *animal.resolution, hint("receptor", "receptors")),
    )
    return html(
        '<a href="#candidate-{}">Candidate {}</a>, the best of {}, has {}, and solved {} of its {} evaluation '
        "episodes.",
        *(best.id, best.id, len(run.candidates), eyes, round(best.success_rate * len(best.returns)), len(best.returns)),
    )


def animals_section(run: Run) -> Html:
    """Return the section with the first and the best animal."""
    shown = lineup(run)
    return section("animals", "First and best", shown) if shown else Html()


def numbers_section(run: Run) -> Html:
    """Return the section with the main results.

    If the run has a test set (layouts of walls that neither training nor evaluation has used), the best candidate plays
    episodes in these layouts.

    Raises:
        RunError: the policy of the best candidate is missing or damaged.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: the policy's file cannot be read.
    """
    has_test_set = run.config.world.layouts == FAMILY and run.best is not None
    held_out = held_out_episodes(run).returns.tolist() if has_test_set else ()
    return section("numbers", "The run in numbers", tables.headline(run, held_out))


def genes_section(run: Run) -> Html:
    """Return the section with curves of the genes and of acuity over the generations.

    It shows the genes that the search varies, grouped into morphological, optical, neural and spectral genes.
    """
    if not run.candidates:
        return Html()
    parts = [
        html(
            "<p>Values of the open {}: {} value in the best candidate so far, {}. The vertical axes span the searched "
            "range. Genes also drift by chance: <code>evolve drift DIR</code> computes by how much."
            "</p>\n",
            *(hint("genome", "genes"), key("accent"), POPULATION),
        )
    ]
    shown, table = gene_values(run.candidates[0].phenotype), run.config.genes.values()
    for cluster in CLUSTERS:
        genes = [g for g in table if g.cluster == cluster and run.config.genome[g.name].open and g.name in shown]
        figures = joined(_gene(run, gene) for gene in genes if not gene.name.startswith("doe_"))
        if cluster == "morphological":
            figures += _acuity(run)
        if figures:
            parts.append(html('<h3>{}</h3>\n<div class="figures small">{}</div>\n', cluster.capitalize(), figures))
        if relief := [g for g in genes if g.name.startswith("doe_")]:
            parts.append(_relief(run, relief))
    return section("genes", "Genes", joined(parts))


def _gene(run: Run, gene: Gene) -> Html:
    path = trajectory(run.candidates, lambda phenotype: gene_values(phenotype)[gene.name])
    use = run.config.genome[gene.name]
    picture = gene_figure(
        gene.name, gene.unit or _dimensionless(gene), path, (use.low, use.high), gene.kind == "integer"
    )
    return figure(picture, html("<b>{}</b>: {}", gene.name, gene.meaning))


def _dimensionless(gene: Gene) -> str:
    return "number" if gene.kind == "integer" else "ratio"


def _acuity(run: Run) -> Html:
    path, upwards = (trajectory(run.candidates, acuity) for acuity in (acuity_cpd, acuity_vertical_cpd))
    caption = html(
        "<b>{}</b>: finest grating that the spacing of receptors can resolve, 1 / (2 min(placement range / (eyes − 1), "
        "fov / columns))",
        hint("acuity"),
    )
    drawn = figure(gene_figure("acuity", "cycles / degree", path, None), caption)
    if all(acuity_cpd(c.phenotype) == acuity_vertical_cpd(c.phenotype) for c in run.candidates):
        return drawn
    caption = html("<b>vertical acuity</b>: the same for gratings with horizontal bars, 1 / (2 vertical fov / rows)")
    return drawn + figure(gene_figure("vertical-acuity", "cycles / degree", upwards, None), caption)


def _relief(run: Run, genes: list[Gene]) -> Html:
    paths = {g.name: trajectory(run.candidates, lambda p, name=g.name: gene_values(p)[name]) for g in genes}  # type: ignore[misc]
    left_out = "Frozen genes" + (", and genes that mirror others," if run.config.eye.relief_symmetric else "")
    turned = ", before the pupil is rotated by 180°" if run.config.eye.pupil_turned else ""
    caption = html(
        "<b>{} … {}</b>: the genes of the {}. Each panel is at the position of its gene over the pupil, seen from in "
        "front of the eye (x to the right, y up{}). {} are left out.",
        *(genes[0].name, genes[-1].name, hint("relief"), turned, left_out),
    )
    return html('<div class="wide">{}</div>\n', figure(relief_figure(paths), caption))


def vision_section(run: Run, doing: Doing) -> Html:
    """Return the section with up to four measures of image quality (`VISION`) of the best eye so far, by generation."""
    best = champions(run.candidates)
    if not best:
        return Html()
    seen: dict[int, Vision] = {}
    for one, candidate in {candidate.id: candidate for _, candidate in best}.items():
        doing(f"views of candidate {one}", len(seen) / len(best))
        seen[one] = vision(candidate.phenotype, run.config)
    generations = [generation for generation, _ in best]
    figures = Html()
    for name, (label, field, meaning) in VISION.items():
        values = [getattr(seen[candidate.id], field) for _, candidate in best]
        if any(math.isfinite(value) for value in values):
            figures += figure(vision_figure(name, label, generations, values), html("<b>{}</b>: {}", name, meaning))
    content = html(
        "<p>Values of the best eye so far in each generation. Signals are computed without noise at the starts of {} "
        "episodes.</p>\n"
        '<div class="figures small">{}</div>\n',
        *(SCENES, figures),
    )
    return section("vision", "Vision over the generations", content)


def candidates_section(run: Run) -> Html:
    """Return the section with the tables of all candidates and of failures."""
    what = "Task fitness" if any_costs(run.candidates) else "Fitness"
    intro = html(
        "<p>{} is the mean return of the evaluation episodes. The lowest and the highest returns are those of single "
        "episodes.</p>\n",
        what,
    )
    found = tables.all_candidates(run) + tables.failures(run) + tables.episode_failures(run)
    return section("candidates", "Candidates", intro + found)


def facts_section(run: Run) -> Html:
    return section("facts", "Facts of the run", tables.run_facts(run))


def best_section(run: Run, best: Candidate, episode: Episode) -> Html:
    """Return the section on the best candidate: its eye, its views in the episode, and its genes."""
    content = html(
        "<p>{} {} of {} {}, {} {}.</p>\n{}<h3>Views</h3>\n{}<h3>Genes</h3>\n{}",
        *(hint("candidate", "Candidate"), best.id, hint("generation"), best.generation),
        *(
            hint("fitness"),
            fitness_text(best.fitness, best.costs, partial(rounded, digits=4)),
            eye_figures(best.phenotype, run.config.eye, run.config.world.medium),
        ),
        *(what_it_sees(episode), tables.best_genes(run, best)),
    )
    return section("best", "The best eye", content)


def episode_section(run: Run, episode: Episode) -> Html:
    content = html("<p>{}</p>\n{}", episode_sentence(episode), player(episode))
    return section("episode", "The best animal at its task", content)


def _makers(run: Run, episode: Episode | None) -> Iterator[tuple[str, Callable[[Doing], Html]]]:
    """Yield, for each section of the page in order, a progress message and a function that returns the section."""
    if (best := run.best) is not None and episode is not None:
        yield "the episode's player", lambda doing: episode_section(run, episode)
        yield "the first animal and the best", lambda doing: animals_section(run)
        yield "the best eye", lambda doing: best_section(run, best, episode)
    else:
        none = html("<p>No candidate has been evaluated successfully.</p>\n")
        yield "the best eye", lambda doing: section("best", "The best eye", none)
    yield "the run in numbers", lambda doing: numbers_section(run)
    yield "fitness over the generations", lambda doing: fitness_section(run)
    yield "genes over the generations", lambda doing: genes_section(run)
    yield "views of the best eyes", lambda doing: vision_section(run, doing)
    yield "the table of candidates", lambda doing: candidates_section(run)
    yield "facts of the run", lambda doing: facts_section(run)


def _within(doing: Doing, done: int, of: int, what: str, share: float) -> None:
    """Report progress within one section of a report as a fraction of the whole report.

    done: number of completed sections
    of: number of all sections
    what: current step
    share: completed fraction of the current section
    """
    doing(what, (done + share) / of)


def render(run: Run, episode: Episode | None, doing: Doing = in_silence) -> bytes:
    """Return the report of a run as an HTML page, encoded as UTF-8.

    episode: an episode of the best candidate; None if no candidate has succeeded
    doing: function that is called with the current step and the completed fraction of the work, in [0, 1]

    Raises:
        RunError: the run has a test set of layouts, and the policy of the best candidate is missing or damaged.
        ConfigError: the run was opened without naming its user task (argument `task`), or the task's module cannot be
            executed.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: a file of the run cannot be read.
    """
    makers = list(_makers(run, episode))
    parts = []
    for done, (what, make) in enumerate(makers):
        doing(what, done / len(makers))
        parts.append(make(partial(_within, doing, done, len(makers))))
    body = joined(parts)
    title = f"{run.config.task_name} · {run.path.resolve().name}"
    return document(title, joined([header(run), contents(body), body]), ["player.js", "lineup.js"])
