"""Proofs of learning, search and run directories, and what they need.

learning_curves       what is learnt, how soon, and with which settings
early_ranking         ranks after little training against final ranks
fewer_epochs          fewer passes late in a training
run_directory_safety  prepared, spoilt and killed runs
worker_endurance      a worker after many candidates

watched_trainings     trainings and how often they reach the goal
hostile               trials of prepared runs, and their promises
hostile_runs          trials: a run directory given to a command
hostile_files         trials: pages, policies, pictures and models
hostile_unfinished    trials: readers that leave, directories that are deleted
"""
