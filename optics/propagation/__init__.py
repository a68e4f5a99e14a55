"""Propagation of sampled fields from plane to plane. (The methods for PSFs are in optics/methods.)

propagate           propagate: propagation through free space between two planes
separable_kernel    distant and shifted windows by matrix products
spectrum_filter     near windows by transforms
transfer_function   free space as a filter of plane waves
transform_sampling  the period of a finite transform
system              propagate_through: propagation through pupils and free space
planes              samples of intermediate planes
misalignment        Misaligned: decentred and tilted pupils
"""
