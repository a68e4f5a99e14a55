"""The point spread function of a pupil: choice of the method, check of the result, and measures of image quality.

psf            psf, plan
psf_result     PSFResult: a PSF that can be recomputed over other windows
request        Request: the parameters of one PSF
light_batch    light through several pupils, for several distances
coarse_stack   PSFs of several depths and wavelengths, computed together at coarse tolerances
planner        the cheapest method within the tolerance
pictures       computes the requested PSFs, and computes a PSF again if its check fails
window_cost    time and memory of a window, and their limits
spot_check     comparison of a PSF with the direct sum at a few points
vector_focus   vector_focus: the focus of polarised light, according to Maxwell's equations
converging     VectorFocus: a polarised field behind a pupil
disk_sum       sum of the light on a round receptor
microvilli     Microvilli: receptors with polarisation sensitivity
coarse_batch   PSFs of many beams at coarse tolerances, as stacks of matrix products
batch          psf_batch: PSFs of many eyes at once
modulation_transfer  MTF: contrast at any frequency
arriving       fraction of the light that is not evanescent
contrast       mtf, image_quality
mixture        sums over wavelengths
white          white_psf: light of a lamp, weighted by receptors
through_focus  through_focus: PSFs at several distances of the sensor
lens_mtf       lens_mtf: lenses of other programs in light of several wavelengths, through focus
circle_sums    sums over samples within circles, for any number of radii
concentration  encircled_energy
strehl         strehl_ratio
window_loss    errors of contrasts at each frequency, due to light outside the window
"""
