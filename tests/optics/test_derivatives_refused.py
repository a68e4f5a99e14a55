"""Functions without derivatives report this: none is dropped without an error."""

import drjit as dr
import numpy as np
import pytest

import optics
from tests.optics.device_types import Float64, TensorXf64

PUPIL = optics.Pupil(10e-6, thin_lens_focal_length=100e-6)
WIDE = optics.Pupil(1e-3, thin_lens_focal_length=1e-3)
EYE = optics.Eye(PUPIL, resolution=(5, 5))
FIELD = np.ones((4, 4), dtype=complex)


def asking(value):
    found = Float64(value)
    dr.enable_grad(found)
    return found


def asking_map(shape):
    found = TensorXf64(np.ones(shape))
    dr.enable_grad(found)
    return found


def a_picture():
    return optics.psf(PUPIL, shape=(9, 9))


def seen_by_a_rhabdom(pupil):
    return optics.Ommatidium(pupil, optics.Waveguide(2e-6)).sensitivity(0.0, 0.0)


def corners():
    found = TensorXf64(np.array([[0.5, 0], [0, 0.5], [-0.5, 0]]))
    dr.enable_grad(found)
    return found


DROPPED = {
    "wavelength": lambda: optics.psf(PUPIL, [asking(550e-9)]),
    "wavelengths": lambda: optics.psf(PUPIL, asking([500e-9, 600e-9])),
    "source_angle": lambda: optics.vector_focus(WIDE, source_angle=(asking(0.1), 0.0)),
    "centre": lambda: optics.psf(PUPIL, centre=(0.0, asking(1e-6))),
    "dx": lambda: optics.psf(PUPIL, dx=asking(1e-6)),
    "object_n": lambda: optics.Pupil(10e-6, object_n=asking(1.3)),
    "medium_n of a curve": lambda: optics.Pupil(10e-6, medium_n=optics.RefractiveIndex(asking(1.3))),
    "c of a curve": lambda: optics.RefractiveIndex(1.3, 0.0, asking(1e-28)),
    "strengths of a curve": lambda: optics.Sellmeier((asking(0.5),), (0.1,)),
    "b_um of a curve": lambda: optics.Cornu(1.3, asking(0.005), 0.2),
    "diameter of a rhabdom": lambda: optics.Waveguide(asking(2e-6)),
    "diameter of a facet": lambda: optics.FacetLens(asking(2e-6), 1e-5),
    "radius_front of a facet": lambda: optics.FacetLens(2e-5, asking(1e-5)),
    "lens": lambda: seen_by_a_rhabdom(optics.Pupil(1e-5, thin_lens_focal_length=asking(5e-5))),
    "lens.mask": lambda: seen_by_a_rhabdom(
        optics.Pupil(1e-5, thin_lens_focal_length=5e-5, mask=optics.GaussianMask(asking(1e-5)))
    ),
    "aperture_radius": lambda: seen_by_a_rhabdom(optics.Pupil(asking(1e-5), thin_lens_focal_length=5e-5)),
    "full_aperture": lambda: optics.Eye(full_aperture=asking(1e-3)),
    "eccentricity_deg": lambda: optics.Eye(eccentricity_deg=(asking(1.0), 0.0)),
    "medium_n": lambda: optics.Pupil(10e-6, medium_n=asking(1.3)),
    "inner": lambda: optics.Annulus(asking(0.5)),
    "width": lambda: optics.Slit(asking(0.5), 1.0),
    "radius of a disk": lambda: optics.Disk(asking(0.5)),
    "centre of a disk": lambda: optics.Disk(0.5, (asking(0.5), 0.0)),
    "width of a rectangle": lambda: optics.Oblong(asking(0.5), 1.0),
    "rotation_deg of a rectangle": lambda: optics.Oblong(0.5, 1.0, rotation_deg=asking(1.0)),
    "width of a spider": lambda: optics.Spider(3, asking(0.1)),
    "radii of rings": lambda: optics.Rings([0.1, asking(0.5)]),
    "focal_length of a zone plate": lambda: optics.Rings.zone_plate(1e-4, asking(1e-3)),
    "gap": lambda: optics.hexagonal_segments(1, asking(0.1)),
    "reach of a mask": lambda: optics.MaskMap(np.ones((4, 4)), reach=asking(1e-3)),
    "height": lambda: optics.Slit(0.5, asking(1.0)),
    "vertices": lambda: optics.Polygon(corners()),
    "abbe_number": lambda: optics.RefractiveIndex.from_abbe(1.5, asking(58.0)),
    "radius": lambda: optics.Zernike([0.1], radius=asking(1e-3)),
    "coefficients_um": lambda: optics.Zernike([0.1, asking(0.2)]),
    "radii": lambda: optics.encircled_energy(optics.psf(PUPIL, shape=(9, 9)), asking(1e-6)),
    "nyquist": lambda: optics.image_quality(optics.psf(PUPIL, shape=(9, 9)), asking(1e5)),
    "noise_sigma": lambda: optics.image_quality(optics.psf(PUPIL, shape=(9, 9)), 1e5, 1.0, asking(0.1)),
    "centre of a window on the axis": lambda: optics.psf(PUPIL, centre=(asking(0.0), 0.0)),
    "tolerance": lambda: optics.psf(PUPIL, tolerance=asking(1e-3)),
    "shape": lambda: optics.psf(PUPIL, shape=(asking(9.0), 9)),
    "wavelengths of a batch": lambda: optics.psf_batch([PUPIL], asking([500e-9])),
    "waves": lambda: optics.white_psf(PUPIL, waves=asking(31.0)),
    "light": lambda: optics.white_psf(PUPIL, lambda wavelengths: asking(np.ones(len(wavelengths)))),
    "pupil of a vector focus": lambda: optics.vector_focus(optics.Pupil(asking(1e-3), thin_lens_focal_length=1e-3)),
    "pupil of a vector focus, its lens": lambda: optics.vector_focus(
        optics.Pupil(1e-3, thin_lens_focal_length=asking(1e-3))
    ),
    "sensor_distance of a vector focus": lambda: optics.vector_focus(WIDE, sensor_distance=asking(1e-3)),
    "polarization": lambda: optics.vector_focus(WIDE, polarization=(asking(1.0), 0.0)),
    "sensor_width": lambda: optics.Eye(PUPIL, sensor_width=asking(2e-4)),
    "noise_sigma of an eye": lambda: optics.Eye(PUPIL, noise_sigma=asking(0.1)),
    "bands": lambda: optics.Eye(PUPIL, bands=asking(4.0)),
    "receptors": lambda: optics.Eye(PUPIL, receptors=asking([500.0, 600.0])),
    "direction_deg": lambda: EYE.kernel(2, direction_deg=(asking(1.0), 0.0)),
    "radiance": lambda: EYE.see(asking_map((4, 10, 10)), 2),
    "tolerance of a sight": lambda: EYE.sight(2, tolerance=asking(0.01)),
    "z": lambda: EYE.sight(2, z=[asking(1.0), 2.0]),
    "illuminance": lambda: optics.PhotonBudget(asking(1e4)),
    "lambda_max_nm": lambda: optics.Pigment(asking(500.0)),
    "values": lambda: optics.Spectrum((400.0, 700.0), asking([1.0, 1.0])),
    "rotation_deg of a polygon": lambda: optics.Polygon.regular(6, asking(30.0)),
    "arriving": lambda: optics.mtf(a_picture(), arriving=asking(0.9)),
    "tolerance of an MTF": lambda: optics.mtf(a_picture(), tolerance=asking(0.9)),
    "frequencies": lambda: optics.mtf(a_picture(), tolerance=0.9).profile(asking([1e5])),
    "shares": lambda: a_picture().mean(asking([1.0])),
    "angle_x": lambda: optics.Ommatidium(PUPIL, optics.Waveguide(2e-6)).sensitivity(asking(0.0), 0.0),
    "focal_length of Snyder": lambda: optics.snyder_acceptance(2.5e-5, asking(5e-5), 2e-6, 5e-7),
    "distance": lambda: optics.propagate(FIELD, dx=1e-6, wavelength=5e-7, distance=asking(1e-3)),
}


@pytest.mark.parametrize("name", DROPPED)
def test_it_is_refused(name):
    with pytest.raises(ValueError, match=r"requires a derivative, but none is propagated") as error:
        DROPPED[name]()
    assert str(error.value).startswith(name.split(" of ")[0].removesuffix("s"))


def test_torch_asks_too():
    torch = pytest.importorskip("torch")
    with pytest.raises(ValueError, match="inner requires a derivative"):
        optics.Annulus(torch.tensor(0.5, requires_grad=True))


def test_plain_arrays_of_drjit_are_numbers():
    assert optics.Annulus(Float64(0.5)).area == pytest.approx(np.pi * 0.75)


def of_torch(value):
    torch = pytest.importorskip("torch")
    return torch.tensor(value, dtype=torch.float64, requires_grad=True)


LENS = {"aperture_radius": 1e-5, "thin_lens_focal_length": 1e-4}
# A pupil with a tensor of PyTorch, and the name of the tensor in the message.
PUPILS = {
    "aperture_radius": lambda: optics.Pupil(**LENS | {"aperture_radius": of_torch(1e-5)}),
    "thin_lens_focal_length": lambda: optics.Pupil(1e-5, thin_lens_focal_length=of_torch(1e-4)),
    "height.control_points": lambda: optics.Pupil(**LENS, height=optics.BSplineRelief(of_torch(np.zeros((4, 4))))),
    "n.a": lambda: optics.Pupil(**LENS, height=np.eye(5) * 1e-7, n=of_torch(1.4)),
    r"wavefront.coefficients_um\[2, 0\]": lambda: optics.Pupil(
        **LENS, wavefront=optics.Zernike({(2, 0): of_torch(0.1)})
    ),
    "mask.waist": lambda: optics.Pupil(**LENS, mask=optics.GaussianMask(of_torch(1e-5))),
}
SMALL = {"sensor_distance": 1e-4, "shape": (9, 9)}
REFUSED = r" requires a gradient of PyTorch, which would be lost here: must be passed to optics\.torch\.psf"


@pytest.mark.parametrize("name", PUPILS)
def test_a_gradient_of_torch_is_refused_outside_of_optics_torch(name):
    with pytest.raises(ValueError, match=f"^{name}{REFUSED}"):
        optics.psf(PUPILS[name](), **SMALL)


@pytest.mark.parametrize(
    "call",
    [
        lambda pupil: optics.plan(pupil, **SMALL),
        lambda pupil: optics.psf_batch([pupil], **SMALL),
        lambda pupil: optics.white_psf(pupil, **SMALL),
        lambda pupil: optics.Eye(pupil, resolution=(5, 5)).kernel(2),
        lambda pupil: optics.vector_focus(pupil, sensor_distance=1e-4),
        seen_by_a_rhabdom,
    ],
    ids=["plan", "psf_batch", "white_psf", "Eye", "vector_focus", "Ommatidium"],
)
def test_every_function_refuses_a_gradient_of_torch(call):
    with pytest.raises(ValueError, match=r"requires a (gradient|derivative)"):
        call(PUPILS["height.control_points"]())
