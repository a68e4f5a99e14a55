"""Choice of the smallest number of rays for eyes on a user's model with which the error of signals is allowed.

The user gives one or more moments, each of which is a set of poses. Each moment is rendered with increasing numbers of
rays, and with many rays as a reference. A receptor needs only one ray if the light is the same in all parts of its
visual field (a uniform field). If most receptors have a uniform field, a mean error over all receptors would be small,
even if the others had large errors. The error is therefore computed only over receptors whose error with the smallest
number of rays exceeds a tenth of the allowed error.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

import optics
from optics.elements.turbid_medium import medium_of
from optics.numerics.arguments import one_of
from optics.spectra.spectrum import Spectrum
from sim.eyes.allowed_error import allowed_error
from sim.eyes.compound_eye import WorldEye, world_eye
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.mounts import Mount, mounts_of
from sim.render.edge_rays import edges_pay
from sim.render.eye_renderer import EyeRenderer
from sim.render.fidelity import EDGES, RAYS, Fidelity, Level
from sim.render.fidelity_choice import Allowed, Samples, Shares, cheapest
from sim.render.prepared_scene import Placed, PreparedScene
from sim.scene import source
from sim.scene.appearances import Varied
from sim.scene.mirror import VISIBLE_GROUPS, MirrorWarning
from sim.scene.poses import Poses
from sim.tracing import lighting
from sim.tracing.model_tracer import ModelTracer

# Numbers of rays per receptor to try, and that of the reference: for perfect lenses, and behind a pupil, where all
# receptors share all rays.
PERFECT, PERFECT_TRUTH = (1, 2, 4, 8, 16, 32, 64, 128, 256), 1024
SHARED, SHARED_TRUTH = (0.25, 0.5, 1, 2, 4, 8, 16), 64
AUTO, FOLLOWED = "auto", (lighting.DIRECT, lighting.BOUNCE)
# A receptor's field is uniform if the error with the fewest rays is at most this fraction of the allowed error.
SPLIT = 0.1


@dataclass(frozen=True)
class Trials:
    """Errors of signals for several numbers of rays per receptor.

    Receptors are left out if the smallest number of rays already gives them nearly the right signal. The light in the
    visual field of such a receptor is almost uniform.

    errors: root mean square error over the receptors that are not left out, for each number of rays per receptor
    share: fraction of all receptors that are not left out
    """

    errors: Mapping[float, float]
    share: float


def choose_model_fidelity(
    model: mujoco.MjModel | mujoco.MjSpec | str,
    eye: WorldEye,
    mounts: Sequence[Mount],
    poses: Placed,
    tolerance: float | None = None,
    *,
    groups: Sequence[int] = VISIBLE_GROUPS,
    spectra: Mapping[str, Spectrum | str] | None = None,
    varied: Varied = (),
    light: str = lighting.DIRECT,
    medium: optics.TurbidMedium | str | None = None,
) -> Fidelity:
    """Return a fidelity (accuracy of rendering) for `ModelRenderer`, with the smallest sufficient number of rays.

    Increasing numbers of rays are tried until the error is within the tolerance. If even the largest number is not
    enough, a FidelityWarning states by how much the tolerance is exceeded. The number of spectral bands is not chosen:
    it is the number that the eye has.

    model, eye, mounts: see `ModelRenderer`
    poses: poses at one or more moments that are typical of later use, as a list of MjData or as `sim.Poses`
    tolerance: allowed root mean square error of a signal. Receptors for which the smallest number of rays is enough are
        left out of the mean. None: half of the eye's `noise_sigma`, but at least 0.005 times the signal of a white
        surface
    groups, spectra, varied, medium: see `ModelRenderer`
    light: "direct" (one reflection) or "bounce" (up to two), see `Fidelity`. "auto" considers the receptors that light
        reaches after two reflections in these poses. If their error without this light is above the tolerance, "bounce"
        is chosen, otherwise "direct"

    Raises:
        ValueError: the tolerance is not positive and finite, `light` is unknown, or ModelRenderer refuses an argument.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    one_of("light", light, (*FOLLOWED, AUTO))
    world_eye("eye", eye)
    allowed = allowed_error(eye, tolerance)
    placed = poses if isinstance(poses, Poses) else Poses.from_data(poses)
    scene = PreparedScene(
        source.load(model),
        eye,
        mounts_of("mounts", mounts),
        groups=groups,
        spectra=spectra,
        varied=varied,
        tracer=ModelTracer.name,
        medium=medium_of("medium", medium),
    )
    return cheapest(ModelStages(scene, placed, allowed, light))


class ModelStages:
    """The stages in which the accuracy of rendering a user model is chosen, see `Stages`.

    Errors are computed by rendering the model in given poses.

    scene: the model and its eyes
    moments: one or more sets of poses, in which errors are computed
    allowed: allowed error of a signal (root mean square)
    light: see `choose_model_fidelity`
    """

    shares: Shares | None = None

    def __init__(self, scene: PreparedScene, moments: Poses, allowed: float, light: str) -> None:
        self.eye, self.allowed = scene.eye, allowed
        self._scene, self._moments, self._light = scene, moments, light
        self._cached_signals = cache(self._signals)

    def _signals(self, rays: float, light: str) -> np.ndarray:
        """Return the noise-free signals at all moments (sets of poses) at which errors are computed.

        rays: number of rays per receptor
        light: reflections that are followed: "direct" (one) or "bounce" (up to two)
        """
        fidelity = _with(rays, self.eye, self.allowed, light)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MirrorWarning)  # the final renderer repeats the warnings
            renderer = EyeRenderer(self._scene, self._moments.n, fidelity)
        return renderer.signals(self._moments)

    def bands(self) -> Level:
        """See `Stages`."""
        if (medium := self._scene.medium) is None:
            return Level("bands", f"{self.eye.bands}", None, "the eye's own")
        error = float(self.eye.throughput) * medium.band_error(self.eye.bands, self.eye.receptors)
        return Level("bands", f"{self.eye.bands}", error, "the eye's own; error for white and black in the medium")

    def depth(self, allowed: float) -> tuple[DepthLayers, Level | None]:
        """See `Stages`."""
        return ONE_PSF, None

    def light(self, depth: DepthLayers, allowed: float) -> Level:
        """See `Stages`."""
        return _light(self._light, lambda light: self._cached_signals(_truth(self.eye), light), allowed)

    def samples(self, depth: DepthLayers, light: Level, allowed: Allowed) -> Samples:
        """See `Stages`."""
        ladder, most = SHARED if _shares_rays(self.eye) else PERFECT, allowed.error
        trials = tried(lambda rays: self._cached_signals(rays, light.level), ladder, _truth(self.eye), most)
        rays = max(trials.errors)  # the first number whose error is allowed, or the largest that is tried
        enough = trials.errors[rays] <= most
        why = (
            f"fewest for {most:.1e} over receptors without a uniform field "
            f"({trials.share:.0%} of them, at {self._moments.n} moments)"
        )
        why = why if enough else f"the largest number that is tried; {most:.1e} is allowed"
        kind = _with(rays, self.eye, self.allowed, light.level).samples
        return Samples(kind, light, rays, Level(kind, f"{rays:g} per receptor", trials.errors[rays], why), enough)


def _light(asked: str, truth: Callable[[str], np.ndarray], allowed: float) -> Level:
    """Return a record of how many reflections of light are followed: "direct" (one) or "bounce" (up to two).

    The choice is the requested one or, for "auto", "direct" if its error is allowed and otherwise "bounce".

    truth: function that returns signals with many rays in "direct" or "bounce" light
    """
    if asked != AUTO:
        return Level("light", asked, None, "as requested")
    off = np.abs(truth(lighting.BOUNCE) - truth(lighting.DIRECT)).max(axis=2)
    counts = off > SPLIT * allowed
    error = float(np.sqrt(np.square(off[counts]).mean())) if counts.any() else 0.0
    missing = f"direct light misses {error:.1e} over receptors that bounced light reaches; {allowed:.1e} is allowed"
    if error <= allowed:
        return Level("light", lighting.DIRECT, error, missing)
    return Level("light", lighting.BOUNCE, None, missing)


def _with(rays: float, eye: WorldEye, allowed: float, light: str) -> Fidelity:
    """Return a fidelity with this number of rays per receptor.

    The fidelity prescribes adaptive edge sampling if the light is direct, the eye has a perfect lens, and this kind of
    sampling saves rays. The exception is the fidelity with the most rays, which is the reference for the errors of all
    others.
    """
    at_edges = light == lighting.DIRECT and _is_perfect(eye) and rays < PERFECT_TRUTH
    at_edges = at_edges and edges_pay(eye.resolution, rays)
    return Fidelity(rays, eye.bands, tolerance=allowed, light=light, samples=EDGES if at_edges else RAYS)


def tried(seen: Callable[[float], np.ndarray], ladder: Sequence[float], truth: float, allowed: float) -> Trials:
    """Return the errors of signals for increasing numbers of rays, up to the first error that is allowed.

    seen: function that maps a number of rays per receptor to signals, array (env, eye, channel, height, width)
    ladder: numbers of rays per receptor to try, in ascending order
    truth: number of rays per receptor in the reference. Errors are differences from the signals of the reference
    allowed: largest allowed error of a signal
    """
    right = seen(truth)
    errors: dict[float, float] = {}
    apart: np.ndarray | None = None
    for rays in ladder:
        off = np.abs(seen(rays) - right).max(axis=2)
        apart = off > SPLIT * allowed if apart is None else apart
        errors[rays] = float(np.sqrt(np.square(off[apart]).mean())) if apart.any() else 0.0
        if errors[rays] <= allowed:
            break
    return Trials(errors, 0.0 if apart is None else float(apart.mean()))


def _truth(eye: WorldEye) -> float:
    return SHARED_TRUTH if _shares_rays(eye) else PERFECT_TRUTH


def _is_perfect(eye: WorldEye) -> bool:
    """Return whether the eye has a perfect lens."""
    return isinstance(eye, optics.Eye) and eye.pupil is None


def _shares_rays(eye: WorldEye) -> bool:
    """Return whether receptors share all rays, as they do behind a pupil; ommatidia have their own rays."""
    return isinstance(eye, optics.Eye) and eye.pupil is not None
