"""Proofs of the optics, and what they need.

ideal_lens_psf        the PSF of an ideal lens against the exact integral and Airy's pattern
departure_from_airy   how far the exact PSF departs from Airy's pattern
psf_error_prediction  predicted errors of random PSFs against actual ones
aliasing              aliasing beyond the critical distance, and wrap-around
undersampled_lens     a lens on too few samples
float32_precision     phases that lose their digits in float32
backward_propagation  propagation backwards against the decay of evanescent waves
thin_element          a relief as a phase mask against refraction
limiting_cases        the edges of the domain: a closed form, or an error of one line
cell_samples          how many samples integrals over cells need
freeze_spectra        the stored spectra against colour-science

random_cases          random pupils, distances, windows and tolerances
refraction            rays through a real surface
textbook_propagation  the angular spectrum of textbooks, in NumPy
"""
