"""Environments: worlds, tasks and eyes put together.

assembly               make_vec_env, make_parallel_env: world, task, physics and eyes put together
vec_env                EyesVecEnv: stable-baselines3
task_vec_env           TaskVecEnv: the same for tasks of one's own
task_worlds            their worlds
task_senses            what an animal in them knows
task_sight             what one kind of its eyes sees
task_animals           all animals in them, those who learn and those who do not
task_pictures          pictures of them
parallel_env           EncounterEnv: PettingZoo
task_fidelity          how finely they are seen
auxiliary              depth, ids and flow beside what is seen
world_poses            rhabdom's own worlds as any model is seen
task_state             where these stand, as arrays
one_environment        what both answer stable-baselines3 alike
env                    make_env, EyesEnv: Gymnasium
vector_env             EyesVectorEnv: Gymnasium's vector environment
registration           Gymnasium's ids
registered_env         environments as it makes them by these
simulation             worlds in motion, unseen
observation            what an agent knows
info                   what every step says
follow_camera          the agent seen from behind
field_of_view_overlay  what its eyes look at
retina_images          what they report
"""
