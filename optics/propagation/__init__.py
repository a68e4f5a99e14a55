"""Propagation of sampled fields from plane to plane. (The integrals behind a PSF are in optics/methods.)

propagate           propagate: free space between two planes
system              propagate_through: pupils and free space
planes              intermediate planes, sampled for the light that they transmit
transfer_function   free space as a filter of plane waves
transform_sampling  the period of a transform
"""
