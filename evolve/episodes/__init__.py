"""Episodes that trained animals play: their recording and their files.

recorder        recording of an episode that an animal plays
held_out        episodes in the test set: layouts (arrangements of walls) that neither training nor selection uses
tracks          tracks of an animal from above, in several episodes
episode         Episode: one recorded episode
episode_scene   EpisodeScene: positions of bodies and eyes during an episode
episode_file    storage of episodes in files
"""
