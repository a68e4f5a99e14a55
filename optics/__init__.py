"""Wave optics from a light source to the signals of photoreceptors. SI units; images are (wavelength, y, x).

Start with `optics.psf`, the image of a point behind a `Pupil`, and `optics.Eye`, a pupil in front of receptors. Each
folder imports only from the folders listed above it:

numerics      arrays, transforms and interpolation, independent of optics
apertures     shapes of the pupil's opening
spectra       spectra of light and of receptors
elements      source, pupil and relief
methods       ten ways to evaluate the diffraction integral (read methods/textbook.py first)
point_spread  psf and plan: choice of the method and check of its result
propagation   propagation of sampled fields between planes
ommatidia     Ommatidium: facet lenses and rhabdoms as waveguides
eye           Eye: signals of its receptors
animals       eyes of honeybees, flies, fish, humans and other animals
torch         PSFs, camera images and signals of eyes in a PyTorch graph
"""

from importlib import import_module
from typing import Any

_CONTENTS = {
    "AcceptanceFunction": "ommatidia.acceptance",
    "AccuracyError": "numerics.accuracy",
    "Annulus": "apertures.circular",
    "AppositionEye": "ommatidia.mosaic",
    "BSplineRelief": "elements.relief",
    "BackendError": "numerics.backend",
    "BallLens": "elements.ball_lens",
    "BandMedium": "elements.turbid_medium",
    "Bitmap": "apertures.bitmap",
    "Circle": "apertures.circular",
    "Combined": "apertures.combined",
    "Cornu": "elements.refractive_index",
    "Disk": "apertures.shapes",
    "ExitPupil": "elements.exit_pupil",
    "ExitPupils": "elements.exit_pupils",
    "Eye": "eye.eye",
    "FacetLens": "ommatidia.facet",
    "Fovea": "eye.receptor_density",
    "FreeSpace": "propagation.system_elements",
    "GaussianMask": "elements.transmittance",
    "Grid": "numerics.grid",
    "HeightMap": "elements.relief",
    "HumanEye": "elements.human_eye",
    "LensMTF": "point_spread.lens_mtf",
    "MTF": "point_spread.modulation_transfer",
    "MaskMap": "elements.transmittance",
    "Microvilli": "point_spread.microvilli",
    "Misaligned": "propagation.misalignment",
    "Mode": "ommatidia.waveguide",
    "Oblong": "apertures.shapes",
    "Ommatidium": "ommatidia.ommatidium",
    "PSFBatch": "point_spread.batch",
    "PSFResult": "point_spread.psf_result",
    "PhotonBudget": "spectra.photon_budget",
    "Pigment": "spectra.pigment",
    "PixelRelief": "elements.pixel_relief",
    "Plan": "numerics.accuracy",
    "PointSource": "elements.source",
    "Polygon": "apertures.polygonal",
    "PropagationResult": "propagation.propagate",
    "Pupil": "elements.pupil",
    "ReceptorDynamics": "spectra.receptor_dynamics",
    "Receptors": "spectra.receptors",
    "RefractiveIndex": "elements.refractive_index",
    "Relief": "elements.relief",
    "Rings": "apertures.rings",
    "Sellmeier": "elements.refractive_index",
    "Slit": "apertures.polygonal",
    "Sensor": "eye.camera",
    "SpectralBands": "spectra.bands",
    "Spectrum": "spectra.spectrum",
    "Spider": "apertures.shapes",
    "StackResult": "propagation.stack_result",
    "ThroughFocus": "point_spread.through_focus",
    "TurbidMedium": "elements.turbid_medium",
    "VectorFocus": "point_spread.converging",
    "WavefrontMap": "elements.wavefront",
    "VisualStreak": "eye.receptor_density",
    "Waveguide": "ommatidia.waveguide",
    "WhitePSF": "point_spread.white",
    "Zernike": "elements.wavefront",
    "acceptance_function": "ommatidia.acceptance",
    "anatomical_acuity": "eye.acuity",
    "camera_eye": "eye.camera",
    "camera_image": "eye.camera",
    "difference": "apertures.combined",
    "encircled_energy": "point_spread.concentration",
    "eye_parameter": "eye.acuity",
    "fog": "elements.turbid_medium",
    "hexagonal_directions": "ommatidia.mosaic",
    "hexagonal_segments": "apertures.combined",
    "ideal_contrast_sensitivity": "eye.acuity",
    "illuminant": "spectra.spectrum",
    "image_quality": "point_spread.contrast",
    "immersed": "eye.immersion",
    "intersection": "apertures.combined",
    "least_eye_parameter": "eye.acuity",
    "lens_mtf": "point_spread.lens_mtf",
    "light_level": "spectra.photon_budget",
    "mean_human_mtf": "elements.human_eye",
    "medium": "elements.refractive_index",
    "mtf": "point_spread.contrast",
    "optical_sensitivity": "spectra.optical_sensitivity",
    "phase_pupil": "elements.phase_pupil",
    "plan": "point_spread.psf",
    "propagate": "propagation.propagate",
    "propagate_through": "propagation.system",
    "propagate_through_batch": "propagation.system",
    "psf": "point_spread.psf",
    "psf_batch": "point_spread.batch",
    "read_exit_pupil": "elements.exit_pupil",
    "read_exit_pupils": "elements.exit_pupils",
    "receptors_of": "spectra.receptors",
    "reflectance": "spectra.spectrum",
    "require": "numerics.backend",
    "sampling_acuity": "eye.acuity",
    "sea_water": "elements.turbid_medium",
    "snyder_acceptance": "ommatidia.ommatidium",
    "srgb_basis": "spectra.spectrum",
    "strehl_ratio": "point_spread.strehl",
    "through_focus": "point_spread.through_focus",
    "turbid_medium": "elements.turbid_medium",
    "union": "apertures.combined",
    "vector_focus": "point_spread.vector_focus",
    "white_psf": "point_spread.white",
}

__all__ = sorted(_CONTENTS)


def __getattr__(name: str) -> Any:
    if name == "animals":
        return import_module("optics.animals")
    if name not in _CONTENTS:
        raise AttributeError(f"module 'optics' has no attribute {name!r}")
    value = getattr(import_module(f"optics.{_CONTENTS[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
