"""Images at one time of an episode: the scene, and the signals of each eye with and without noise.

For eyes with a lens, signals behind a perfect lens are also shown.
"""

from __future__ import annotations

import numpy as np

import optics
from evolve.analysis.statistics import psnr
from evolve.episodes.episode import Episode
from evolve.report.hints import hint
from evolve.report.markup import Html, html, joined, rounded, style
from evolve.report.picture import data_uri, display
from sim.eyes.compound_eye import WorldEye

__all__ = ["through_optics", "what_it_sees"]

WIDTH = 200  # length of the longer side of an image [CSS pixels]
MOST_EYES = 6  # maximum number of eyes that are shown


def what_it_sees(episode: Episode) -> Html:
    """Return the images of up to 6 eyes, with a caption, at the time at which the scene has most detail."""
    frame = _busiest(episode)
    time = int(episode.radiance_frames[frame])
    lens, names, gain = episode.eyes.eye(), episode.eyes.names(), episode.gain
    shown = range(min(len(names), MOST_EYES))
    rows = joined(_row(episode, eye, names[eye], frame, lens) for eye in shown)
    brighter = f", brightened {rounded(gain)} times (1/a²)" if gain != 1 else ""
    rest = f" Only the first {MOST_EYES} of {len(names)} eyes are shown." if len(names) > MOST_EYES else ""
    quality = psnr(episode.signals, episode.perfect_signals, gain)
    if not isinstance(lens, optics.Eye):
        caption = html(
            "<b>Views</b> at {} s of the episode above, from left to right: the scene's {} on a fine grid; the {}s of "
            "the ommatidia without noise, in rows; and the same signals with noise, which are the input of the brain.{}"
            " Over the whole episode the signals have a PSNR of {} dB relative to those without noise.",
            *(rounded(time * episode.seconds), hint("radiance"), hint("signal"), rest, rounded(quality)),
        )
        return _figure(rows, caption)
    caption = html(
        "<b>Views</b> at {} s of the episode above, from left to right: the scene's {} on a fine grid; the {}’ {}s "
        "behind a perfect lens; the signals behind the eye's own optics, without noise{}; and the same signals with "
        "noise, which are the input of the brain.{} Over the whole episode the signals have a PSNR of {} dB relative "
        "to those of the perfect lens.",
        *(rounded(time * episode.seconds), hint("radiance"), hint("receptor", "receptors"), hint("signal")),
        *(brighter, rest, rounded(quality)),
    )
    return _figure(rows, caption)


def _figure(rows: Html, caption: Html) -> Html:
    return html('<figure class="views"><div class="eyes">{}</div><figcaption>{}</figcaption></figure>\n', rows, caption)


def _busiest(episode: Episode) -> int:
    """Return the index of the recorded radiance with most detail.

    Detail is measured as the variance of radiance in the horizontal direction. Variance in the vertical direction is
    ignored, because every image shows the sky above the floor.
    """
    return int(np.argmax(episode.radiance.mean(axis=2).var(axis=-1).mean(axis=(1, 2))))


def _row(episode: Episode, eye: int, name: str, frame: int, lens: WorldEye) -> Html:
    time = episode.radiance_frames[frame]
    scene = np.einsum("cb,byx->cyx", lens.spectral_bands.weights, episode.radiance[frame, eye])
    gain = 1 / lens.white_signal
    perfect, noisy = display(episode.perfect_signals[time, eye]), display(episode.signals[time, eye], gain)
    pictures = [("scene", display(scene)), ("no noise", perfect), ("noise", noisy)]
    if isinstance(lens, optics.Eye):
        clean = display(through_optics(lens, episode.radiance[frame, eye]), gain)
        pictures = [
            *(("scene", display(scene)), ("perfect lens", perfect)),
            *(("own optics, no noise", clean), ("own optics, noise", noisy)),
        ]
    aspect = episode.eyes.field_aspect
    size = style(f"width:{WIDTH * min(aspect, 1):.4g}px;aspect-ratio:{aspect:.4g}")
    cells = joined(
        html('<div><img src="{}" {} alt="{} eye: {}"><span>{}</span></div>', data_uri(pixels), size, name, label, label)
        for label, pixels in pictures
    )
    return html('<div class="sight"><span class="name">{}</span><div class="pair">{}</div></div>', name, cells)


def through_optics(eye: optics.Eye, radiance: np.ndarray) -> np.ndarray:
    """Return the noise-free signals of an eye in front of a scene, (channel, height, width).

    The image of the scene is padded with the values at its edges, by the reach of the eye's kernel, but at most by the
    width of the image.

    radiance: radiance of the scene, (band, y, x), with a whole number of pixels for each receptor
    """
    samples = radiance.shape[-1] // eye.resolution[1]
    reach = min(max(eye.kernel(samples).shape[1:]) // 2, radiance.shape[-1])
    # A cell of the image may be wider than a rhabdom's receptive field. Its centre would then not represent the field.
    sight = eye.sight(samples, light_from="centres" if eye.waveguide is None else "cells")
    return eye.see(np.pad(radiance, ((0, 0), (reach, reach), (reach, reach)), mode="edge"), samples, sight=sight)
