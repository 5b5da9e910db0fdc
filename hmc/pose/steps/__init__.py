"""From one frame's pose to the next: filters, descents, swarms, refinement, search for lost limbs."""
