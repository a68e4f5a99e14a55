"""Ways to evaluate one diffraction integral, Rayleigh and Sommerfeld's first, or an approximation to it.

All but the textbook's take a `Problem` and give `Sampling`s: how they would sample it, with the time and the error to
expect, and the picture if asked. `optics.point_spread.planner` chooses.

textbook             the angular spectrum in plain NumPy: start here
carrier              the phase of a sphere, split off fields and put back
problem              Problem: what is to be computed, in numbers
method_sampling      Sampling: what every method offers
rayleigh_sommerfeld  the direct sum: the reference
angular_spectrum     by transforms on grids, whole or with its paraxial part split off
pixelated_spectrum   the same for pupils made of pixels
hankel               the same for symmetric pupils, along one radius
low_rank             by one matrix product
far_field            by one transform onto directions for each of a few nodes of the window
far_field_nodes      which nodes, and what each counts in every direction
fresnel              approximate: Fresnel and Fraunhofer, and how wrong they are
geometric            approximate: density of rays; the pinhole
smythe               vector fields, of what the others propagate
vector_sum           vector fields about a focus, as a sum of plane waves
scalar_theory        how wrong scalar theory is, at most
rays                 where geometrical optics sends the light
pupil_sampling       where matrix products sample the pupil
sine_samples         the same, evenly spaced as seen from the window
spectral_taper       how a spectrum ends before grazing incidence
"""
