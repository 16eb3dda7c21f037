"""The four-bar linkage: kinematics, dimension types, pose, limits, drawings and files."""
