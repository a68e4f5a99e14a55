"""Cards of the first and the best animal, with a slider through the best animals of the generations between them."""

from __future__ import annotations

from evolve.analysis.fitness_parts import fitness_text
from evolve.analysis.statistics import champions
from evolve.learning.animal_task import azimuths
from evolve.report.agent_figure import agent_figure
from evolve.report.markup import Html, html, joined, rounded
from evolve.report.tables import acuity_text, field_of_view
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

__all__ = ["lineup"]

MOST = 60  # maximum number of animals on a page; if there are more, evenly spaced ones are selected


def lineup(run: Run) -> Html:
    """Return two cards side by side: on the left the first animal, on the right the one that the slider selects.

    The script lineup.js shows the card of the selected generation. If no candidate has succeeded, the result is empty.

    Raises:
        ConfigError: the run was opened without naming its user task (argument `task`), or the task's module cannot be
            executed.
    """
    best = _thinned(champions(run.candidates))
    if not best:
        return Html()
    first, last = best[0], len(best) - 1
    cards = joined(_card(run, generation, candidate, f"line-{i}") for i, (generation, candidate) in enumerate(best))
    slider = html(
        '<label class="pick">Best animal after generation <output>{}</output>'
        '<input type="range" min="0" max="{}" value="{}" step="1"></label>',
        *(best[-1][0], last, last),
    )
    return html(
        '<div class="lineup"><div class="first"><h4>{}</h4>{}</div><div><h4>{}</h4>{}</div></div>\n',
        *(_heading(first[0]), _card(run, *first, "line-first"), slider if last else html("The best of all"), cards),
    )


def _heading(generation: int) -> str:
    """Return the title of the left card, which shows the best animal of a generation.

    generation: number of the first generation in which a candidate succeeded. If it is above 0, all candidates of
        generation 0 have failed, and the title adds "the first to succeed".
    """
    return f"Generation {generation}’s best{', the first to succeed' if generation else ''}"


def _thinned(best: list[tuple[int, Candidate]]) -> list[tuple[int, Candidate]]:
    """Return at most 60 of the best animals, including the first and the last."""
    if len(best) <= MOST:
        return best
    return [best[round(i * (len(best) - 1) / (MOST - 1))] for i in range(MOST)]


def _card(run: Run, generation: int, candidate: Candidate, name: str) -> Html:
    animal = candidate.phenotype
    height, width = animal.resolution
    facts = {
        "candidate": str(candidate.id),
        "fitness": fitness_text(candidate.fitness, candidate.costs, rounded),
        "episodes solved": f"{100 * candidate.success_rate:.0f} %",
        "eyes": f"{animal.n_eyes} of {height} × {width}, {field_of_view(animal)}",
        "acuity": acuity_text(animal, "cycles/degree"),
        "brain": f"{animal.neurons} neurons, {animal.memory_frames} frames",
    }
    rows = joined(html("<dt>{}</dt><dd>{}</dd>", key, value) for key, value in facts.items())
    drawn = agent_figure(animal.eyes(run.config.eye), name, azimuths(animal, run.config))
    return html('<div class="card" data-generation="{}">{}<dl>{}</dl></div>', generation, drawn, rows)
