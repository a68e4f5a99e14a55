"""Player of a recorded episode on a page.

It shows the animal's path on a ground plan, images, the signals of each eye, and the reward.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from evolve.episodes.episode import Episode
from evolve.report.markup import Html, document, exact, html, joined, json_script, key, rounded, style
from evolve.report.picture import data_uri, display, film_sheet
from evolve.report.picture_sheet import figure_of_pictures, film_of_pictures
from evolve.store.atomic_files import write_whole
from sim.worlds.ground_plan import GroundPlan

__all__ = ["episode_sentence", "player", "write_player"]

# [bytes] Maximum size of the pixels on a sheet. It limits the size of the page, because noise hardly compresses.
LARGEST_FILM = 1_500_000
ROOM = 200  # [CSS pixels] length of the longer side of an eye's image; half of it if there are more than six eyes
EVENTS = ("goal", "adversary")  # reward terms that player.js marks when they differ from 0
TERM_COLOURS = ("accent", "green", "vermillion", "purple")  # player.js uses the same colours


def write_player(episode: Episode, path: Path) -> Path:
    """Write a page that plays the episode, and return its path. The file is written completely or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    name = f"{episode.title}: candidate {episode.candidate_id} plays"
    body = html(
        '<header><p class="kicker">rhabdom · replay</p>\n<h1>{}</h1>\n<p>{}</p></header>\n{}',
        *(name, episode_sentence(episode), player(episode)),
    )
    write_whole(Path(path), document(name, body, ["player.js"]))
    return Path(path)


def episode_sentence(episode: Episode) -> str:
    """Return one or two sentences with the outcome of the episode."""
    total = rounded(float(episode.reward.sum(dtype=np.float64)), 4)
    terms = ", ".join(f"{name} {rounded(float(term.sum()))}" for name, term in episode.reward_terms.items())
    parts = f" ({terms})" if terms else ""
    end = "" if episode.failure is None else f" It ended because the task failed: {episode.failure}."
    name = f"{episode.mode.capitalize()} episode with seed {episode.seed}"
    return f"{name}: {len(episode)} actions, return {total}{parts}.{end}"


def player(episode: Episode) -> Html:
    """Return the player as an element. Its page must include the script player.js."""
    film = json_script(_film(episode), "film")
    left, right = _controls(episode) + _world(episode) + _score(episode), _sights(episode)
    return html(
        '<div class="player" tabindex="0" role="group" aria-label="Replay"><div>{}</div><div>{}</div>{}</div>\n',
        left,
        right,
        film,
    )


def _world(episode: Episode) -> Html:
    """Return figures of the world: rendered images, if any, and the world from above if the task has a ground plan."""
    pictures = Html() if episode.pictures is None else figure_of_pictures(episode.pictures)
    return pictures if episode.plan is None else pictures + _from_above(episode.plan)


def _from_above(plan: GroundPlan) -> Html:
    x0, y0, x1, y1 = plan.bounds
    legend = Html()
    if plan.object_radius:
        legend = html(
            ' <b class="green">G</b> goal, <b class="vermillion">A</b> adversary; a ring marks where one was reached.'
        )
    if plan.goal_region is not None:
        legend = html(' The <b class="green">tinted</b> area is the goal.')
    caption = html(
        "<b>From above</b>, {} m × {} m: the path so far, the agent (its tip points where it heads) and the "
        "horizontal fields of view of its eyes.{}",
        *(exact(x1 - x0), exact(y1 - y0), legend),
    )
    return html(
        '<figure><canvas class="world" role="img" aria-label="The world from above: walls, objects, the agent, its '
        'path and the fields of view of its eyes" {}></canvas><figcaption>{}</figcaption></figure>\n',
        *(style(f"aspect-ratio:{x1 - x0:g}/{y1 - y0:g}"), caption),
    )


def _sights(episode: Episode) -> Html:
    """Return two canvases for each eye, one for its signals with noise and one for signals without noise.

    For a lens eye, the signals without noise are those that its receptors would have behind a perfect lens. For a
    compound eye, they are the signals of its own ommatidia.
    """
    eyes, gain = episode.eyes, episode.gain
    height, width = eyes.resolution
    room = ROOM if eyes.n_eyes <= 6 else ROOM // 2
    aspect = eyes.field_aspect
    shape = style(f"width:{room * min(aspect, 1):.4g}px;aspect-ratio:{aspect:.4g}")
    size = html('width="{}" height="{}" {}', width, height, shape)
    clean = "perfect lens" if eyes.ommatidium is None else "no noise"
    pairs = [_pair(eye, name, size, clean) for eye, name in enumerate(eyes.names())]
    brighter = "" if gain == 1 else f", brightened {rounded(gain)} times (1/a², to compensate for the pupil's area)"
    note = html(
        "<b>Signals of the eyes</b>, from left to right: receptor signals with noise, shown as linear red, green and "
        "blue{}; next to them the signals of the same {}, without noise.",
        *(brighter, "receptors behind a perfect lens" if eyes.ommatidium is None else "ommatidia"),
    )
    return html(
        '<figure class="sights"><div class="eyes">{}</div><figcaption>{}</figcaption></figure>\n', joined(pairs), note
    )


def _pair(eye: int, name: str, size: Html, clean: str) -> Html:
    """Return the canvases of an eye. `clean` is the label of the signals without noise."""
    canvases = joined(
        html(
            '<div><canvas data-eye="{}" data-sheet="{}" {} role="img" aria-label="{} eye: {}"></canvas>'
            "<span>{}</span></div>",
            *(eye, sheet, size, name, label, label),
        )
        for sheet, label in (("seen", "signals"), ("perfect", clean))
    )
    return html('<div class="sight"><span class="name">{}</span><div class="pair">{}</div></div>', name, canvases)


def _controls(episode: Episode) -> Html:
    return html(
        '<div class="controls"><input type="range" min="0" max="{}" value="0" step="1" '
        'aria-label="Time in the episode"><button type="button" class="play" aria-pressed="false">Play</button>'
        '<label>Speed <select><option value="1">1×</option><option value="2" selected>2×</option>'
        '<option value="4">4×</option></select></label><span class="time"></span><span class="action"></span></div>\n',
        len(episode) - 1,
    )


def _score(episode: Episode) -> Html:
    """Return a plot of the cumulated reward over time, for each term of the reward."""
    names = [*episode.reward_terms, "total"]
    colours = [TERM_COLOURS[i % len(TERM_COLOURS)] for i in range(len(names) - 1)] + ["ink"]
    cells = joined(
        html('<div><dt>{} {}</dt><dd data-term="{}"></dd></div>', key(colour), name, name)
        for name, colour in zip(names, colours, strict=True)
    )
    return html(
        '<figure class="score"><canvas class="rewards" role="img" aria-label="Cumulated reward terms over time">'
        "</canvas><dl>{}</dl><figcaption><b>Reward so far</b> (dimensionless), by term. Terms have the same weights as "
        "in the fitness and include the current action. In the player, the arrow keys move by one step (with shift: by "
        "ten steps), and the space key starts and stops the replay."
        "</figcaption></figure>\n",
        cells,
    )


def _film(episode: Episode) -> dict[str, Any]:
    """Return the data for player.js, at the time steps that the player shows."""
    kept, eyes = _kept(episode), episode.eyes
    terms = {name: np.cumsum(term, dtype=np.float64)[kept] for name, term in episode.reward_terms.items()}
    seen, columns = film_sheet(display(episode.signals[kept], episode.gain))
    perfect, _ = film_sheet(display(episode.perfect_signals[kept]))
    part = _film_of_world(episode, kept)
    return {
        "times": _rounded(kept * episode.seconds),
        "eyes": {"count": eyes.n_eyes, "resolution": eyes.resolution},
        "terms": {name: _rounded(values) for name, values in terms.items()},
        "total": _rounded(sum(terms.values(), np.zeros(len(kept)))),
        "sheet_columns": columns,
        **part,
        "sheets": {"seen": data_uri(seen), "perfect": data_uri(perfect), **part.get("sheets", {})},
    }


def _film_of_world(episode: Episode, kept: np.ndarray) -> dict[str, Any]:
    """Return data of the world for player.js: the animal's commands, and images of the scene if there are any.

    If the task has a ground plan, the data also contain positions [m] and angles [rad].

    kept: time steps that the player shows
    """
    plan = episode.plan
    part = _commands(episode, kept) | ({} if episode.pictures is None else film_of_pictures(episode.pictures, kept))
    if plan is None:
        return part
    return part | {
        "bounds": plan.bounds,
        "walls": _rounded(plan.walls),
        "goal_region": plan.goal_region,
        "body_radius": plan.body_radius,
        "azimuths": _rounded(episode.azimuths, 5),
        "fov": float(np.radians(episode.eyes.fov_deg)),
        "position": _rounded(episode.position[kept]),
        "heading": _rounded(episode.heading[kept], 4),
        "objects": _rounded(episode.objects[kept][..., :2]),
        "object_names": plan.object_names,
        "object_radius": plan.object_radius,
        "events": _events(episode, kept),
    }


def _commands(episode: Episode, kept: np.ndarray) -> dict[str, Any]:
    """Return the commands at the time steps that the player shows.

    If the commands are speed [m/s] and turn [°], the result contains them by name, and player.js shows each with its
    unit. Otherwise, the result contains the actions as plain numbers.
    """
    action = episode.action[kept]
    found = {
        command.name: command.quantity(numbers) for command, numbers in zip(episode.commands, action.T, strict=True)
    }
    if found.keys() == {"speed", "turn"}:
        return {"speed": _rounded(found["speed"]), "turn_deg": _rounded(found["turn"])}
    return {"action": _rounded(action, 2)}


def _kept(episode: Episode) -> np.ndarray:
    """Return the time steps that the player shows.

    These are all steps, or fewer if the page would become too large because of many receptors. The last step is always
    included, because it shows the whole return and the end of the episode.
    """
    pixels = episode.signals[0, :, 0].size * 3
    stride, last = max(1, -(-len(episode) * pixels // LARGEST_FILM)), len(episode) - 1
    return np.append(np.arange(0, last, stride), last)


def _events(episode: Episode, kept: np.ndarray) -> list[tuple[int, str]]:
    """Return (frame, "goal" or "adversary") for each time at which the animal reached one, sorted by frame.

    The frame is an index in `kept`, of the first shown time step that is not earlier than this event.

    kept: time steps that the player shows
    """
    found = [
        (int(np.searchsorted(kept, time)), name)
        for name in EVENTS
        for time in np.flatnonzero(episode.reward_terms.get(name, 0.0))
    ]
    return sorted((min(frame, len(kept) - 1), name) for frame, name in found)


def _rounded(values: np.ndarray, decimals: int = 3) -> Any:
    """Return nested lists of rounded numbers. Three decimals suffice for positions [m], since 1 mm is invisible."""
    return np.round(np.asarray(values, dtype=np.float64), decimals).tolist()
