"""Multi-cue descent: a superellipsoid body fitted to surface voxels, edges and colors by Stochastic Meta Descent. Kehl (2006)."""
