"""Claims that cannot be asked here, and why."""

from __future__ import annotations

__all__ = ["UNEXPRESSED"]

UNEXPRESSED = (
    (
        "spacetelescope/poppy, test_core: test_basic_functionality",
        "its 0.201 is a sample half a cell off the peak, normalised by a window of its own",
    ),
    (
        "spacetelescope/poppy, test_fresnel: test_fresnel_optical_system_Hubble",
        "two mirrors: systems of planes here have pupils, and no lenses that follow one another in a converging beam",
    ),
    (
        "spacetelescope/poppy, test_fresnel: test_GaussianBeamParams",
        "asks for a bookkeeping of beam radius and waist that no field here carries",
    ),
    (
        "spacetelescope/poppy, test_matrixFTcoronagraph",
        "coronagraphs need a mask in the focal plane and a second pupil",
    ),
    ("spacetelescope/poppy, test_zernike: test_cross_hexikes", "there are no modes of a hexagon"),
    (
        "ehpor/hcipy, test_propagation: backward propagators",
        "a PSF is computed forwards; `optics.propagate` goes back, and `backward_propagation` holds it",
    ),
    (
        "brandondube/prysm, test_thinfilm and ray tracing",
        "thin films and ray tracing are no part of this package",
    ),
    (
        "opticspy/lightpipes, examples of diffraction",
        "draw pictures and assert nothing; their spot of Poisson is the ring's light on the axis",
    ),
)
