"""Compound eyes: facets, and the rhabdoms behind them as waveguides.

waveguide   Waveguide: a rhabdom, and its modes
facet       FacetLens: thick and curved
radiation   what a mode sends back to the pupil
coupling    how much light a pupil sends into a mode, for every direction
ommatidium  Ommatidium: angular sensitivity, acceptance angle
mosaic      AppositionEye: ommatidia side by side
"""
