"""What experiments are computed with: cells, stores, sweeps, clusters, reports."""
