"""What tests hold of physics, module by module.

physics: test_physics.py, worlds/test_world.py
free_motion: test_physics.py
local_contacts: test_local_contacts.py
mujoco_batch: test_local_contacts.py
controls: test_controls.py
"""
