"""Analysis of a run's record and of its animals.

statistics      statistics of fitness and genes per generation, confidence intervals
white_light     WhiteLight: measures of an eye in white daylight
fitness_parts   parts of fitness: task fitness and costs
acuity          finest gratings that an animal resolves
genealogy       a candidate's line of descent
episode_failures  failures that ended episodes, mostly failures of methods of a user task
vision          image quality and contrast of an animal's eyes, in comparison with a perfect lens
"""
