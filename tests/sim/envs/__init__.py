"""Tests of environments: which test covers which module.

assembly: test_construction_parts.py, test_batch_parts.py, test_arguments.py, test_env.py, test_vec_env.py
parallel_env: test_parallel_parts.py, test_parallel_env.py, test_pictures.py
auxiliary: test_world_parts.py, test_auxiliary.py
one_environment: test_shared_environment.py, test_vec_env.py, test_pictures.py
calls: test_face_parts.py, test_calls.py
env: test_face_parts.py, test_env.py
vec_env: test_vec_env_parts.py, test_batch_parts.py, test_vec_env.py, test_episode_infos.py, test_handed_out.py
vector_env: test_face_parts.py, test_vector_env.py
registered_env: test_face_parts.py, test_vector_env.py
registration: test_face_parts.py, test_env.py, test_vector_env.py, worlds/test_catalog.py
observation: test_world_parts.py, test_shared_environment.py, test_vec_env.py, test_task_state.py, test_tasks_page.py
follow_camera: test_picture_parts.py, test_images_for_people.py, test_env.py
field_of_view_overlay: test_picture_parts.py, test_field_of_view_overlay.py, test_env.py
retina_images: test_picture_parts.py, test_images_for_people.py, test_env.py
ommatidia_space: test_world_parts.py, test_ommatidia_in_worlds.py
hexagon_images: test_hexagon_images.py, test_images_for_people.py, test_ommatidia_in_worlds.py
prepared_task: test_task_parts.py, test_shared_environment.py, test_features.py, evolve/learning/test_fitness.py
batch_task_checker: test_task_parts.py, test_batch_task.py
animals: test_animal_parts.py, test_batch_parts.py, test_calls_per_step.py, test_encounter.py
senses: test_world_parts.py, test_batch_parts.py, test_task_vec_env.py, test_task_state.py, test_encounter.py
eyes_of_kind: test_signal_parts.py, test_receptors_in_time.py, test_eyes_of_kind.py, test_eye_kinds.py, test_features.py
frame_choice: test_frame_choice.py, test_receptors_in_time.py
renderers: test_task_parts.py, test_features.py, test_light_levels.py, test_receptor_shapes.py
held_state: test_world_parts.py, test_task_state.py
threads: test_shared_environment.py, test_threads.py
world_pictures: test_picture_parts.py, test_images_for_people.py, test_task_vec_env.py, test_pictures.py
"""
