"""What tests hold of eyes, module by module.

eyes: test_eyes.py, envs/test_env.py
sensor: test_sensor.py
receptive_fields: test_sensor.py, tracing/test_lighting.py
receptor_sums: test_sensor.py
depth_layers: test_depth_layers.py
"""
