# SPDX-License-Identifier: GPL-2.0-or-later
# Step and direction from a Mesa card (hostmot2), for pkmkins. See `pkm help guide/drives`.
#
# In the INI file, before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_mesa_step.tcl
#     HALFILE = LIB:pkmkins.tcl
#     [HOSTMOT2]
#     DRIVER = hm2_eth board_ip=10.10.10.10
#     BOARD = 7i92
#     CONFIG = num_encoders=0 num_pwmgens=0 num_stepgens=6
#     [JOINT_N]
#     SCALE = 400                 steps per unit of the joint; negative reverses the motor
#     STEPLEN STEPSPACE DIRSETUP DIRHOLD    ns, from the drive's data sheet
#     STEPGEN_MAXVEL STEPGEN_MAXACCEL       default: 1.25 times the limits of the joint
#
# and the inputs and outputs of pkmkins_drives.tcl. Joint N uses step generator N, or the one in
# [JOINT_N]STEPGEN. [HOSTMOT2]DPLL_TIMER_US (such as -100) lets the card latch positions that long before they
# are read, which removes network jitter; the firmware needs a DPLL for it.

source [file join $::env(HALLIB_DIR) pkmkins_mesa.tcl]

namespace eval pkmkins_mesa_step {}

proc pkmkins_mesa_step::generator {n} {
    return [pkmkins_mesa::instance stepgen $n STEPGEN]
}

proc pkmkins_mesa_step::of_joint {n} {
    set pin [generator $n]
    set settings [pkmkins_drives::step_settings $n $pin]
    lappend settings $pin.step_type 0 $pin.control-type 0
    return $settings
}

proc pkmkins_mesa_step::enables {n} { return [generator $n].enable }

proc pkmkins_mesa_step::wire_drive {n} {
    set pin [generator $n]
    hal net J$n:motor-pos-cmd joint.$n.motor-pos-cmd $pin.position-cmd
    hal net J$n:motor-pos-fb $pin.position-fb joint.$n.motor-pos-fb
}

proc pkmkins_mesa_step::main {} {
    pkmkins_mesa::check
    set settings [pkmkins_drives::settings pkmkins_mesa_step::of_joint]
    pkmkins_drives::load_motion
    pkmkins_mesa::load
    pkmkins_drives::wire_machine [pkmkins_mesa::functions {}] pkmkins_mesa_step::enables [pkmkins_mesa::faults]
    foreach n [pkmkins_drives::joints] { wire_drive $n }
    pkmkins_drives::set_pins [concat $settings [pkmkins_mesa::settings stepgen]]
}

pkmkins_mesa_step::main
