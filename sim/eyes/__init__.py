"""The eyes of an agent: their viewing directions, and the receptors' weights.

eyes              Eyes: the eyes of the built-in agent
sampling          choice of the rays or areas of an eye
sensor            directions and weights of the samples
receptive_fields  random directions for all receptive fields together
field_areas       rectangles, and the share of each receptive field in them
receptor_sums     weighted sums over samples for each receptor
depth_layers      one PSF for each of a few distances
allowed_error     error of a signal that the receptors' noise hides
mounts            Mount: an eye's place on a model; fan, ring, both_sides
inside            depth of a point inside a geom
"""
