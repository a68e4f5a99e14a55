"""What tests hold of worlds, module by module.

catalog: test_catalog.py
world: test_world.py
detection: test_world.py, test_balance.py
foraging: test_foraging.py
navigation: test_world.py
layout: test_world.py
materials: test_world.py
agent_model: physics/test_local_contacts.py
state: envs/test_vec_env.py, physics/test_physics.py
"""
