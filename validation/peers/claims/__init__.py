"""Physical claims of other codes' test suites and of textbooks, evaluated with this package.

claim                 Case: source, claim, our value and bound; the systems that claims use
suite_claims          prysm, poppy and hcipy
textbook_apertures    textbooks: circles, rings and slits
textbook_aberrations  textbooks: Strehl ratios, defocus, light on the axis, Zernike's polynomials
unexpressed           claims without a counterpart here, with the reasons
"""
