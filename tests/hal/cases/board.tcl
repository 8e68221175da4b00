# Loads of a machine's HAL file before pkmkins.tcl. `after` then runs the test's own connections.
hal loadrt motmod num_joints=3
hal loadrt pkmkins
after 10
