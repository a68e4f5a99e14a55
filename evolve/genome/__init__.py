"""From a vector of numbers to an animal.

genes         GENES: what evolution may change
genotype      Genotype: the encoding
phenotype     Phenotype, develop
anatomy       eyes and receptors take room
relief_genes  the genes of a relief
interval      ranges of values
"""
