"""What other codes' test suites and textbooks assert of physics, asked of this package.

claim                 Case: a source, what it says, what we find, how far that may be off; the systems that are asked
suite_claims          prysm, poppy and hcipy
textbook_apertures    textbooks: circles, rings and slits
textbook_aberrations  textbooks: Strehl ratios, defocus, light on the axis, Zernike's polynomials
unexpressed           what cannot be asked here, and why
"""
