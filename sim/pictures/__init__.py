"""Fast sRGB images of any MuJoCo model in direct light, for display.

quick_camera   images with smooth edges, from few rays
camera_rays    rays of an image, and the light along them
lattice        lattice of the pixels that are traced first
merged_mirror  a model's Mitsuba scene with fewer shapes
eye_marks      marks of eyes on images of a model

Photographs through the eyes of animals:

photograph       conversion of sRGB images to the signals of receptors
receptor_mosaic  signals, drawn as hexagons or squares and written as EXR
"""
