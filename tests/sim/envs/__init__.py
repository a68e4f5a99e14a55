"""What tests hold of environments, module by module.

assembly: test_env.py, test_vec_env.py, test_tasks_page.py
task_vec_env: test_task_vec_env.py, test_broken_worlds.py, test_encounter.py
task_worlds: test_task_vec_env.py, test_broken_worlds.py, test_encounter.py, test_bad_encounters.py, test_own_models.py
task_senses: test_task_vec_env.py, test_task_state.py, test_encounter.py
task_sight: test_eye_kinds.py, test_task_vec_env.py
task_animals: test_encounter.py, test_parallel_env.py
task_pictures: test_task_vec_env.py, test_pictures.py, test_parallel_env.py
parallel_env: test_parallel_env.py, test_pictures.py
task_fidelity: render/test_model_fidelity.py, test_encounter.py
task_state: test_task_state.py, test_differing_worlds.py, test_own_models.py
auxiliary: test_auxiliary.py
world_poses: test_auxiliary.py
one_environment: test_vec_env.py, test_pictures.py
env: test_env.py
vec_env: test_vec_env.py, test_env.py, test_light_levels.py
vector_env: test_vector_env.py
registered_env: test_vector_env.py
registration: test_env.py, test_vector_env.py, worlds/test_catalog.py
simulation: tasks/test_task.py, test_vec_env.py
observation: test_vec_env.py, test_task_state.py, test_tasks_page.py
info: test_vec_env.py, test_tasks_page.py
follow_camera: test_env.py
field_of_view_overlay: test_env.py
retina_images: test_env.py
"""
