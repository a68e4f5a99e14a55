"""Claims without a counterpart here, with the reasons."""

from __future__ import annotations

__all__ = ["UNEXPRESSED"]

UNEXPRESSED = (
    (
        "spacetelescope/poppy, test_core: test_basic_functionality",
        "its 0.201 is a sample half a cell off the peak, normalised by the test's own window",
    ),
    (
        "spacetelescope/poppy, test_fresnel: test_fresnel_optical_system_Hubble",
        "two mirrors: systems of planes here have pupils, but no sequence of lenses in a converging beam",
    ),
    (
        "spacetelescope/poppy, test_fresnel: test_GaussianBeamParams",
        "requires beam radius and waist, which fields here do not store",
    ),
    (
        "spacetelescope/poppy, test_matrixFTcoronagraph",
        "coronagraphs need a mask in the focal plane and a second pupil",
    ),
    ("spacetelescope/poppy, test_zernike: test_cross_hexikes", "there are no modes of a hexagon"),
    (
        "ehpor/hcipy, test_propagation: backward propagators",
        "PSFs are computed forwards; `optics.propagate` goes backwards, which `backward_propagation` tests",
    ),
    (
        "brandondube/prysm, test_thinfilm and ray tracing",
        "thin films and ray tracing are not part of this package",
    ),
    (
        "opticspy/lightpipes, examples of diffraction",
        "plot images without assertions; their spot of Poisson is the ring's light on the axis",
    ),
)
