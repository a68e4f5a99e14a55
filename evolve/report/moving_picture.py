"""An episode as a GIF or video: the world from above with the agent's path, next to its eyes' signals."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from evolve.analysis.episode import Episode
from evolve.config.run_config import ConfigError
from evolve.report.picture import display
from evolve.report.theme import ACCENT, GREEN, INK, MUTED, PANEL, PAPER, VERMILLION
from evolve.store.atomic_files import unfinished, write_whole
from sim.worlds.ground_plan import GroundPlan

__all__ = ["require_ffmpeg", "write_gif", "write_mp4"]

HEIGHT, ASIDE, GAP = 320, 150, 10  # height, maximum width of the eyes' column, and gap, in pixels
SMOOTH = 2  # scale of the drawing before it is reduced, for smooth edges
SPEED = 2.0  # relative to real time
LONGEST = 150  # maximum number of frames, because noise hardly compresses
FIELD = "#c9e0ef"  # fields of view
OWN = (INK, MUTED, PAPER, PANEL, ACCENT, VERMILLION, GREEN, FIELD)
LEVELS = (0, 51, 102, 153, 204, 255)  # values of red, green and blue for the eyes' signals


def write_gif(episode: Episode, path: Path) -> Path:
    """Write an episode as a repeating GIF, completely or not at all, and return its path."""
    stride = max(1, -(-len(episode) // LONGEST))
    palette = _palette()
    first, *rest = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in _frames(episode, stride))
    content = io.BytesIO()
    pause = round(1000 * stride * episode.seconds / SPEED)
    first.save(content, "GIF", save_all=True, append_images=rest, duration=pause, loop=0, optimize=True)
    write_whole(path, content.getvalue())
    return path


def require_ffmpeg() -> Any:
    """Return the package imageio_ffmpeg, which runs ffmpeg as a program.

    Raises:
        ConfigError: the package is not installed, or has no ffmpeg for this system.
    """
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise ConfigError("--mp4 needs ffmpeg: pip install 'rhabdom[video]'") from None
    return imageio_ffmpeg


def write_mp4(episode: Episode, path: Path) -> Path:
    """Write an episode as an H.264 video with a frame for each action, completely or not at all; return its path.

    Raises:
        ConfigError: ffmpeg is not installed.
    """
    frames = _frames(episode, stride=1)
    first = next(frames)
    # Colours are stored for squares of four pixels, so width and height must be even.
    width, height = (2 * (n // 2) for n in first.size)
    with unfinished(path) as neighbour:
        film = require_ffmpeg().write_frames(
            str(neighbour),
            (width, height),
            fps=SPEED / episode.seconds,
            quality=8,
            codec="libx264",
            macro_block_size=2,
            output_params=["-f", "mp4", "-movflags", "+faststart"],  # a temporary file has no format ending
        )
        film.send(None)
        for picture in chain([first], frames):
            film.send(picture.crop((0, 0, width, height)).tobytes())
        film.close()
    return path


def _frames(episode: Episode, stride: int) -> Iterator[Image.Image]:
    """Return the frames at every stride-th time."""
    eyes = display(episode.signals, episode.gain)
    return (_frame(_world(episode, time), eyes[time]) for time in range(0, len(episode), stride))


def _palette() -> Image.Image:
    """Return the palette of all frames: the drawing's colours and a colour cube."""
    own = [int(name[i : i + 2], 16) for name in OWN for i in (1, 3, 5)]
    cube = [level for colour in product(LEVELS, repeat=3) for level in colour]
    palette = Image.new("P", (1, 1))
    palette.putpalette(own + cube)
    return palette


def _world(episode: Episode, time: int) -> Image.Image:
    """Return the world from above at one time; without a ground plan, the latest rendered image, or nothing."""
    plan, pictures = episode.plan, episode.pictures
    if plan is None:
        if pictures is None:
            return Image.new("RGB", (0, HEIGHT))
        picture = Image.fromarray(pictures.pixels[int(np.searchsorted(pictures.times, time, side="right")) - 1])
        return picture.resize((round(picture.width * HEIGHT / picture.height), HEIGHT), Image.Resampling.LANCZOS)
    x0, y0, x1, y1 = plan.bounds
    scale = SMOOTH * HEIGHT / (y1 - y0)
    width = round((x1 - x0) * scale / SMOOTH)
    world = Image.new("RGB", (SMOOTH * width, SMOOTH * HEIGHT), PANEL)
    _draw_world(ImageDraw.Draw(world), episode, plan, time, scale)
    return world.resize((width, HEIGHT), Image.Resampling.LANCZOS)


def _frame(world: Image.Image, seen: np.ndarray) -> Image.Image:
    """Return one frame: the world on the left, and the eyes one below the other on the right."""
    width = world.width
    room = (HEIGHT - GAP * (len(seen) - 1)) / len(seen)
    size = min(ASIDE / seen.shape[2], room / seen.shape[1])
    picture = Image.new("RGB", (width + GAP + round(seen.shape[2] * size), HEIGHT), PAPER)
    picture.paste(world, (0, 0))
    for number, one in enumerate(seen):
        shape = max(1, round(one.shape[1] * size)), max(1, round(one.shape[0] * size))
        grown = Image.fromarray(np.ascontiguousarray(one)).resize(shape, Image.Resampling.NEAREST)
        picture.paste(grown, (width + GAP, round(number * (room + GAP))))
    return picture


def _draw_world(draw: ImageDraw.ImageDraw, episode: Episode, plan: GroundPlan, time: int, scale: float) -> None:
    """Draw walls, objects, path so far, fields of view and the agent, in pixels of the large drawing."""

    def place(x: float, y: float) -> tuple[float, float]:
        return (x - plan.bounds[0]) * scale, (plan.bounds[3] - y) * scale

    for x, y, half_x, half_y in plan.walls:
        draw.rectangle((*place(x - half_x, y + half_y), *place(x + half_x, y - half_y)), fill=MUTED)
    if plan.goal_region is not None:
        low_x, low_y, high_x, high_y = plan.goal_region
        draw.rectangle((*place(low_x, high_y), *place(high_x, low_y)), outline=GREEN, width=3 * SMOOTH)
    here = place(*episode.position[time])
    for azimuth in episode.azimuths:
        towards = math.degrees(float(episode.heading[time]) + float(azimuth))
        half, reach = episode.eyes.fov_deg / 2, 0.22 * HEIGHT * SMOOTH
        box = (here[0] - reach, here[1] - reach, here[0] + reach, here[1] + reach)
        draw.pieslice(box, -towards - half, -towards + half, fill=FIELD, outline=ACCENT)
    draw.line([place(*at) for at in episode.position[: time + 1]] or [here], fill=INK, width=SMOOTH)
    for name, radius, (x, y) in zip(plan.object_names, plan.object_radius, episode.objects[time][:, :2], strict=True):
        _disk(draw, place(x, y), radius * scale, GREEN if name.startswith("goal") else VERMILLION)
    _disk(draw, here, max(plan.body_radius * scale, 5 * SMOOTH), INK)


def _disk(draw: ImageDraw.ImageDraw, at: tuple[float, float], radius: float, colour: str) -> None:
    draw.ellipse((at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius), fill=colour)
