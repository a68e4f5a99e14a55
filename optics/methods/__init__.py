"""Methods that evaluate one diffraction integral, the first Rayleigh-Sommerfeld integral, exactly or approximately.

Every method except `textbook` takes a `Problem` and returns `Sampling`s. A sampling predicts its time and error and
computes the PSF on request. `optics.point_spread.planner` chooses between the samplings of all methods. The window is
the part of the sensor plane in which the PSF is computed.

textbook             the angular spectrum in plain NumPy, without optimisations, for readers to start with
carrier              the phase of a spherical wave, removed from fields before interpolation and restored afterwards
problem              Problem: the parameters of a computation
pupil_edge           the soft edge of a pupil
diffraction_kernel   the kernel of the integral, with its near field
method_sampling      Sampling: the interface of all methods
rayleigh_sommerfeld  the direct sum of the integral, the reference for all other methods
angular_spectrum     the angular spectrum on grids, propagated in one step, or in two, of which the second is paraxial
spectrum_sampling    the grids between which the angular spectrum transforms fields, and the Fourier sums that do this
row_blocks           blocks of rows of a large pupil, whose spectra are summed
derivative_cells     nodes between the knots of spline maps, for derivatives with respect to the maps' samples
pixelated_spectrum   the angular spectrum of pupils made of pixels
smooth_pupil         the light behind a steep pupil, convolved with a Gaussian
smooth_spectrum      the angular spectrum of steep pupils, from the light of `smooth_pupil`
hankel               the angular spectrum of rotationally symmetric pupils, along one radius
low_rank             one matrix product, with a Fourier kernel times a factor that varies slowly over the window
slow_factor          the slow factor of `low_rank`, and the points of the window between which it is interpolated
axis_kernel          the diffraction kernel along one axis of the window
remaining_factor     the slow factor, divided by its values along both axes
window_sampling      `low_rank` at coarse tolerances, for one PSF, with only the samples that the PSF requires
window_plan          samples of several pupils at coarse tolerances, only as many as the light in the window requires
window_geometry      the part of a `window_plan` that does not depend on reliefs and wavefronts
window_edges         soft edges of pupils of a `window_plan`, and the numbers of samples that such pupils need
window_bands         spatial frequencies of the light and of the soft edges of `window_edges`
window_rank          number of points of the window between which a `window_plan` interpolates the slow factor
window_images        PSFs of several pupils from the samples of `window_plan`
window_stack         PSFs of several sources and wavelengths through one pupil, from the same samples of the pupil
stack_operation      the PSFs of `window_stack` as one operation of PyTorch, with derivatives by the pupil's phase
pixel_nodes          quadrature nodes in the pixels of a stepped relief, for `low_rank` at coarse tolerances
sampled_path         heights of reliefs and wavefronts at samples of the pupil, from arrays that many pupils share
window_check         error of PSFs from a `window_plan`, by comparison with a sum over finer samples at a few points
window_crossings     the points of `window_check`: crossings of a few rows and columns, mostly through bright parts
mirrored_matrix      products with matrices that do not change if the orders of rows and columns are both reversed
window_sums          sums over the pupil for `window_sampling` and `window_stack`, and their adjoint
far_field            a Fourier transform from the pupil to directions for each of a few points (nodes) of the window
far_field_nodes      the choice of the nodes of `far_field`, and their weights in every direction
fresnel              approximate: the integrals of Fresnel and Fraunhofer, with their predicted errors
geometric            approximate: the density of rays, without diffraction, and the image of an ideal pinhole
smythe               vector fields by Smythe's integral, whose parts are computed with scalar methods
vector_sum           vector fields about a focus, as a sum of plane waves
scalar_theory        upper bound on the error of scalar theory
rays                 end points of rays in geometrical optics
pupil_sampling       samples of the pupil for matrix products
sine_samples         samples of the pupil that are evenly spaced in the sines of rays to the window
sine_stack           samples as in `sine_samples`, for several pupils at once
single_stack         samples as in `sine_stack` for a single pupil, kept for further PSFs of this pupil
spectral_taper       the taper that fades a spectrum out before grazing incidence
"""
