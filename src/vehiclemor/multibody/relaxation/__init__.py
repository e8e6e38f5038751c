"""The 14-DOF vehicle on tires whose slips relax over a distance: it stops, stands and starts."""
