# Takes away the variable by which LinuxCNC tells HAL files the INI file.
unset ::env(INI_FILE_NAME)
