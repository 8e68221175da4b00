# SPDX-License-Identifier: GPL-2.0-or-later
# Step and direction from a parallel port, made by LinuxCNC itself (stepgen), for pkmkins. See
# docs/guide/drives.md.
#
# In the INI file, before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_parport.tcl
#     HALFILE = LIB:pkmkins.tcl
#     [EMCMOT]
#     BASE_PERIOD = 50000         ns, from latency-test
#     [PARPORT]
#     PORTS = 0x378 out           a port, or more, as hal_parport takes them
#     [JOINT_N]
#     STEP_PIN = parport.0.pin-02-out
#     DIR_PIN = parport.0.pin-03-out
#     SCALE = 40                  steps per unit of the joint; negative turns the motor round
#     STEPLEN STEPSPACE DIRSETUP DIRHOLD    ns, from the sheet of the drive
#     STEPGEN_MAXVEL STEPGEN_MAXACCEL       default: 1.25 times the limits of the joint
#
# and the inputs and outputs of pkmkins_drives.tcl. Six drives take all twelve outputs of a port: enables
# and inputs then need a second one. No more than eight joints.

source [file join $::env(HALLIB_DIR) pkmkins_drives.tcl]

namespace eval pkmkins_parport {}

proc pkmkins_parport::ports {} {
    set count [llength [lsearch -all -regexp [pkmkins_drives::pins PARPORT PORTS] {^(0x[0-9a-fA-F]+|[0-9]+)$}]]
    set ports {}
    for {set k 0} {$k < $count} {incr k} { lappend ports parport.$k }
    return $ports
}

proc pkmkins_parport::check {} {
    pkmkins_drives::number EMCMOT BASE_PERIOD "the base period in nanoseconds, see latency-test"
    pkmkins_drives::need PARPORT PORTS "addresses of the ports, such as 0x378 out"
}

proc pkmkins_parport::of_joint {n} {
    foreach key {STEP_PIN DIR_PIN} { pkmkins_drives::need JOINT_$n $key "an output of a port, such as parport.0.pin-02-out" }
    return [pkmkins_drives::step_settings $n stepgen.$n]
}

proc pkmkins_parport::enables {n} { return stepgen.$n.enable }

proc pkmkins_parport::wire_drive {n} {
    hal net J$n:motor-pos-cmd joint.$n.motor-pos-cmd stepgen.$n.position-cmd
    hal net J$n:motor-pos-fb stepgen.$n.position-fb joint.$n.motor-pos-fb
    hal net J$n:step stepgen.$n.step [pkmkins_drives::ini JOINT_$n STEP_PIN]
    hal net J$n:dir stepgen.$n.dir [pkmkins_drives::ini JOINT_$n DIR_PIN]
}

# The base thread: inputs, steps, outputs.
proc pkmkins_parport::add_base_functions {} {
    foreach port [ports] { hal addf $port.read base-thread }
    hal addf stepgen.make-pulses base-thread
    foreach port [ports] { hal addf $port.write base-thread }
}

proc pkmkins_parport::main {} {
    check
    set settings [pkmkins_drives::settings pkmkins_parport::of_joint]
    pkmkins_drives::load_motion
    hal loadrt stepgen step_type=[join [lmap n [pkmkins_drives::joints] { string cat 0 }] ,]
    hal loadrt hal_parport cfg=[pkmkins_drives::ini PARPORT PORTS]
    add_base_functions
    pkmkins_drives::wire_machine {stepgen.capture-position stepgen.update-freq} pkmkins_parport::enables
    foreach n [pkmkins_drives::joints] { wire_drive $n }
    pkmkins_drives::set_pins $settings
}

pkmkins_parport::main
