"""Land's optical sensitivity: the light that a receptor absorbs from a wide scene of unit radiance."""

from __future__ import annotations

import math

from optics.numerics.arguments import one_of, positive

__all__ = ["INVERTEBRATE_ABSORPTION", "optical_sensitivity"]

INVERTEBRATE_ABSORPTION = 6.7e3  # [1/m]: rhabdoms of lobsters (Bruno, Barnes & Goldsmith 1977; Warrant & Nilsson 1998)
HALF_WHITE = 2.3  # Warrant & Nilsson 1998: constant of the absorption of white light


def optical_sensitivity(
    diameter: float,
    focal_length: float,
    receptor: float,
    length: float | None = None,
    absorption: float = INVERTEBRATE_ABSORPTION,
    light: str = "white",
) -> float:
    """Return Land's optical sensitivity S = (π/4)² D² (d/f)² P [m² sr].

    The photons that a receptor absorbs are S times the radiance of a scene that fills its visual field. Of the light
    that enters the receptor, the fraction P is absorbed over the receptor's length l:

        P = k l / (2.3 + k l)   for white light (Warrant & Nilsson, Vision Research 38, 195, 1998, eq. 4),
        P = 1 - exp(-k l)       for light at the pigment's peak (Land, Handbook of Sensory Physiology VII/6B, 1981).

    Pass S to `PhotonBudget.photons` as the etendue. That method applies the pigment's spectrum and the quantum
    efficiency. For this purpose, omit the length if the quantum efficiency already includes the absorption in the
    receptor.

    diameter: diameter D [m] of the pupil or facet.
    focal_length: focal length f [m] of the lens on the side of the object. It equals the posterior nodal distance, from
        the nodal point to the image of a distant object.
    receptor: diameter d [m] of the round receptor or rhabdom.
    length: length l [m] of the receptor. None: P = 1, and S is the etendue.
    absorption: absorption coefficient k [1/m] at the pigment's peak.
    light: "white" or "peak".

    Raises:
        ValueError: a length or a coefficient is not positive, or the kind of light is unknown.
    """
    for name, value in (("diameter", diameter), ("focal_length", focal_length), ("receptor", receptor)):
        positive(name, value)
    positive("absorption", absorption, "1/m")
    one_of("light", light, ("white", "peak"))
    etendue = (math.pi / 4 * diameter * receptor / focal_length) ** 2
    if length is None:
        return etendue
    depth = absorption * positive("length", length)
    return etendue * (depth / (HALF_WHITE + depth) if light == "white" else -math.expm1(-depth))
