"""Claims without a counterpart here, with the reasons."""

from __future__ import annotations

__all__ = ["UNEXPRESSED"]

UNEXPRESSED = (
    (
        "spacetelescope/poppy, test_core: test_basic_functionality",
        "the value 0.201 is that of a sample half a cell off the peak, normalised by the light in its window",
    ),
    (
        "spacetelescope/poppy, test_fresnel: test_fresnel_optical_system_Hubble",
        "a telescope of two mirrors; systems in `optics` have pupils, but no sequence of lenses in a converging beam",
    ),
    (
        "spacetelescope/poppy, test_fresnel: test_GaussianBeamParams",
        "requires the radius and waist of a beam, which the fields of `optics` do not store",
    ),
    (
        "spacetelescope/poppy, test_matrixFTcoronagraph",
        "coronagraphs need a mask in the focal plane and a second pupil",
    ),
    ("spacetelescope/poppy, test_zernike: test_cross_hexikes", "`optics` has no Zernike modes of a hexagon"),
    (
        "ehpor/hcipy, test_propagation: backward propagators",
        "`optics.propagate` propagates backwards, and the proof `backward_propagation` tests it",
    ),
    (
        "brandondube/prysm, test_thinfilm and ray tracing",
        "thin films and ray tracing are not part of this package",
    ),
    (
        "opticspy/lightpipes, examples of diffraction",
        "the examples only plot images; their Poisson spot corresponds to the light on the axis behind a ring",
    ),
)
