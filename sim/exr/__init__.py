"""Spectral OpenEXR files of scenes and of signals.

view             View: image of one eye
files            write_exr, read_exr: files of views
spectral_layout  channels of the spectral layout, also those of other programs
previews         previews in linear sRGB
"""
