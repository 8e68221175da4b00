# SPDX-License-Identifier: GPL-2.0-or-later
# EtherCAT drives in cyclic synchronous position mode (CiA 402, CSP) for pkmkins. See
# `pkm help guide/drives`. Needs two components that LinuxCNC does not ship: lcec (linuxcnc-ethercat) and cia402
# (hal-cia402).
#
# In the INI file, before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_ethercat.tcl
#     HALFILE = LIB:pkmkins.tcl
#     [ETHERCAT]
#     CONFIG = ethercat.xml       drives and their process data
#     [JOINT_N]
#     SCALE = 10000               increments of the drive per unit of the joint; negative reverses it
#     DELAY = 3                   cycles from command to feedback, measured
#
# and the inputs and outputs of pkmkins_drives.tcl. The file names the drive of joint N `JN`, or
# [JOINT_N]SLAVE, and its process data as the pins below: controlword, opmode, target-position; statusword,
# opmode-display, actual-position.

source [file join $::env(HALLIB_DIR) pkmkins_drives.tcl]

namespace eval pkmkins_ethercat {
    # Process data of a drive and its component: pin of lcec, pin of cia402.
    variable from_drive {statusword statusword  opmode-display opmode-display  actual-position drv-actual-position}
    variable to_drive {controlword controlword  opmode opmode  target-position drv-target-position}
}

proc pkmkins_ethercat::check {} {
    pkmkins_drives::need ETHERCAT CONFIG "the file with the drives and their process data"
}

proc pkmkins_ethercat::slave {n} { return lcec.0.[pkmkins_drives::ini JOINT_$n SLAVE J$n] }

# A joint stays in one mode: LinuxCNC does the homing, with the encoder of the drive.
proc pkmkins_ethercat::of_joint {n} {
    return [list cia402.$n.pos-scale [pkmkins_drives::scale JOINT_$n SCALE "increments per unit of the joint"] \
        cia402.$n.csp-mode 1]
}

proc pkmkins_ethercat::enables {n} { return cia402.$n.enable }

proc pkmkins_ethercat::wire_drive {n} {
    variable from_drive
    variable to_drive
    foreach {data pin} $from_drive { hal net J$n:$data [slave $n].$data cia402.$n.$pin }
    foreach {data pin} $to_drive { hal net J$n:$data cia402.$n.$pin [slave $n].$data }
    hal net J$n:motor-pos-cmd joint.$n.motor-pos-cmd cia402.$n.pos-cmd
    hal net J$n:motor-pos-fb cia402.$n.pos-fb joint.$n.motor-pos-fb
    hal net J$n:fault cia402.$n.drv-fault joint.$n.amp-fault-in
}

proc pkmkins_ethercat::main {} {
    check
    set settings [pkmkins_drives::settings pkmkins_ethercat::of_joint]
    pkmkins_drives::load_motion
    hal loadusr -W lcec_conf [pkmkins_drives::ini ETHERCAT CONFIG]
    hal loadrt lcec
    hal loadrt cia402 count=[pkmkins_drives::ini KINS JOINTS]
    set read [concat lcec.read-all [lmap n [pkmkins_drives::joints] { string cat cia402.$n.read-all }]]
    set write [concat [lmap n [pkmkins_drives::joints] { string cat cia402.$n.write-all }] lcec.write-all]
    pkmkins_drives::wire_machine [list $read $write] pkmkins_ethercat::enables
    foreach n [pkmkins_drives::joints] { wire_drive $n }
    pkmkins_drives::set_pins $settings
}

pkmkins_ethercat::main
