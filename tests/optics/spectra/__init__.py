"""Which test fails when a module of optics/spectra is broken.

bands: test_bands
photon_budget: test_photon_budget
pigment: test_pigment
receptors: test_receptors
spectrum: test_spectrum
"""
