"""One action further: the batched MuJoCo step.

physics         Physics
free_motion     agents that touch nothing
local_contacts  agents that may touch something near
mujoco_batch    MuJoCo's own step for many worlds
controls        which controls belong to which actuators
"""
