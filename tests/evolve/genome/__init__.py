"""Which test covers which module of evolve/genome.

genes: test_genotype.py
genotype: test_genotype.py
phenotype: test_genotype.py, test_anatomy.py
anatomy: test_anatomy.py
relief_genes: config/test_relief_starts.py
interval: test_interval.py
"""
