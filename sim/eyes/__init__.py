"""The eyes of an agent: where they look, and how rays become signals.

eyes              Eyes
sampling          which rays or areas, and how many
sensor            their directions and weights
receptive_fields  directions drawn from all receptive fields at once
field_areas       areas, and what of all receptive fields lies in each
receptor_sums     from rays to receptors
depth_layers      one PSF for each of a few distances
allowed_error     what may be wrong of a signal
mounts            Mount: where an eye is on a model; fan, ring, both_sides
inside            eyes that are inside of a geom
"""
