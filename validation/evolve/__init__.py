"""Proofs of learning, search and run directories, and their helpers.

learning_curves       learning curves of the tasks with several settings
early_ranking         ranks after little training compared with final ranks
fewer_epochs          fewer epochs late in a training run
run_directory_safety  manipulated, damaged and killed runs
worker_endurance      memory of a worker over many candidates

watched_trainings     training runs with regular evaluations
hostile               trials of untrusted runs, with the guarantees that they test
hostile_runs          trials: damaged run directories
hostile_files         trials: pages, policies, images and models
hostile_unfinished    trials: closed pipes and deleted directories
"""
