"""An episode once more: as a table in the terminal, and as a page that plays it."""

from __future__ import annotations

from pathlib import Path

from evolve.analysis.episode import Episode, record
from evolve.report.player import write_player
from evolve.report.rerun_recording import require_rerun, write_recording
from evolve.store.directory import Run

__all__ = ["episode_table", "write_replay"]


def write_replay(run: Run, candidate_id: int | None = None, seed: int = 0, rrd: bool = False) -> list[Path]:
    """Record an episode (default: of the best candidate), print how it went, and write a page that plays it; with `rrd`
    a recording for rerun as well.

    Returns the paths, in the run directory.

    Raises:
        RunError: there is no such candidate, or no policy of it.
        ConfigError: rerun is asked for, but not installed.
    """
    if rrd:
        require_rerun()
    episode = record(run, candidate_id, seed)
    print(episode_table(episode))
    path = run.path / f"replay_candidate{episode.candidate_id:06d}_seed{seed}.html"
    page = write_player(episode, path)
    return [page, write_recording(episode, path.with_suffix(".rrd"))] if rrd else [page]


def episode_table(episode: Episode) -> str:
    """How an episode went: return, what it is made of, and what was reached, one line each."""
    terms = {name: float(term.sum()) for name, term in episode.reward_terms.items()}
    events = {name: int((episode.reward_terms[name] != 0).sum()) for name in ("goal", "adversary")}
    rows = [
        ("task", episode.task),
        ("candidate", str(episode.candidate_id)),
        ("episode seed", str(episode.seed)),
        ("actions", str(len(episode))),
        ("return", f"{episode.reward.sum():.2f}"),
        *((f"  {name}", f"{value:.2f}") for name, value in terms.items()),
        ("goals reached", str(events["goal"])),
        ("adversaries reached", str(events["adversary"])),
        ("actions in contact", str(int(episode.contact.sum()))),
        ("solved", "yes" if solved(episode) else "no"),
    ]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def solved(episode: Episode) -> bool:
    """Whether the goal was reached, and before any adversary."""
    events = episode.reward_terms["goal"] + episode.reward_terms["adversary"]
    return bool(events[events != 0][:1].sum() > 0)
