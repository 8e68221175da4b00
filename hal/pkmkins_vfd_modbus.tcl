# SPDX-License-Identifier: GPL-2.0-or-later
# A spindle on a Huanyang inverter with a serial line (RS-485), for pkmkins. Uses LinuxCNC's hy_vfd. See
# `pkm help guide/drives`, also for inverters with standard Modbus.
#
# In the INI file, after the file with the drives and before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_vfd_modbus.tcl
#     [SPINDLE_0]
#     VFD = hy_vfd -n vfd -d /dev/ttyUSB0 -p none -r 9600 -t 1
#
# The name after -n must be vfd. Set PD001 = 2 and PD002 = 2 in the inverter: start and speed come from the line.

source [file join $::env(HALLIB_DIR) pkmkins_drives.tcl]

namespace eval pkmkins_vfd_modbus {}

proc pkmkins_vfd_modbus::main {} {
    set command [pkmkins_drives::need SPINDLE_0 VFD "the component with its arguments, such as hy_vfd -n vfd -d /dev/ttyUSB0"]
    pkmkins_drives::stop_on_errors
    hal loadusr -Wn vfd {*}$command
    hal setp vfd.enable 1
    pkmkins_drives::connect spindle:speed spindle.0.speed-out-abs vfd.speed-command
    foreach {pin target} {forward spindle-forward reverse spindle-reverse on spindle-on} {
        pkmkins_drives::connect spindle:$pin spindle.0.$pin vfd.$target
    }
    hal net spindle:at-speed vfd.spindle-at-speed spindle.0.at-speed
}

pkmkins_vfd_modbus::main
