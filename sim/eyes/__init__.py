"""The eyes of an agent: where they look, and how rays become signals.

eyes              Eyes
sensor            ray directions and their weights
receptive_fields  directions drawn from all receptive fields at once
receptor_sums     from rays to receptors
depth_layers      one PSF for each of a few distances
"""
