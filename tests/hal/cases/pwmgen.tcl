# A custom HAL file with LinuxCNC's pwmgen, whose functions do not matter here.
hal loadrt pwmgen output_type=0
