"""Proofs of the optics, and their helpers.

ideal_lens_psf        PSF of an ideal lens compared with the exact integral and the Airy pattern
departure_from_airy   difference between the exact PSF and the Airy pattern
psf_error_prediction  predicted and actual errors of random PSFs
aliasing              aliasing beyond the critical distance, and wrap-around
undersampled_lens     lens on too few samples
float32_precision     loss of digits of phases in float32
backward_propagation  backward propagation and evanescent waves
thin_element          phase mask compared with refraction at a relief
limiting_cases        edges of the domain: a known value, or a one-line error
real_eyes             published values of animals' eyes and computed ones
cell_samples          number of samples for integrals over cells
freeze_spectra        stored spectra compared with colour-science

random_cases          random pupils, distances, windows and tolerances
refraction            rays through a real surface
textbook_propagation  textbook angular spectrum in NumPy
"""
