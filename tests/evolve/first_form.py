"""Episodes in the first file format: built-in tasks only, without poses."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from evolve.episodes.episode import Episode

COLUMNS = (
    *("position", "heading", "objects", "action", "reward", "signals", "perfect_signals"),
    *("wavelengths_nm", "radiance_frames", "radiance"),
)


def of_first_form(episode: Episode, adversary_first: list[bool] | None = None) -> tuple[dict, dict]:
    """Return the arrays of a file, and its JSON content.

    adversary_first: whether an action reached an adversary before any goal; None: the entry is missing from the file
    """
    arrays = {name: getattr(episode, name) for name in COLUMNS} | {"contact": episode.beside["contact"][:, 0] > 0}
    arrays |= {f"term_{name}": term for name, term in episode.reward_terms.items()}
    if adversary_first is not None:
        arrays["adversary_first"] = np.array(adversary_first)
    rest = {
        "task": episode.task,
        "candidate_id": episode.candidate_id,
        "seed": episode.seed,
        "phenotype": episode.phenotype.to_json(),
        "eye": asdict(episode.eye),
        "world": asdict(episode.world),
        "terms": list(episode.reward_terms),
    }
    return arrays, rest
