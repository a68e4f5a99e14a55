"""Propagation of sampled fields from plane to plane. (The methods for PSFs are in optics/methods.)

propagate           propagate: propagation through free space between two planes
separable_kernel    distant and shifted windows by matrix products
spectrum_filter     near windows by transforms
transfer_function   free space as a filter of plane waves
transform_sampling  the period of a finite transform
system              propagate_through: propagation through pupils and free space; also for batches of systems
system_elements     FreeSpace; checks of the elements, and the light in front of them
stack_result        StackResult: the field behind a system
planes              samples of pupils
soft_pixels         pupils of pixels, filtered for samples on a grid
plane_step          steps between the planes of a system
field_derivatives   derivatives of fields through steps
misalignment        Misaligned: decentred and tilted pupils
"""
