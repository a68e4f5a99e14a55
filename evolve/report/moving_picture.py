"""Export of an episode as a GIF or a video, with the world next to the signals of the animal's eyes."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from evolve.config.run_config import ConfigError
from evolve.episodes.episode import Episode
from evolve.report.picture import display
from evolve.report.theme import ACCENT, GREEN, INK, MUTED, PANEL, PAPER, VERMILLION
from evolve.store.atomic_files import unfinished, write_whole
from sim.worlds.ground_plan import GroundPlan

__all__ = ["require_ffmpeg", "write_gif", "write_mp4"]

HEIGHT, ASIDE, GAP = 320, 320, 10  # [pixels] height of a frame, maximum width of all eyes, and gaps around eyes
INSET = 0.36  # height of the plan within a rendered image, relative to that of the image
SMOOTH = 2  # factor by which the plan is drawn larger before it is reduced, so that edges are smooth
SPEED = 2.0  # speed relative to real time
LONGEST = 150  # maximum number of frames in a GIF, which limits its size, because noise hardly compresses
FIELD = "#c9e0ef"  # colour of fields of view
OWN = (INK, MUTED, PAPER, PANEL, ACCENT, VERMILLION, GREEN, FIELD)
COLOURS = 64  # size of a GIF's palette; more colours would mainly store noise of receptors, and files would be larger
SAMPLES = 8  # frames from which the palette's colours are chosen


def write_gif(episode: Episode, path: Path) -> Path:
    """Write an episode as a repeating GIF, and return its path. The file is written completely or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    stride = max(1, -(-len(episode) // LONGEST))
    frames = list(_frames(episode, stride))
    palette = _palette(frames[:: -(-len(frames) // SAMPLES)])
    first, *rest = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in frames)
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
    """Write an episode as an H.264 video with a frame for each action, and return its path.

    The file is written completely or not at all.

    Raises:
        ConfigError: ffmpeg is not installed.
        OSError: the file cannot be written.
    """
    frames = _frames(episode, stride=1)
    first = next(frames)
    # H.264 stores one colour for each square of four pixels, so width and height must be even.
    width, height = (2 * (n // 2) for n in first.size)
    with unfinished(path) as neighbour:
        film = require_ffmpeg().write_frames(
            str(neighbour),
            (width, height),
            fps=SPEED / episode.seconds,
            quality=8,
            codec="libx264",
            macro_block_size=2,
            output_params=["-f", "mp4", "-movflags", "+faststart"],  # the temporary file's name does not end in .mp4
        )
        film.send(None)
        for picture in chain([first], frames):
            film.send(picture.crop((0, 0, width, height)).tobytes())
        film.close()
    return path


def _frames(episode: Episode, stride: int) -> Iterator[Image.Image]:
    """Return the frames of an episode, at every `stride`-th time step."""
    eyes = display(episode.signals, episode.gain)
    times, aspect = range(0, len(episode), stride), episode.eyes.field_aspect
    return (_frame(_world(episode, time), eyes[time], aspect) for time in times)


def _palette(samples: list[Image.Image]) -> Image.Image:
    """Return the palette of a GIF: colours of ground plan and background, and representative colours of sample frames.

    The representative colours are selected by median cut.
    """
    own = [int(name[i : i + 2], 16) for name in OWN for i in (1, 3, 5)]
    strip = Image.fromarray(np.concatenate([np.asarray(picture) for picture in samples], axis=1))
    frequent = strip.quantize(COLOURS - len(OWN), method=Image.Quantize.MEDIANCUT).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette(own + frequent)
    return palette


def _world(episode: Episode, time: int) -> Image.Image:
    """Return an image of the world at one time: the latest rendered image, with the ground plan in its corner.

    The plan, if there is one, is at the lower left. Without rendered images, it fills the image. Without
    both, the image has the width 0.
    """
    pictures, above = episode.pictures, None if episode.plan is None else _from_above(episode, episode.plan, time)
    if pictures is None:
        return Image.new("RGB", (0, HEIGHT)) if above is None else above
    view = Image.fromarray(pictures.pixels[int(np.searchsorted(pictures.times, time, side="right")) - 1])
    view = view.resize((round(view.width * HEIGHT / view.height), HEIGHT), Image.Resampling.LANCZOS)
    if above is not None:
        small = above.resize((round(INSET * above.width), round(INSET * HEIGHT)), Image.Resampling.LANCZOS)
        view.paste(small, (GAP, HEIGHT - GAP - small.height))
    return view


def _from_above(episode: Episode, plan: GroundPlan, time: int) -> Image.Image:
    """Return an image of the world from above, drawn from its ground plan.

    The image is as high as a frame of the GIF or video, 320 pixels.

    time: number of the time step in the episode
    """
    x0, y0, x1, y1 = plan.bounds
    scale = SMOOTH * HEIGHT / (y1 - y0)
    width = round((x1 - x0) * scale / SMOOTH)
    world = Image.new("RGB", (SMOOTH * width, SMOOTH * HEIGHT), PANEL)
    _draw_world(ImageDraw.Draw(world), episode, plan, time, scale)
    return world.resize((width, HEIGHT), Image.Resampling.LANCZOS)


def _frame(world: Image.Image, seen: np.ndarray, aspect: float) -> Image.Image:
    """Return one frame: the world on the left, and an image of each eye's signals on the right.

    The images of the eyes are arranged in rows.

    world: image of the world at the time of the frame
    seen: signals of the eyes as pixels, (eye, y, x, 3)
    aspect: width of a field of view divided by its height
    """
    columns = max(range(1, len(seen) + 1), key=lambda number: _eye_height(len(seen), number, aspect))
    rows, high = -(-len(seen) // columns), _eye_height(len(seen), columns, aspect)
    shape = max(1, round(aspect * high)), max(1, round(high))
    picture = Image.new("RGB", (world.width + columns * (GAP + shape[0]), HEIGHT), PAPER)
    picture.paste(world, (0, 0))
    for number, one in enumerate(seen):
        row, column = divmod(number, columns)
        grown = Image.fromarray(np.ascontiguousarray(one)).resize(shape, Image.Resampling.NEAREST)
        picture.paste(grown, (world.width + GAP + column * (shape[0] + GAP), round(row * (HEIGHT + GAP) / rows)))
    return picture


def _eye_height(eyes: int, columns: int, aspect: float) -> float:
    """Return the greatest height [pixels] at which the images of all eyes fit into a frame in `columns` columns.

    aspect: width of an image divided by its height
    """
    rows = -(-eyes // columns)
    return min((HEIGHT - GAP * (rows - 1)) / rows, (ASIDE - GAP * (columns - 1)) / columns / aspect)


def _draw_world(draw: ImageDraw.ImageDraw, episode: Episode, plan: GroundPlan, time: int, scale: float) -> None:
    """Draw walls, the goal region if there is one, objects, the path so far, fields of view and the agent.

    scale: pixels per metre in this drawing, which is reduced in size afterwards
    """

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
