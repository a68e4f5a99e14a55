"""Spectra of light and of receptors; the measured tables are in data/.

spectrum             Spectrum: illuminants, reflectances, cone fundamentals
bands                SpectralBands: spectra described by a few numbers
srgb                 radiance of surfaces with the colours of an sRGB image
pigment              spectral sensitivity of visual pigments from their peak wavelengths
receptors            Receptors: receptor types and mosaics
photon_budget        PhotonBudget: photons that a receptor absorbs, and light levels
optical_sensitivity  Land's sensitivity
receptor_dynamics    ReceptorDynamics: integration, latency and adaptation of receptors
"""
