"""Body parts and skeleton curves from the voxels alone, in a Laplacian eigenspace. Hsiao (2008), sections 3.1.4 and 3.1.5."""
