"""Rendering of eyes that are mounted on any MuJoCo model, in many worlds at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import mujoco

import optics
from optics.elements.turbid_medium import medium_of
from optics.numerics.arguments import of_kind, whole
from optics.spectra.spectrum import Spectrum
from sim.eyes.compound_eye import CompoundEye, WorldEye, world_eye
from sim.eyes.mounts import Mount, mounts_of
from sim.render.eye_renderer import MOST_ENVS, EyeRenderer
from sim.render.fidelity import AREAS, Fidelity
from sim.render.prepared_scene import PreparedScene
from sim.render.renderable import check_renderable
from sim.scene import source
from sim.scene.appearances import Varied
from sim.scene.mirror import VISIBLE_GROUPS
from sim.tracing.model_tracer import ModelTracer

SIXTEEN = 16  # rays per receptor


class ModelRenderer(EyeRenderer):
    """A renderer of many worlds that share one MuJoCo model; eyes of one kind are mounted anywhere on the model.

    model: an MjModel, or a source that compiles to one (`sim.mirror`)
    eye: optics and retina of all eyes (`optics.Eye`), or a `sim.CompoundEye`; the number of bands in `fidelity` is used
        instead of the eye's own
    mounts: places of the eyes on the model, one or more `sim.Mount`
    n_envs: number of worlds
    fidelity: samples, bands, depth layers and light. None: 16 rays per receptor, direct light of lamps, and the eye's
        own bands, 4 by default. light="bounce" adds light after a second reflection, and the light of the sky and of
        glowing geoms. samples="edges" first traces four rays per receptor, and traces the full number of rays only if
        those four differ or a neighbouring receptor differs strongly; it needs a perfect lens and direct light.
        samples="areas" computes mean light by closed forms instead of rays; it needs a model of upright walls, a floor
        and spheres
    groups: visible geom groups
    spectra: reflectances of materials and emission of lights by name, instead of their colours, see `sim.mirror`
    varied: names of geoms whose size or colour may differ between worlds. Each world's sizes and colours are given with
        its poses (`sim.Poses`). A mapping such as {"floor": ("sand", "grass")} also lists materials that a geom may
        have; the colour of such a geom depends only on its material
    tracer: "mitsuba" (any shapes), "closed_form" (upright walls, a floor and spheres), or "auto": the closed form if
        the model has one. Compound eyes need "mitsuba". The tracer in use is in `.tracer.name`
    medium: water or air between surfaces and eyes, see `sim.build_world`
    brightest: attribute, the signal of a white surface that faces all directional lights at once, or the signal of
        veiling light if that is larger

    One warning (`sim.MirrorWarning`) lists features of the model that are not rendered. Further warnings name lamps
    with spectral lines for which the eye has too few bands.

    Raises:
        ValueError: an argument is invalid, the model lacks the part on which an eye is mounted, an eye has an
            eccentricity, the model does not support the fidelity, or the rays do not fit into memory. No eye may be
            inside a primitive or a closed mesh in the model's reference pose.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """

    def __init__(
        self,
        model: mujoco.MjModel | mujoco.MjSpec | str,
        eye: WorldEye,
        mounts: Sequence[Mount],
        n_envs: int = 1,
        fidelity: Fidelity | None = None,
        *,
        groups: Sequence[int] = VISIBLE_GROUPS,
        spectra: Mapping[str, Spectrum | str] | None = None,
        varied: Varied = (),
        tracer: str = "mitsuba",
        medium: optics.TurbidMedium | str | None = None,
    ) -> None:
        whole("n_envs", n_envs, 1, MOST_ENVS)
        world_eye("eye", eye)
        of_kind("tracer", tracer, str, "'mitsuba'")
        if isinstance(eye, CompoundEye) and tracer != ModelTracer.name:
            raise ValueError(f"tracer = {tracer!r}: must be {ModelTracer.name!r} for a compound eye")
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
            medium=medium_of("medium", medium),
        )
        super().__init__(scene, n_envs, fidelity)
