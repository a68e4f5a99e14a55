"""The worlds of the tasks, as MuJoCo models.

catalog      TASKS: names of the tasks, and the goals of the agent
world        build_world, World
detection    an open field with a goal and adversaries, also for tracking
foraging     the same field, for ultraviolet receptors
navigation   courses between walls: the drawings
course       Course: a course without detours back to its start
maze         random mazes
striped_walls  walls of cells as boxes with stripes
layout       cells, walls, a floor
materials    reflectances, stripes, daylight
agent_model  a world's agent without its world
ground_plan  GroundPlan: a world from above
state        WorldState: state of a batch of worlds
"""
