"""Eyes: a pupil before a retina of photoreceptors.

eye                   Eye
eye_spec              EyeSpec: what an eye is, for all that is computed of it
geometry              lengths and directions, and how wide the pupil may be
cell_integrals        integrals over cells of what is known at samples
receptive_field       which directions a receptor sees: the kernel
guided_field          the same of receptors that are waveguides
receptor_kernel       either of them
kernel_interpolation  how few kernels stand for a range of distances and directions
kernel_bank           the kernels of an eye for a scene
band_choice           how few spectral bands will do
retinal_image         a scene convolved with a kernel
polarization          microvilli over a retina, and polarised scenes
signals               from a scene to signals
photoreceptor         throughput, spectral weighting, noise
summary               what limits an eye, in one table
"""
