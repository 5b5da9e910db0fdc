"""hmc: where people are and what pose their bodies take, from calibrated videos and without markers."""

__version__ = "0.1.0"
