"""What tests hold of sim: a folder for each of its folders, which says which test covers which module.

exr: test_exr.py, test_exr_previews.py
"""
