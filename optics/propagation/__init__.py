"""Sampled fields carried from plane to plane. (The integrals behind a PSF are in optics/methods.)

propagate           propagate: one stretch of free space
system              propagate_through: pupils and free space
planes              the planes between, sampled for what follows
transfer_function   free space as a filter of plane waves
transform_sampling  how long a transform's period must be
"""
