"""What other codes' test suites and textbooks assert of physics, asked of this package.

case          Case: a source, what it says, what we find, and how far that may be off; the systems that are asked
codes         prysm, poppy and hcipy
apertures     textbooks: circles, rings and slits
aberrations   textbooks: Strehl ratios, defocus, light on the axis, Zernike's polynomials
unexpressed   what cannot be asked here, and why
"""
