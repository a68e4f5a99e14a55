"""As few rays as the receptors' noise allows, on a model of one's own: tried out, as nobody knows what there is to see.

The moments that are looked at are looked at with ever more rays, and with many more. Receptors whose whole field looks
alike need one ray, however many of them there are, and would hide what the others need: the error is judged where one
ray is not enough.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

import optics
from optics.spectra.spectrum import Spectrum
from sim.eyes.allowed_error import allowed_error
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

# Rays per receptor that are tried, and those that they are held against: behind a pupil all receptors share all rays.
PERFECT, PERFECT_TRUTH = (1, 2, 4, 8, 16, 32, 64, 128, 256), 1024
SHARED, SHARED_TRUTH = (0.25, 0.5, 1, 2, 4, 8, 16), 64
AUTO, FOLLOWED = "auto", (lighting.DIRECT, lighting.BOUNCE)
SPLIT = 0.1  # of what is allowed: a receptor that errs by more with the fewest rays has something to tell apart


@dataclass(frozen=True)
class Trials:
    """Errors of signals over the receptors that have something to tell apart (root mean square), by rays per receptor.

    share: of receptors that have
    """

    errors: Mapping[float, float]
    share: float


def choose_model_fidelity(
    model: mujoco.MjModel | mujoco.MjSpec | str,
    eye: optics.Eye,
    mounts: Sequence[Mount],
    poses: Placed,
    tolerance: float | None = None,
    *,
    groups: Sequence[int] = VISIBLE_GROUPS,
    spectra: Mapping[str, Spectrum | str] | None = None,
    varied: Varied = (),
    light: str = lighting.DIRECT,
) -> Fidelity:
    """The fewest rays for `ModelRenderer` whose error, tried at these poses, is within the tolerance; a FidelityWarning
    says where there are none. Bands are the eye's own.

    poses: moments that stand for what will be seen
    tolerance: of a signal (root mean square), over receptors that do not see the same in all of their field; None: half
        of the receptors' noise, but no less than LEAST_TOLERANCE of what white is worth behind the eye's pupil

    groups, spectra, varied: see `ModelRenderer`
    light: what of it is followed, "direct" or "bounce"; "auto": the latter where direct light alone would err by more
        than the tolerance at these moments, over receptors to which anything bounces

    Raises:
        ValueError: a tolerance that is not positive, other light, and what ModelRenderer raises.
    """
    if light not in (*FOLLOWED, AUTO):
        raise ValueError(f"light = {light!r}: must be 'direct', 'bounce' or 'auto'")
    allowed = allowed_error(eye, tolerance)
    placed = poses if isinstance(poses, Poses) else Poses.of(poses)
    scene = PreparedScene(
        source.load(model),
        eye,
        mounts_of("mounts", mounts),
        groups=groups,
        spectra=spectra,
        varied=varied,
        tracer=ModelTracer.name,
    )
    return cheapest(ModelStages(scene, placed, allowed, light))


class ModelStages:
    """Levels that a model offers, tried at moments of its worlds; see `Stages`.

    light: as `choose_model_fidelity` has it
    """

    shares: Shares | None = None

    def __init__(self, scene: PreparedScene, moments: Poses, allowed: float, light: str) -> None:
        self.eye, self.allowed = scene.eye, allowed
        self._scene, self._moments, self._light = scene, moments, light
        self._seen = cache(self._signals)

    def _signals(self, rays: float, light: str) -> np.ndarray:
        """Signals at the moments, without noise."""
        fidelity = _with(rays, self.eye, self.allowed, light)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MirrorWarning)  # whoever renders in earnest is told
            renderer = EyeRenderer(self._scene, self._moments.n, fidelity)
        return renderer.signals(self._moments)

    def bands(self) -> Level:
        """See `Stages`."""
        return Level("bands", f"{self.eye.bands}", None, "the eye's own")

    def depth(self, allowed: float) -> tuple[DepthLayers, Level | None]:
        """See `Stages`."""
        return ONE_PSF, None

    def light(self, depth: DepthLayers, allowed: float) -> Level:
        """See `Stages`."""
        return _light(self._light, lambda light: self._seen(_truth(self.eye), light), allowed)

    def samples(self, depth: DepthLayers, light: Level, allowed: Allowed) -> Samples:
        """See `Stages`."""
        ladder, most = PERFECT if self.eye.pupil is None else SHARED, allowed.error
        trials = tried(lambda rays: self._seen(rays, light.level), ladder, _truth(self.eye), most)
        rays = next((n for n, error in trials.errors.items() if error <= most), max(trials.errors))
        enough = trials.errors[rays] <= most
        why = (
            f"fewest with {most:.1e} where a receptor has something to tell apart "
            f"({trials.share:.0%} of them, at {self._moments.n} moments)"
        )
        why = why if enough else f"most that are tried; {most:.1e} is allowed"
        kind = _with(rays, self.eye, self.allowed, light.level).samples
        return Samples(kind, light, rays, Level(kind, f"{rays:g} per receptor", trials.errors[rays], why), enough)


def _light(asked: str, truth: Callable[[str], np.ndarray], allowed: float) -> Level:
    """What of the light is followed; truth: by what is followed, what is seen with very many rays."""
    if asked != AUTO:
        return Level("light", asked, None, "as asked")
    off = np.abs(truth(lighting.BOUNCE) - truth(lighting.DIRECT)).max(axis=2)
    counts = off > SPLIT * allowed
    error = float(np.sqrt(np.square(off[counts]).mean())) if counts.any() else 0.0
    missing = f"direct light misses {error:.1e} where anything bounces; {allowed:.1e} is allowed"
    if error <= allowed:
        return Level("light", lighting.DIRECT, error, missing)
    return Level("light", lighting.BOUNCE, None, missing)


def _with(rays: float, eye: optics.Eye, allowed: float, light: str) -> Fidelity:
    """So many rays; in direct light through a perfect lens at edges alone, where that pays. The truth takes no short
    cuts."""
    at_edges = light == lighting.DIRECT and eye.pupil is None and rays < PERFECT_TRUTH
    at_edges = at_edges and edges_pay(eye.resolution, rays)
    return Fidelity(rays, eye.bands, tolerance=allowed, light=light, samples=EDGES if at_edges else RAYS)


def tried(seen: Callable[[float], np.ndarray], ladder: Sequence[float], truth: float, allowed: float) -> Trials:
    """What is seen with so many rays, held against what is seen with `truth`; up to the first error that is allowed.

    seen: rays per receptor -> signals (env, eye, channel, height, width)
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


def _truth(eye: optics.Eye) -> float:
    return PERFECT_TRUTH if eye.pupil is None else SHARED_TRUTH
