"""Display of runs and animals in notebooks, as HTML in which all text is escaped."""

from __future__ import annotations

from collections.abc import Sequence

from evolve.analysis.fitness_parts import fitness_text
from evolve.analysis.statistics import generation_statistics
from evolve.report.markup import Html, html, joined, rounded
from evolve.report.tables import acuity_text, field_of_view
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

__all__ = ["animal_as_html", "run_as_html"]

SHOWN = 12  # number of the latest generations that are shown


def run_as_html(run: Run) -> Html:
    """Return HTML tables of a run's progress and best fitness, and of its latest generations."""
    facts = {
        "task": run.config.task,
        "candidates": f"{len(run.candidates)} of {run.config.candidates} evaluated",
        "best": "none yet" if run.best is None else f"no. {run.best.id}, fitness {_fitness(run.best)}",
    }
    rows = [
        (str(row.generation), rounded(row.best), rounded(row.median), str(row.failed))
        for row in generation_statistics(run.candidates)[-SHOWN:]
    ]
    return _facts(str(run.path), facts) + (_table(("generation", "best", "median", "failed"), rows) if rows else Html())


def animal_as_html(candidate: Candidate) -> Html:
    """Return an HTML table with a candidate's outcome, eyes and brain."""
    animal = candidate.phenotype
    height, width = animal.resolution
    parts = "receptors" if animal.facet_diameter_um is None else "ommatidia"
    facts = {
        "fitness": candidate.failure or _fitness(candidate),
        "episodes solved": "–" if candidate.failure else f"{100 * candidate.success_rate:.0f} %",
        "eyes": f"{animal.n_eyes} of {height} × {width} {parts}, {field_of_view(animal)}",
        "acuity": acuity_text(animal, "cycles per degree"),
        "brain": f"{animal.layers} layers of {animal.neurons} neurons, {animal.memory_frames} frames of memory",
    }
    return _facts(f"candidate {candidate.id}, generation {candidate.generation}", facts)


def _fitness(candidate: Candidate) -> str:
    return fitness_text(candidate.fitness, candidate.costs, rounded)


def _facts(title: str, facts: dict[str, str]) -> Html:
    rows = joined(html("<tr><th>{}</th><td>{}</td></tr>", name, value) for name, value in facts.items())
    return html("<table><caption>{}</caption>{}</table>", title, rows)


def _table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> Html:
    head = joined(html("<th>{}</th>", cell) for cell in header)
    body = joined(html("<tr>{}</tr>", joined(html("<td>{}</td>", cell) for cell in row)) for row in rows)
    return html("<table><tr>{}</tr>{}</table>", head, body)
