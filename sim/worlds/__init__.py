"""The worlds of the tasks, as MuJoCo models.

catalog      TASKS: their names, and what is asked of the agent
world        build_world, World
detection    an open field with goal and adversaries; of tracking, too
foraging     the same, for receptors of the ultraviolet
navigation   a course between walls: the drawings
course       Course: what makes a way one that can be run
maze         mazes drawn at random
striped_walls  cells as boxes with stripes
layout       cells, walls, a floor
materials    reflectances, stripes, daylight
agent_model  a world's agent by itself
ground_plan  GroundPlan: a world from above
state        WorldState: where everything is
"""
