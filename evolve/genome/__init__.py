"""Development of a genome, a vector of numbers, into an animal.

genes         GENES: quantities that evolution can change
genotype      Genotype: encoding of gene values in a genome
phenotype     Phenotype: the animal; develop
phenotype_on_record  checks of a phenotype that was read from a file
eye_config    EyeConfig: settings shared by all eyes of a run
anatomy       space constraints of eyes and receptors
relief_genes  genes of a relief
interval      ranges of values
plain_values  checks of values that were read from a file
"""
