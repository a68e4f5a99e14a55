"""Eyes mounted on any MuJoCo model, seen through in many worlds at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TypeAlias

import mujoco
import numpy as np

import optics
from optics.numerics.arguments import of_kind, whole
from optics.spectra.spectrum import Spectrum
from sim.eyes.mounts import Mount, mounts_of
from sim.render.eye_renderer import MOST_ENVS, EyeRenderer
from sim.render.fidelity import AREAS, Fidelity
from sim.render.labels import Labels
from sim.render.pending_frame import PendingFrame
from sim.render.prepared_scene import PreparedScene
from sim.render.renderable import check_renderable
from sim.scene import source
from sim.scene.appearances import Varied
from sim.scene.mirror import VISIBLE_GROUPS
from sim.scene.poses import Poses
from sim.tracing.eye_places import EyeFrames

SIXTEEN = 16  # rays per receptor
Worlds: TypeAlias = Poses | Sequence[mujoco.MjData] | mujoco.MjData  # where everything is in all of them


class ModelRenderer(EyeRenderer):
    """Sees many worlds of one model with eyes of one kind, wherever they are mounted on it.

    model: an MjModel, or what compiles to one (`sim.mirror`)
    eye: its optics and retina; its bands are the fidelity's
    mounts: where on the model the eyes are
    n_envs: number of worlds
    fidelity: rays per receptor and bands; None: 16 rays in the direct light of lamps and the eye's own bands, 4 by
        default. light="bounce" adds light that is reflected twice, and what the sky and what glows send;
        samples="edges" for that many rays only where a few of them differ, in direct light; samples="areas" without
        rays, in closed form, where the model has one
    groups, spectra: see `sim.mirror`
    varied: names of geoms whose size or colour may differ from world to world: as `poses` say, by the worlds' mjModels;
        {"floor": ("sand", "grass")}: and names of the materials that one may have, in the place of other colours
    tracer: "mitsuba" (any shapes), "closed_form" (upright walls, a floor and spheres), or "auto": the latter, where the
        model has it. The one in use is in `.tracer.name`
    brightest: signal of a white surface that faced all directional lights at once

    Warns (`sim.MirrorWarning`) once of what eyes do not see of the model, and of lamps with lines in too few bands.

    Raises:
        ValueError: a bad argument, a mount on what the model does not have, an eye that looks aside of it, or is inside
            of a sphere, a capsule, another primitive or a closed mesh in the model's reference pose, a fidelity that
            the model cannot have, or more rays than there is memory for.
        optics.AccuracyError: a pupil whose light spreads too far.
    """

    def __init__(
        self,
        model: mujoco.MjModel | mujoco.MjSpec | str,
        eye: optics.Eye,
        mounts: Sequence[Mount],
        n_envs: int = 1,
        fidelity: Fidelity | None = None,
        *,
        groups: Sequence[int] = VISIBLE_GROUPS,
        spectra: Mapping[str, Spectrum | str] | None = None,
        varied: Varied = (),
        tracer: str = "mitsuba",
    ) -> None:
        whole("n_envs", n_envs, 1, MOST_ENVS)
        of_kind("eye", eye, optics.Eye, "optics.Eye(resolution=(15, 15))")
        fidelity = Fidelity(SIXTEEN, eye.bands) if fidelity is None else fidelity
        of_kind("fidelity", fidelity, Fidelity, "Fidelity(16, bands=4)")
        if fidelity.samples == AREAS and tracer == "mitsuba":
            tracer = "auto"
        eye = replace(eye, bands=fidelity.bands)
        check_renderable(fidelity, eye)
        scene = PreparedScene(
            source.load(model),
            eye,
            mounts_of("mounts", mounts),
            spectra=spectra,
            groups=groups,
            varied=varied,
            tracer=tracer,
        )
        super().__init__(scene, n_envs, fidelity)

    def signals(self, poses: Worlds, light: np.ndarray | None = None) -> np.ndarray:
        """See `EyeRenderer.signals`.

        poses: of every world, after mj_forward or mj_step: its data, or arrays stacked over worlds; the data of an only
            world need not be in a list
        """
        return super().signals(_placed(poses), light)

    def begin(self, poses: Worlds, light: np.ndarray | None = None) -> PendingFrame:
        """Begin to see; it runs beside whatever comes next, until the signals are waited for."""
        return super().begin(_placed(poses), light)

    def receptor_radiance(self, poses: Worlds) -> np.ndarray:
        """Spectral radiance averaged over every receptor's field, (band, env, eye, height, width) float32."""
        return super().receptor_radiance(_placed(poses))

    def depth(self, poses: Worlds) -> np.ndarray:
        """See `Labels.depth`."""
        return self._labels.depth(_placed(poses))

    def ids(self, poses: Worlds) -> np.ndarray:
        """See `Labels.ids`."""
        return self._labels.ids(_placed(poses))

    def flow(self, poses: Worlds, later: Worlds) -> np.ndarray:
        """See `Labels.flow`."""
        return self._labels.flow(_placed(poses), _placed(later))

    def eye_frames(self, poses: Worlds) -> EyeFrames:
        """Pupils [m] (world, eye, 3) and eyes' frames (world, eye, 3, 3), columns (right, up, ahead)."""
        return super().eye_frames(_placed(poses))

    @property
    def recordings(self) -> int:
        """How often the kernels were recorded: once per kernel in use, up to three times where meshes move."""
        return super().recordings + (self._labels.recordings if "_labels" in vars(self) else 0)

    @cached_property
    def _labels(self) -> Labels:
        return Labels(self.scene, self.n_envs)


def _placed(poses: Worlds) -> Poses:
    return poses if isinstance(poses, Poses) else Poses.of(poses)
