"""Pictures for people, quickly: any mirrored model in direct light, as sRGB.

quick_camera   pictures with smooth edges, from few rays
camera_rays    the rays of a picture, and the light that they find
lattice        pixels that are looked at first
merged_mirror  a mirror of fewer shapes
eye_marks           eyes on pictures of a model
"""
