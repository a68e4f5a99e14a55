"""One moment of an episode: the scene before each eye, through a perfect lens, and through the evolved optics."""

from __future__ import annotations

import numpy as np

import optics
from evolve.analysis.episode import Episode
from evolve.analysis.statistics import psnr
from evolve.report.hints import hint
from evolve.report.markup import Html, html, joined, look, rounded
from evolve.report.picture import data_uri, display

__all__ = ["through", "what_it_sees"]

WIDTH = 120  # CSS pixels of one picture, where there are few eyes
MOST_EYES = 6


def what_it_sees(episode: Episode) -> Html:
    """Pictures and their caption."""
    frame = _busiest(episode)
    time = int(episode.radiance_frames[frame])
    lens, names, gain = episode.eyes.eye(), episode.eyes.names(), episode.gain
    shown = range(min(len(names), MOST_EYES))
    rows = joined(_row(episode, eye, names[eye], frame, lens) for eye in shown)
    brighter = f", brightened {rounded(gain)} times (1/a²)" if gain != 1 else ""
    rest = f" The first {MOST_EYES} of {len(names)} eyes." if len(names) > MOST_EYES else ""
    quality = psnr(episode.signals, episode.perfect_signals, gain)
    caption = html(
        "<b>What it sees</b> at {} s of the episode above, left to right: the scene's {}, finely sampled; what its "
        "{} would {} behind a perfect lens; what its own optics make of it{}; and the same with the "
        "receptors' noise, as the brain gets it.{} Over the whole episode the signals have a PSNR of {} dB against "
        "the perfect lens.",
        *(rounded(time * episode.seconds), hint("radiance"), hint("receptor", "receptors"), hint("signal")),
        *(brighter, rest, rounded(quality)),
    )
    return html('<figure class="views"><div class="eyes">{}</div><figcaption>{}</figcaption></figure>\n', rows, caption)


def _busiest(episode: Episode) -> int:
    """The kept frame in which the eyes have most to look at: the largest variance along the horizon (sky above floor
    is there in all of them)."""
    return int(np.argmax(episode.radiance.mean(axis=2).var(axis=-1).mean(axis=(1, 2))))


def _row(episode: Episode, eye: int, name: str, frame: int, lens: optics.Eye) -> Html:
    time = episode.radiance_frames[frame]
    scene = np.einsum("cb,byx->cyx", lens.spectral_bands.weights, episode.radiance[frame, eye])
    gain = 1 / lens.white_signal
    pictures = (
        ("scene", display(scene)),
        ("perfect lens", display(episode.perfect_signals[time, eye])),
        ("own optics, no noise", display(through(lens, episode.radiance[frame, eye]), gain)),
        ("own optics, noise", display(episode.signals[time, eye], gain)),
    )
    height, width = episode.signals.shape[-2:]
    scale = WIDTH / max(height, width)
    size = look(f"width:{scale * width:.4g}px;aspect-ratio:{width}/{height}")
    cells = joined(
        html('<div><img src="{}" {} alt="{} eye: {}"><span>{}</span></div>', data_uri(pixels), size, name, label, label)
        for label, pixels in pictures
    )
    return html('<div class="sight"><span class="name">{}</span><div class="pair">{}</div></div>', name, cells)


def through(eye: optics.Eye, radiance: np.ndarray) -> np.ndarray:
    """Noise-free signals (channel, h, w) of the radiance (band, y, x) before an eye; at the picture's edge the scene
    is taken to go on as it ends, as far as the eye's kernel reaches (at most a picture's width)."""
    samples = radiance.shape[-1] // eye.resolution[1]
    reach = min(max(eye.kernel(samples).shape[1:]) // 2, radiance.shape[-1])
    # Cells may be wider than what a rhabdom sees, and their centres say little of it then.
    sight = eye.sight(samples, light_from="centres" if eye.waveguide is None else "cells")
    return eye.see(np.pad(radiance, ((0, 0), (reach, reach), (reach, reach)), mode="edge"), samples, sight=sight)
