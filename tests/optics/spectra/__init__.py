"""Tests that fail when a module of optics/spectra is broken.

bands: test_bands.py
optical_sensitivity: test_optical_sensitivity.py
photon_budget: test_photon_budget.py
pigment: test_pigment.py
receptor_dynamics: sim/render/test_receptors_in_time.py
receptors: test_receptors.py
spectrum: test_spectrum.py
srgb: eye/test_camera.py, sim/pictures/test_photograph.py
"""
