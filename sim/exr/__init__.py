"""Spectral OpenEXR files of scenes and of signals.

view             View: image of one eye
files            write_exr, read_exr: files of views
spectral_layout  names of the channels in spectral OpenEXR files, also in files that other programs write
previews         previews in linear sRGB
"""
