"""From a vector of numbers to an animal.

genes         GENES: what evolution may change
genotype      Genotype: the encoding
phenotype     Phenotype, develop
phenotype_on_record  one as a file has it, checked
eye_config    EyeConfig: settings that all eyes of a run have in common
anatomy       eyes and receptors take room
relief_genes  the genes of a relief
interval      ranges of values
plain_values  values from a file, or one line
"""
