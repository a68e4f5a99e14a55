"""Environments, which combine worlds, tasks and eyes.

assembly               make_vec_env, make_parallel_env
prepared_task          PreparedTask: a task prepared for several environments
vec_env                EyesVecEnv: stable-baselines3's vector environment
env                    make_env, EyesEnv: one world as a Gymnasium environment
vector_env             EyesVectorEnv: Gymnasium's vector environment
parallel_env           EncounterEnv: one world of several animals as a PettingZoo environment
registration           registration of Gymnasium ids
registered_env         classes of the environments with these ids
batch_task_checker     check_batch_task: test of a batch task against the protocol
animals                all agents of all worlds, learning or frozen
senses                 observations of one agent
eyes_of_kind           signals of an agent's eyes of the same kind
frame_choice           number of frames per action for receptors with dynamics
renderers              renderers of all eyes
observation            memory of past frames
ommatidia_space        observation space of the signals of a compound eye
auxiliary              depth, geom ids and optic flow in observations
held_state             checks of stored states
calls                  checks of the calls of all environments: their order, seeds and actions
threads                set_threads: number of threads of the libraries
one_environment        methods of a stable-baselines3 VecEnv that are the same for all worlds
world_pictures         images of worlds for human viewers
follow_camera          a camera behind the agent
field_of_view_overlay  fields of view of the agent's eyes, drawn into an image
hexagon_images         signals of compound eyes as hexagons
retina_images          signals of eyes as images
"""
