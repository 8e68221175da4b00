# What a HAL file of a machine has loaded before pkmkins.tcl. `after` has what a test puts on signals happen.
hal loadrt motmod num_joints=3
hal loadrt pkmkins
after 10
