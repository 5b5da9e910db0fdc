"""Multi-cue descent: a superellipsoid body fitted to surface voxels, edges and colours by Stochastic Meta Descent. Kehl (2006)."""
