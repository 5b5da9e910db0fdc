"""Limbs that come and go with the data (DDM-APF); Canton (2009), section 7.4."""
