"""Fast images for people: any mirrored model in direct light, as sRGB.

quick_camera   images with smooth edges, from few rays
camera_rays    rays of an image, and the light along them
lattice        lattice of the pixels that are traced first
merged_mirror  a mirror of fewer shapes
eye_marks      marks of eyes on images of a model
"""
