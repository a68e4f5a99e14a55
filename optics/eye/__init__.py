"""Eyes: a pupil in front of a retina of photoreceptors.

eye                   Eye
eye_spec              EyeSpec: parameters of an eye
immersion             immersed: an eye under water
geometry              lengths and directions, and checks of the pupil's width
receptor_density      Fovea, VisualStreak: density of receptors over a retina
receptor_lattice      receptors of different sizes, from their density
cell_integrals        integrals of sampled functions over cells
retina                the retina as a plane of cells
sensor_pixels         means over the pixels of a sensor
visual_kernel         kernels: receptive fields of receptors
guided_field          kernels of receptors that are waveguides
receptor_kernel       kernel of any receptor
kernel_interpolation  number of kernels for a range of distances and directions
depth_range           distances in a scene and their layers
kernel_bank           kernels of an eye for a scene
band_choice           choice of the number of spectral bands
retinal_image         convolution of a scene with a kernel
occlusion             layers of a depth map, in which near surfaces hide far ones
layered_image         image of a scene with many distances
polarization          microvilli over a retina and polarised scenes
signals               signals of a scene
photoreceptor         throughput, spectral weighting, noise
camera                image of a scene on the sensor of a camera
patch                 an eye with only the receptor that faces a given direction
summary               table of an eye's limits
acuity                limits by the spacing of receptors, diffraction and photons
"""
