"""Which test fails when a module of optics/methods is broken. The oracles are closed forms that all methods meet.

angular_spectrum: test_textbook, test_oracles_waves
far_field: test_textbook
fresnel: test_fresnel
geometric: test_geometric
hankel: test_textbook, test_oracles_circular
low_rank: test_textbook
pixelated_spectrum: elements/test_pixel_relief
problem: point_spread/test_planner
pupil_sampling: test_textbook, elements/test_pixel_relief
rayleigh_sommerfeld: test_textbook, test_oracles_circular
rays: test_geometric
sampling: point_spread/test_planner
spectral_taper: test_textbook
textbook: test_textbook
"""
