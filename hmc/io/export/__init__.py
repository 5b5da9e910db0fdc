"""Motion files of other programs, a small file a format, written from plain arrays: what each is given is in metres with z up.

`hmc.motion.export` brings a result into them; docs/exports.md says units, axes and gaps of each.
"""
