"""Optical elements: light sources, pupils, and the reliefs, wavefronts and masks of pupils.

source            PointSource
pupil             Pupil: aperture, relief, ideal lens
phase_pupil       pupils with the same phase at every wavelength
relief            Relief, HeightMap, BSplineRelief
spline_map        cubic splines through the samples of a map
pixel_relief      PixelRelief: stepped reliefs
fine_detail       spatial frequencies that samples contain
square_samples    checks of the samples of reliefs, masks and wavefronts
wavefront         Zernike, WavefrontMap
zernike_modes     Zernike polynomials, and sums of many of them
zernike_order     numberings of Zernike polynomials: OSA, Noll, Fringe
transmittance     GaussianMask, MaskMap
human_eye         HumanEye, mean_human_mtf: published models
exit_pupil        read_exit_pupil: lenses from other programs
exit_pupils       read_exit_pupils: several fields and wavelengths
converging_wave   wave that converges on an image point, from rays or samples of other programs
pupil_rim         circle, ellipse or polygon around the samples of a pupil
turbid_medium     TurbidMedium: water and fog between surfaces and eyes
ball_lens         BallLens: gradient-index ball lenses
spherical_index   rays through spheres with a radial index profile
refractive_index  RefractiveIndex, Sellmeier, Cornu; media of eyes
pupil_path        parts of the optical path that do not depend on the wavelength
pupil_slopes      slopes of the wavefront behind a pupil
wavefront_slopes  directions of a wavefront's rays
beam              light of one wavelength between source and sensor plane
light_geometry    sources, lenses and media of several beams
light_stack       light of several beams at once
pupil_polynomials reliefs and wavefronts as sums of powers
derivative_knots  parts of the pupil in which derivatives with respect to a map's samples are polynomials
torch_numbers     tensors of PyTorch in a pupil
ray_field         polarised light along rays
"""
