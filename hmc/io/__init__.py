"""Everything that touches a disk: recordings, calibrations, results, journals, tables."""
