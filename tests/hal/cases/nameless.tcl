# Removes the variable with the path of the INI file, which LinuxCNC sets for HAL files.
unset ::env(INI_FILE_NAME)
