"""Environments: worlds, tasks and eyes put together.

assembly               make_vec_env, make_parallel_env
prepared_task          PreparedTask: a task made ready for several environments
vec_env                EyesVecEnv: stable-baselines3
env                    make_env, EyesEnv: Gymnasium
vector_env             EyesVectorEnv: Gymnasium's vector environment
parallel_env           EncounterEnv: PettingZoo
registration           Gymnasium's ids
registered_env         environments as it makes them by these
batch_task_checker     check_batch_task: whether a batch task keeps to the protocol
animals                all agents of all worlds, those who learn and those who do not
senses                 observations of one agent
eyes_of_kind           signals of one kind of its eyes
renderers              renderers of all eyes
observation            frames that are remembered
auxiliary              depth, ids and flow beside signals
held_state             states as arrays, checked
one_environment        answers to stable-baselines3 that all worlds share
world_pictures         pictures of worlds for people
follow_camera          the agent seen from behind
field_of_view_overlay  fields of view of its eyes
retina_images          signals of eyes as pictures
"""
