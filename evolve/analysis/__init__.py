"""Analysis of a run's record and of its animals.

statistics      statistics per generation, acuity, image quality, confidence intervals
genealogy       lines of descent
episode_failures  failures of a user task that ended training episodes
vision          image quality and contrast of an animal's eyes
recorder        recording of an episode that an animal plays
episode         Episode: one recorded episode
episode_scene   EpisodeScene: positions of bodies and eyes during an episode
episode_file    storage of episodes in files
"""
