"""Compound eyes: facets with rhabdoms as waveguides behind them.

waveguide   Waveguide: a rhabdom with its modes
facet       FacetLens: a thick lens
radiation   radiation of a mode at the pupil
coupling    coupling of a pupil's light into modes, for every direction
ommatidium  Ommatidium: angular sensitivity, acceptance angle
acceptance  acceptance_function: table of the angular sensitivity over directions
mosaic      AppositionEye: an array of ommatidia
"""
