"""Tables of the report: main results, genes of the best candidate, all candidates, failures, and facts of the run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evolve.analysis.acuity import acuity_cpd, acuity_vertical_cpd
from evolve.analysis.episode_failures import episode_failures_of
from evolve.analysis.fitness_parts import any_costs
from evolve.analysis.statistics import bootstrap_interval, gene_values, succeeded
from evolve.config.assemble import to_toml
from evolve.genome.genes import ALL_GENES
from evolve.genome.phenotype import Phenotype
from evolve.report.hints import hint
from evolve.report.markup import Html, duration, exact, html, joined, rounded, table
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.versions import machines, recorded

__all__ = [
    "acuity_text",
    "all_candidates",
    "best_genes",
    "episode_failures",
    "failures",
    "field_of_view",
    "headline",
    "run_facts",
]


def headline(run: Run, held_out: Sequence[float] = ()) -> Html:
    """Return the main results of the run.

    held_out: returns of the best candidate's episodes in the test set of layouts; empty without a test set
    """
    failed = sum(not succeeded(c) for c in run.candidates)
    generations = len({c.generation for c in run.candidates})
    seconds = sum(c.seconds for c in run.candidates)
    steps = sum(c.steps for c in run.candidates)
    tiles: list[tuple[str | Html, str, str]] = [
        (
            "Candidates evaluated",
            f"{len(run.candidates)}",
            f"of {run.config.candidates} planned; {failed} failed",
        ),
        ("Generations", f"{generations}", f"of {run.config.search.generations} planned"),
        ("Training", f"{rounded(steps / 1e6)} M", "agent steps, all candidates"),
        ("Evaluation time", duration(seconds), "training and evaluation, summed over workers"),
    ]
    if (best := run.best) is not None:
        tested = []
        if len(held_out):
            tested = [("Its return in the test layouts", rounded(float(np.mean(held_out)), 4), _spread(held_out))]
        tiles = [*_best_tiles(best), *tested, *tiles]
    items = joined(html("<div><dt>{}</dt><dd>{}<small>{}</small></dd></div>", *tile) for tile in tiles)
    return html('<dl class="tiles">{}</dl>\n', items)


def _best_tiles(best: Candidate) -> list[tuple[str | Html, str, str]]:
    return [
        (html("Best {}", hint("fitness")), rounded(best.fitness, 4), _best_spread(best)),
        ("Best candidate", f"no. {best.id}", f"generation {best.generation}"),
        ("Episodes solved by the best", f"{rounded(100 * best.success_rate)} %", f"of {len(best.returns)}"),
        (
            html("Its {}", hint("acuity")),
            f"{_acuities(best.phenotype)} cpd",
            f"cycles per degree{_directions([best])}; limit by receptor spacing alone",
        ),
    ]


def _best_spread(best: Candidate) -> str:
    """Return the 95 % interval of the best candidate's fitness in words.

    If the candidate has costs, the text begins with its task fitness and its costs.
    """
    spread = _spread(best.returns, best.costs)
    if not best.costs:
        return spread
    return f"task fitness {rounded(best.task_fitness, 4)}, costs {rounded(best.costs, 4)}; {spread}"


def _spread(returns: Sequence[float], costs: float = 0.0) -> str:
    """Return the number of episodes and the 95 % interval of the fitness, in words.

    The fitness is the mean return of the episodes, minus `costs`. For a single episode, there is no interval.
    """
    if len(returns) == 1:
        return "a single episode"
    low, high = (end - costs for end in bootstrap_interval(returns))
    return f"mean of {len(returns)} episodes; 95 % interval {rounded(low)} to {rounded(high)}"


def best_genes(run: Run, best: Candidate) -> Html:
    """Return the table of the best candidate's genes and their start values."""
    values = gene_values(best.phenotype, run.config.eye)
    relief = sorted({name[:-1] for name in values if name.startswith("doe_")})
    groups = [[name] for name in values if not name.startswith("doe_")]
    groups += [[name for name in values if name.startswith(row)] for row in relief]
    rows = [_gene_row(run, names, values) for names in groups]
    return table(["gene", "meaning", "best", "start", "searched", "unit"], rows, "genes-of-the-best")


def _gene_row(run: Run, names: list[str], values: dict[str, float]) -> list[str | Html]:
    """Return a row of the table of genes.

    The row describes one gene or several. Several genes are heights of a lens's relief, which lie side by side in the
    pupil.
    """
    genes, uses = [ALL_GENES[name] for name in names], [run.config.genome[name] for name in names]
    name, meaning = names[0], genes[0].meaning
    if len(names) > 1:
        name, meaning = f"{names[0]} … {names[-1]}", f"relief, row {names[0][-2]}"
    best = [exact(values[g.name]) if g.kind == "integer" else rounded(values[g.name]) for g in genes]
    searched = list(dict.fromkeys(f"{exact(u.low)} to {exact(u.high)}" if u.open else "frozen" for u in uses))
    columns = (best, [exact(u.start) for u in uses], searched)
    return [html("<code>{}</code>", name), meaning, *("\u2002".join(c) for c in columns), genes[0].unit or "–"]


def all_candidates(run: Run) -> Html:
    """Return a table with a row for each candidate, in the order of ids. The best candidate's row is emphasised."""
    costs, acuity = any_costs(run.candidates), f"acuity{_directions(run.candidates)} [cpd]"
    header = [
        *("no.", "gener\u00adation", "fitness", *(("task fitness", "costs") if costs else ())),
        *("lowest return" if costs else "lowest", "highest return" if costs else "highest", "solved [%]"),
        *("eyes", "placement [°]", "fov [°]", "receptors (h × w)", acuity),
        *("aperture a", "index n", "memory", "neurons", "steps [k]", "minutes"),
    ]
    best = run.best
    place = next((i for i, c in enumerate(run.candidates) if best is not None and c.id == best.id), None)
    ids = [f"candidate-{c.id}" for c in run.candidates]
    return table(header, [_candidate_row(c, costs) for c in run.candidates], "all-candidates", place, ids)


def _candidate_row(candidate: Candidate, costs: bool) -> list[str]:
    good = succeeded(candidate)
    parts = [candidate.fitness, *([candidate.task_fitness, candidate.costs] if costs else [])]
    outcome = [*parts, min(candidate.returns), max(candidate.returns)] if good and candidate.returns else []
    shown = [rounded(value) for value in outcome] or ["failed", *["–"] * (len(parts) + 1)]
    solved = rounded(100 * candidate.success_rate) if good else "–"
    effort = [rounded(candidate.steps / 1000), rounded(candidate.seconds / 60)]
    return [str(candidate.id), str(candidate.generation), *shown, solved, *_traits(candidate.phenotype), *effort]


def field_of_view(animal: Phenotype) -> str:
    """Return the fields of view of an animal's eyes as text; only the horizontal one if receptors are square."""
    high = "" if animal.vertical_fov_deg is None else f", {rounded(animal.vertical_fov_deg)}° high"
    return f"{rounded(animal.fov_deg)}° wide{high}"


def _fields(phenotype: Phenotype) -> str:
    """Return the fields of view as text (width × height), or only the width if receptors are square."""
    fields = (phenotype.fov_deg, *(() if phenotype.vertical_fov_deg is None else (phenotype.vertical_fov_deg,)))
    return " × ".join(map(rounded, fields))


def acuity_text(animal: Phenotype, unit: str) -> str:
    """Return the acuity of an animal as text with its unit.

    If horizontal and vertical acuity differ, the text contains both.
    """
    across, up = _both_acuities(animal)
    return f"{across} {unit}" if across == up else f"{across} {unit} horizontally, {up} vertically"


def _both_acuities(animal: Phenotype) -> tuple[str, str]:
    return rounded(acuity_cpd(animal)), rounded(acuity_vertical_cpd(animal))


def _acuities(animal: Phenotype) -> str:
    """Return the acuities as text (horizontal × vertical), or a single number if the two are equal."""
    return " × ".join(dict.fromkeys(_both_acuities(animal)))


def _directions(candidates: Sequence[Candidate]) -> str:
    """Return the end of a heading: ", horizontal × vertical" or "".

    It is "" if the horizontal and the vertical acuity of each candidate are equal.
    """
    differ = any(len(set(_both_acuities(candidate.phenotype))) > 1 for candidate in candidates)
    return ", horizontal × vertical" if differ else ""


def _traits(phenotype: Phenotype) -> list[str]:
    height, width = phenotype.resolution
    aperture, index = (
        "–" if value is None else rounded(value) for value in (phenotype.relative_aperture, phenotype.refractive_index)
    )
    return [
        *(str(phenotype.n_eyes), rounded(phenotype.placement_range_deg), _fields(phenotype)),
        *(f"{height} × {width}", _acuities(phenotype), aperture, index),
        *(str(phenotype.memory_frames), str(phenotype.neurons)),
    ]


def failures(run: Run) -> Html:
    """Return the table of failed candidates with the reasons; empty if no candidate has failed."""
    failed = [c for c in run.candidates if not succeeded(c)]
    if not failed:
        return Html()
    rows = [[str(c.id), str(c.generation), c.failure or f"fitness is {c.fitness}"] for c in failed]
    return html("<h3>Failed candidates</h3>\n{}", table(["no.", "generation", "reason"], rows, "failures"))


def episode_failures(run: Run) -> Html:
    """Return the table of failures that ended single episodes, with the numbers of episodes and candidates.

    The result is empty if there are none.
    """
    found = episode_failures_of(run.candidates)
    if not found:
        return Html()
    rows = [[one.said, str(one.episodes), str(one.candidates)] for one in found]
    return html(
        "<h3>Episodes that failed</h3>\n<p>Each failure ended one episode of training or evaluation; the candidate "
        "continued with the next episode.</p>\n{}",
        table(["what failed", "episodes", "candidates"], rows, "mishaps"),
    )


def run_facts(run: Run) -> Html:
    """Return facts of the run, such as its settings, its seeds and the versions of the software."""
    versions = recorded(run.path)
    commit = versions.pop("commit", "") or "not recorded"
    software = ", ".join(f"{name} {version}" for name, version in versions.items()) or "not recorded"
    facts = {
        "run": run.path.resolve().name,
        "task": run.config.task,
        "seed": run.config.seed,
        "workers": run.config.workers or "one per core",
        "commit": commit,
        "machine": "; ".join(machines(run.path)) or "not recorded",
        "software": software,
    }
    if run.notice:
        facts["notice"] = run.notice.replace(str(run.path), run.path.name)
    entries = joined(html("<dt>{}</dt><dd>{}</dd>", name, value) for name, value in facts.items())
    config = html(
        "<details><summary>config.toml, every setting</summary><pre>{}</pre></details>\n", to_toml(run.config)
    )
    return html('<dl class="facts">{}</dl>\n{}{}', entries, config, _seeds(run))


def _seeds(run: Run) -> Html:
    seeds = "\n".join(f"{c.id:6d}  {c.seed}" for c in run.candidates)
    return html("<details><summary>training seeds of the candidates</summary><pre>{}</pre></details>\n", seeds)
