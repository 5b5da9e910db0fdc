"""The articulated body: joints and their limits, proportions, flesh, forward kinematics."""
