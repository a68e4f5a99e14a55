"""The report's page: its sections, and what each figure's caption says."""

from __future__ import annotations

import math

from evolve.analysis.episode import Episode
from evolve.analysis.genealogy import descent
from evolve.analysis.statistics import acuity_cpd, champions, gene_values, generation_statistics, trajectory
from evolve.analysis.vision import SCENES, vision
from evolve.config.run_config import TASKS
from evolve.genome.genes import CLUSTERS, Gene
from evolve.report import tables
from evolve.report.eye_figures import eye_figures
from evolve.report.figures import (
    fitness_figure,
    gene_figure,
    genealogy_figure,
    learning_figure,
    relief_figure,
    success_figure,
    vision_figure,
)
from evolve.report.ground_plan import GroundPlan
from evolve.report.markup import KEY, document, figure, rounded, section, text
from evolve.report.player import episode_sentence, player
from evolve.report.views import what_it_sees
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

__all__ = ["render"]

POPULATION = f"{KEY.format('muted band')} 10–90 % of the population, {KEY.format('muted')} its median"
VISION = {
    "image quality": ("IQ", "image_quality", "area of the MTF above the noise, times throughput"),
    "contrast": ("MTF", "contrast", "at half the receptors’ Nyquist frequency, in white daylight"),
    "PSNR": ("PSNR [dB]", "psnr_db", "of the view, made as bright, against a perfect lens’s"),
    "SSIM": ("SSIM", "ssim", "structural similarity with a perfect lens’s view"),
}


def header(run: Run) -> str:
    """Title, what was evolved, headline numbers."""
    task = run.config.task
    return (
        f'<header><p class="kicker">rhabdom · evolution report · {text(run.path.resolve().name)}</p>\n'
        f"<h1>{text(task.capitalize())}</h1>\n<p>Eyes and brains evolved to {text(TASKS[task])}.</p>\n"
        f"{tables.headline(run)}</header>\n"
    )


def fitness_section(run: Run) -> str:
    """Fitness and success over the generations, learning within a lifetime."""
    if not run.candidates:
        return section("fitness", "Fitness", "<p>No candidate has been evaluated yet.</p>\n")
    rows = generation_statistics(run.candidates)
    caption = (
        f"<b>Fitness over generations.</b> {KEY.format('accent')} best so far and, pale, the 95 % bootstrap interval "
        f"of its mean return; {POPULATION}; a dot per candidate, "
        f'<span class="vermillion">×</span> failed. Fitness is the mean return of {run.config.evaluation.episodes} '
        "evaluation episodes after training. The best of many candidates is partly best by chance (selection bias); "
        "the interval does not include that."
    )
    figures = figure(fitness_figure(rows, run.candidates), caption)
    caption = (
        f"<b>Episodes solved.</b> Share of a candidate's evaluation episodes in which the task was solved (dots), "
        f"{KEY.format('muted')} mean of the generation."
    )
    figures += figure(success_figure(run.candidates), caption)
    if (best := run.best) is not None:
        caption = (
            f"<b>Learning.</b> Mean evaluation return while a candidate trains: {KEY.format('accent')} the best one "
            f"(no. {best.id}), {KEY.format('muted')} the others."
        )
        figures += figure(learning_figure(run.candidates, best), caption)
        caption = (
            f"<b>Genealogy.</b> Each candidate and the nearest of its parents; {KEY.format('accent')} the line of "
            f"candidate {best.id}: {', '.join(str(c.id) for c in descent(best, run.candidates))}."
        )
        figures += figure(genealogy_figure(run.candidates, best), caption)
    return section("fitness", "Fitness", f'<div class="figures">{figures}</div>\n')


def genes_section(run: Run) -> str:
    """Every open gene over the generations, cluster by cluster, and the acuity that follows from them."""
    if not run.candidates:
        return ""
    parts = [
        f"<p>{KEY.format('accent')} value in the best candidate so far, {POPULATION}. "
        "The vertical axes span the range that evolution may search.</p>\n"
    ]
    shown, table = gene_values(run.candidates[0].phenotype), run.config.eye.genes.values()
    for cluster in CLUSTERS:
        genes = [g for g in table if g.cluster == cluster and run.config.genome[g.name].open and g.name in shown]
        figures = "".join(_gene(run, gene) for gene in genes if not gene.name.startswith("doe_"))
        if cluster == "morphological":
            figures += _acuity(run)
        if figures:
            parts.append(f'<h3>{cluster.capitalize()}</h3>\n<div class="figures small">{figures}</div>\n')
        if relief := [g for g in genes if g.name.startswith("doe_")]:
            parts.append(_relief(run, relief))
    return section("genes", "Genes", "".join(parts))


def _gene(run: Run, gene: Gene) -> str:
    path = trajectory(run.candidates, lambda phenotype: gene_values(phenotype)[gene.name])
    use = run.config.genome[gene.name]
    picture = gene_figure(
        gene.name, gene.unit or _dimensionless(gene), path, (use.low, use.high), gene.kind == "integer"
    )
    return figure(picture, f"<b>{text(gene.name)}</b>: {text(gene.meaning)}")


def _dimensionless(gene: Gene) -> str:
    return "number" if gene.kind == "integer" else "ratio"


def _acuity(run: Run) -> str:
    path = trajectory(run.candidates, acuity_cpd)
    caption = (
        "<b>acuity</b>: finest grating that the sampling allows, 1 / (2 min(placement range / (eyes − 1), fov / width))"
    )
    return figure(gene_figure("acuity", "cycles / degree", path, None), caption)


def _relief(run: Run, genes: list[Gene]) -> str:
    paths = {g.name: trajectory(run.candidates, lambda p, name=g.name: gene_values(p)[name]) for g in genes}  # type: ignore[misc]
    left_out = "Frozen genes" + (", and genes that mirror others," if run.config.eye.relief_symmetric else "")
    caption = (
        f"<b>{genes[0].name} … {genes[-1].name}</b>: the relief, with each panel where its gene lies over the pupil "
        f"(x to the right, y up). {left_out} are left out."
    )
    return f'<div class="wide">{figure(relief_figure(paths), caption)}</div>\n'


def vision_section(run: Run) -> str:
    """What the best eyes so far see, over the generations."""
    best = champions(run.candidates)
    seen = {candidate.id: vision(candidate.phenotype, run.config) for _, candidate in best}
    if not seen:
        return ""
    generations = [generation for generation, _ in best]
    figures = ""
    for name, (label, field, meaning) in VISION.items():
        values = [getattr(seen[candidate.id], field) for _, candidate in best]
        if any(math.isfinite(value) for value in values):
            figures += figure(vision_figure(name, label, generations, values), f"<b>{name}</b>: {meaning}")
    intro = f"<p>The best eye so far in each generation; views are of {SCENES} starts of episodes, without noise.</p>\n"
    return section("vision", "Vision over the generations", f'{intro}<div class="figures small">{figures}</div>\n')


def candidates_section(run: Run) -> str:
    """The table of everyone, and the list of those who failed."""
    intro = "<p>Fitness is the mean return of the evaluation episodes; lowest and highest are single episodes.</p>\n"
    return section("candidates", "Candidates", f"{intro}{tables.all_candidates(run)}{tables.failures(run)}")


def facts_section(run: Run) -> str:
    return section("facts", "Facts of the run", tables.run_facts(run))


def best_section(run: Run, best: Candidate, episode: Episode) -> str:
    """The best candidate: its eye, what it sees, and its genes."""
    intro = f"<p>Candidate {best.id} of generation {best.generation}, fitness {rounded(best.fitness, 4)}.</p>\n"
    seen = f"<h3>What it sees</h3>\n{what_it_sees(episode, GroundPlan.of(episode))}"
    genes = f"<h3>Its genes</h3>\n{tables.best_genes(run, best)}"
    return section("best", "The best eye", f"{intro}{eye_figures(best.phenotype, run.config.eye)}{seen}{genes}")


def episode_section(run: Run, episode: Episode) -> str:
    return section(
        "episode", "An episode", f"<p>{episode_sentence(episode)}</p>\n{player(episode, GroundPlan.of(episode))}"
    )


def render(run: Run, episode: Episode | None) -> bytes:
    """The whole page; without an episode where no candidate has succeeded."""
    parts = [header(run), fitness_section(run), genes_section(run), vision_section(run)]
    if (best := run.best) is not None and episode is not None:
        parts += [best_section(run, best, episode), episode_section(run, episode)]
    else:
        parts += [section("best", "The best eye", "<p>No candidate has been evaluated successfully.</p>\n")]
    parts += [candidates_section(run), facts_section(run)]
    return document(f"{run.config.task} · {run.path.resolve().name}", "".join(parts), ["player.js"])
