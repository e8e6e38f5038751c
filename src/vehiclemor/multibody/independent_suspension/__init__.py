"""The 14-DOF vehicle."""
