"""Tests of quick renderings against slow ones.

quick_camera: test_quick_camera.py
camera_rays: test_quick_camera.py
lattice: test_lattice.py
merged_mirror: test_quick_camera.py
eye_marks: test_eye_marks.py
photograph: test_photograph.py
receptor_mosaic: test_photograph.py
"""
