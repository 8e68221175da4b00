# A HAL file of the machine's own: LinuxCNC's generator, whose functions are of no matter here.
hal loadrt pwmgen output_type=0
