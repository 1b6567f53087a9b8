"""Linear models as tables and figures: poles, frequency responses, loci, regions."""
