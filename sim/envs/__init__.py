"""Environments: worlds, tasks and eyes put together.

assembly               make_vec_env, make_parallel_env
prepared_task          PreparedTask: a task prepared for several environments
vec_env                EyesVecEnv: stable-baselines3
env                    make_env, EyesEnv: Gymnasium
vector_env             EyesVectorEnv: Gymnasium's vector environment
parallel_env           EncounterEnv: PettingZoo
registration           Gymnasium ids
registered_env         environments that Gymnasium makes by these ids
batch_task_checker     check_batch_task: test of a batch task against the protocol
animals                all agents of all worlds, learning or frozen
senses                 observations of one agent
eyes_of_kind           signals of one kind of an agent's eyes
renderers              renderers of all eyes
observation            memory of past frames
auxiliary              depth, geom ids and optic flow in observations
held_state             checks of stored states
one_environment        stable-baselines3 methods that are the same for all worlds
world_pictures         images of worlds for human viewers
follow_camera          a camera behind the agent
field_of_view_overlay  fields of view of the agent's eyes, drawn into an image
retina_images          signals of eyes as images
"""
