"""Tests of evolve/genome: which test covers which module.

genes: test_genotype.py, test_rhabdoms.py, test_vertical_fov.py
genotype: test_genotype.py
phenotype: test_genotype.py, test_anatomy.py, test_rough_reliefs.py
anatomy: test_anatomy.py
eye_config: test_anatomy.py, config/test_odd_arguments.py
head_surface: test_compound_eyes.py
relief_genes: config/test_relief_starts.py
interval: test_interval.py
phenotype_on_record: test_phenotype_on_record.py, cli/test_hostile_runs.py
plain_values: test_phenotype_on_record.py
"""
