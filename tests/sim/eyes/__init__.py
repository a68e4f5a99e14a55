"""Tests of eyes: which test covers which module.

eyes: test_eyes.py, envs/test_env.py
sampling: test_sensor.py, test_field_areas.py
tangent_plane: test_sensor.py, test_varied_fields.py, render/test_vertical_field.py
sensor: test_sensor.py
field_areas: test_field_areas.py, tracing/test_areas_behind_pupils.py
receptive_fields: test_sensor.py, tracing/test_lighting.py
varied_fields: test_varied_fields.py
receptor_sums: test_sensor.py
depth_layers: test_depth_layers.py
allowed_error: test_allowed_error.py
mounts: test_mounts.py
viewing_directions: test_viewing_directions.py
hexagonal_rows: test_hexagonal_rows.py
compound_eye: test_compound_eye.py, render/test_ommatidia.py, render/test_compound_eyes_of_agents.py
ommatidial_sampling: test_compound_eye.py, render/test_ommatidia.py
inside: test_mounts.py
"""
