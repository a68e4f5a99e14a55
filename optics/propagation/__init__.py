"""Propagation of sampled fields from plane to plane. (The methods for PSFs are in optics/methods.)

propagate           propagate: propagation through free space between two planes
separable_kernel    propagation to distant or shifted windows by matrix products
spectrum_filter     propagation to near windows by Fourier transforms
transfer_function   factor by which free space multiplies each plane wave
transform_sampling  period after which a discrete Fourier transform repeats the field
system              propagate_through: propagation through pupils and free space; also for batches of systems
system_elements     FreeSpace; checks of the elements, and the light in front of them
stack_result        StackResult: the field behind a system
planes              samples of pupils
soft_pixels         pupils that consist of pixels, with jumps softened so that a grid can sample them
plane_step          steps between the planes of a system
field_derivatives   derivatives of fields through steps
misalignment        Misaligned: decentred and tilted pupils
"""
