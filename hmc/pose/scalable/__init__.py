"""Scalable body models: structural annealing (SHBM-APF) and limbs that come and go with the data (DDM-APF); Canton (2009), chapter 7."""
