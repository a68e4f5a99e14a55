"""The worlds of the built-in tasks, as MuJoCo models.

catalog      TASKS: the name of each task and the aim of its agent
world        build_world; World: a compiled world
detection    an open field with a goal and adversaries, for the tasks detection and tracking
foraging     the field of the task detection, with objects that differ in ultraviolet reflectance only
navigation   the built-in courses between walls
course       Course: paths between walls; on the way to the goal, an agent comes back towards its start by at most 1.5 m
maze         random mazes
random_course  random courses
layout_family  LayoutFamily: random mazes or courses in disjoint sets for training, selection and test
striped_walls  walls that fill cells of a grid, built from boxes with stripes
layout       grid cells, walls and the floor
materials    reflectances, stripes, daylight
agent_model  model of an agent without the walls and objects of its world
ground_plan  GroundPlan: plan of a world from above
state        WorldState: state of a batch of worlds
"""
