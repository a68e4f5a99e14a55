"""Fitness section of a run's report.

It shows fitness, its parts and the success rate over the generations, the learning curves, and the family tree.
"""

from __future__ import annotations

from evolve.analysis.fitness_parts import any_costs
from evolve.analysis.genealogy import descent
from evolve.analysis.statistics import generation_statistics
from evolve.report.figures import costs_figure, fitness_figure, genealogy_figure, learning_figure, success_figure
from evolve.report.hints import hint
from evolve.report.markup import Html, figure, html, key, section
from evolve.store.directory import Run

__all__ = ["POPULATION", "fitness_section"]

POPULATION = html(
    "{} range from the 10th to the 90th percentile of the population, {} its median", key("muted band"), key("muted")
)


def fitness_section(run: Run) -> Html:
    """Return the section on fitness.

    It shows fitness, its parts and the success rate over the generations, the learning curves, and the family tree.
    """
    if not run.candidates:
        return section("fitness", "Fitness", html("<p>No candidate has been evaluated yet.</p>\n"))
    rows, best = generation_statistics(run.candidates), run.best
    minus = ", minus costs" if any_costs(run.candidates) else ""
    caption = html(
        "<b>{} over generations.</b> {} best so far, with its 95 % bootstrap interval in a pale shade; "
        '{}; one dot for each candidate; <span class="vermillion">×</span> failed candidate. Fitness is the '
        "mean return of {} evaluation episodes after training{}. The best of many candidates is partly best by chance "
        "(selection bias); the interval does not include that.",
        *(hint("fitness", "Fitness"), key("accent"), POPULATION, run.config.evaluation.episodes, minus),
    )
    figures = figure(fitness_figure(rows, run.candidates), caption)
    if minus and best is not None:
        figures += figure(costs_figure(run.candidates), _costs_caption(run))
    caption = html(
        "<b>Episodes solved.</b> Fraction of a candidate's evaluation episodes in which the task was solved (dots), "
        "and {} the mean of the generation.",
        key("muted"),
    )
    figures += figure(success_figure(run.candidates), caption)
    if best is not None:
        caption = html(
            "<b>Learning.</b> Mean evaluation return while a candidate trains: {} the best (no. {}), {} the others.",
            *(key("accent"), best.id, key("muted")),
        )
        figures += figure(learning_figure(run.candidates, best), caption)
        caption = html(
            "<b>Genealogy.</b> Each candidate and the nearest of its parents (click one for its row in the table); "
            "{} the line of descent of candidate {}: {}.",
            *(key("accent"), best.id, ", ".join(str(c.id) for c in descent(best, run.candidates))),
        )
        figures += figure(genealogy_figure(run.candidates, best), caption)
    return section("fitness", "Fitness", html('<div class="figures">{}</div>\n', figures))


def _costs_caption(run: Run) -> Html:
    costs = run.config.costs
    prices = f"{costs.per_receptor:g} per receptor, {costs.per_eye:g} per eye, {costs.per_neuron:g} per neuron"
    return html(
        "<b>Parts of fitness.</b> Task fitness is the mean return, and costs are {}. Each dot is a candidate; {} is "
        "the best so far. Fitness is the task fitness minus the costs.",
        *(prices, key("accent")),
    )
