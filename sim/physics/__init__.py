"""Physics of worlds: the motion during one action.

physics         Physics: the protocol
sliding_agents  SlidingAgents: the built-in worlds
agent_motion    motion of the built-in agents, in closed form or by MuJoCo
free_motion     motion of agents that touch nothing
local_contacts  motion of agents near obstacles
mujoco_batch    MuJoCo's batched step for the built-in worlds
varied_appearances  sizes, colours and materials that differ between worlds
mujoco_worlds   MujocoWorlds: any MuJoCo model
array_worlds    ArrayWorlds: any MuJoCo model, with its state as arrays
controls        assignment of a model's controls to its actuators
"""
