"""What moves worlds on by one action.

physics         Physics: the protocol
sliding_agents  SlidingAgents: the built-in worlds
agent_motion    motion of their agents, in closed form or by MuJoCo
free_motion     agents that touch nothing
local_contacts  agents that may touch something near
mujoco_batch    MuJoCo's own step for many of these worlds
varied_looks    sizes, colours and materials that differ between them
mujoco_worlds   MujocoWorlds: any MuJoCo model
array_worlds    ArrayWorlds: the same, as arrays
controls        which controls belong to which actuators
"""
