"""Genomes, which are vectors of numbers, and their development into animals.

genes         GENES: quantities that evolution can change
genotype      Genotype: encoding of gene values in a genome
phenotype     Phenotype: eyes and brain of an animal; develop: the phenotype of a genome
phenotype_on_record  validation of a phenotype that was read from a file
eye_config    EyeConfig: settings shared by all eyes of a run
anatomy       repair of gene values for which eyes or receptors would overlap
head_surface  repair of gene values for which facets do not fit on the head
relief_genes  genes of a pupil's relief
interval      Interval: valid range of a value
plain_values  validation of values that were read from a file
"""
