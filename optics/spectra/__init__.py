"""Light and receptors over wavelength; the measured tables are in data/.

spectrum       Spectrum: illuminants, reflectances, cone fundamentals
bands          SpectralBands: a spectrum as a few numbers
pigment        visual pigments from their peaks
receptors      Receptors: types, and which receptor is of which type
photon_budget  PhotonBudget: photons that a receptor absorbs
"""
