"""The eyes of an agent: directions in which light is sampled, and weights of the samples in receptors' signals.

eyes                 Eyes: the eyes of the built-in agent
sampling             samples of an eye's visual field: rays or rectangular areas
tangent_plane        receptors on the visual field's tangent plane: size, directions and subdivision
sensor               directions and weights of the samples
receptive_fields     receptive fields behind a pupil, and ray directions whose density is the mean of these fields
varied_fields        receptive fields of receptors of different sizes behind a pupil
field_areas          rectangles of the visual field, and the fraction of each receptive field in them
receptor_sums        weighted sums over samples for each receptor
depth_layers         object distances for which an eye's PSF is computed
allowed_error        largest acceptable error of a signal, derived from the receptors' noise
compound_eye         CompoundEye: ommatidia with any viewing directions
viewing_directions   hexagonal patches, whole heads, measured directions
hexagonal_rows       hexagonal lattices in rows of equal length, with an acute zone
ommatidial_sampling  rays drawn from the acceptance functions of ommatidia
mounts               Mount: position and direction of an eye on a model; fan, ring, both_sides
inside               depth of a point inside a geom
"""
