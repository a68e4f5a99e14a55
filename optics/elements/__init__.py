"""What light comes from and passes: a source, a pupil, and the relief on it.

source            PointSource
pupil             Pupil: aperture, relief, ideal lens
relief            Relief, HeightMap, BSplineRelief
pixel_relief      PixelRelief: steps
fine_detail       which frequencies samples hold
square_samples    the numbers of reliefs, masks and wavefronts, as users give them
wavefront         Zernike, WavefrontMap
transmittance     GaussianMask, MaskMap
human_eye         HumanEye, mean_human_mtf: as they were published
exit_pupil        read_exit_pupil: lenses of other programs
refractive_index  RefractiveIndex, Sellmeier, Cornu; media of eyes
wavefront_slopes  where the rays of a wavefront go
beam              light of one wavelength on its way to a plane
ray_field         what rays make of polarised light
"""
