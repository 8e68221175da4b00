# SPDX-License-Identifier: GPL-2.0-or-later
# A simulated machine for pkmkins, with drives that lag and saturate.
#
# In the INI file, before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_sim.tcl
#
# Loads the kinematics, the motion controller and a drive for every joint. The drive follows the
# commanded position within [JOINT_N]MAX_VELOCITY and MAX_ACCELERATION, so that a command too fast for
# a real drive causes a following error. (LinuxCNC's own simulation feeds commands back unchanged at any
# speed.)
#
# The position at power-up is [JOINT_N]SIM_START, or [JOINT_N]HOME if that is missing. A joint with
# HOME_SEARCH_VEL = 0 has an absolute encoder that shows this position. Any other joint has an
# encoder that starts at 0 and a home switch that closes when the true position passes
# HOME_OFFSET in the search direction.
#
# Estop and tool change answer at once; the spindle is LinuxCNC's simulated one.

namespace eval pkmkins_sim {}

source [file join $::env(HALLIB_DIR) sim_lib.tcl]

proc pkmkins_sim::ini {section key {default ""}} {
    if {![info exists ::${section}($key)]} { return $default }
    return [lindex [set ::${section}($key)] 0]
}

proc pkmkins_sim::joint_names {suffix} {
    set names {}
    for {set n 0} {$n < [ini KINS JOINTS]} {incr n} { lappend names J${n}_$suffix }
    return $names
}

proc pkmkins_sim::load_parts {component names} {
    hal loadrt $component names=[join $names ,]
}

proc pkmkins_sim::add_functions {names {function ""}} {
    foreach name $names { hal addf $name$function servo-thread }
}

proc pkmkins_sim::load_motion {} {
    hal loadrt {*}[lindex $::KINS(KINEMATICS) end]
    hal loadrt {*}[ini EMCMOT EMCMOT motmod] servo_period_nsec=[ini EMCMOT SERVO_PERIOD] num_joints=[ini KINS JOINTS]
    hal addf motion-command-handler servo-thread
    hal addf motion-controller servo-thread
}

proc pkmkins_sim::close_loops {} {
    foreach {signal source target} {
        estop-loop    iocontrol.0.user-enable-out iocontrol.0.emc-enable-in
        prepare-loop  iocontrol.0.tool-prepare    iocontrol.0.tool-prepared
        change-loop   iocontrol.0.tool-change     iocontrol.0.tool-changed
    } {
        hal net sim:$signal $source $target
    }
}

# The drives count from the position at power-up, and _true adds that position: no start sequence
# is needed. Each cycle: command, drive, encoder.
proc pkmkins_sim::load_drives {} {
    load_parts mux2 [joint_names select]
    load_parts limit3 [joint_names drive]
    load_parts offset [concat [joint_names encoder] [joint_names true]]
    add_functions [joint_names encoder] .update-output
    add_functions [joint_names select]
    add_functions [joint_names drive]
    add_functions [joint_names encoder] .update-feedback
    add_functions [joint_names true] .update-output
}

proc pkmkins_sim::is_absolute {n} {
    return [expr {[ini JOINT_$n HOME_SEARCH_VEL 0] == 0}]
}

proc pkmkins_sim::start_position {n} {
    return [ini JOINT_$n SIM_START [ini JOINT_$n HOME 0]]
}

# A disabled drive brakes and then stays: its command is its own position.
proc pkmkins_sim::wire_drive {n} {
    hal net J$n:enable joint.$n.amp-enable-out J${n}_select.sel
    hal net J$n:motor-pos-cmd joint.$n.motor-pos-cmd J${n}_encoder.in
    hal net J$n:command J${n}_encoder.out J${n}_select.in1
    hal net J$n:target J${n}_select.out J${n}_drive.in
    hal net J$n:travel J${n}_drive.out J${n}_select.in0 J${n}_encoder.fb-in J${n}_true.in
    hal net J$n:motor-pos-fb J${n}_encoder.fb-out joint.$n.motor-pos-fb
    hal setp J${n}_drive.maxv [ini JOINT_$n MAX_VELOCITY]
    hal setp J${n}_drive.maxa [ini JOINT_$n MAX_ACCELERATION]
    hal setp J${n}_true.offset [start_position $n]
    # `offset` subtracts on the feedback side what it adds on the command side.
    if {[is_absolute $n]} { hal setp J${n}_encoder.offset [expr {-[scan [start_position $n] %f]}] }
}

proc pkmkins_sim::searching_joints {} {
    set joints {}
    for {set n 0} {$n < [ini KINS JOINTS]} {incr n} {
        if {![is_absolute $n]} { lappend joints $n }
    }
    return $joints
}

# Home switch of a joint: closed while the true position is beyond HOME_OFFSET in the search
# direction.
proc pkmkins_sim::load_switches {} {
    set joints [searching_joints]
    if {![llength $joints]} { return }
    set names [lmap n $joints { string cat J${n}_switch }]
    load_parts comp $names
    add_functions $names
    foreach n $joints { wire_switch $n }
}

proc pkmkins_sim::wire_switch {n} {
    lassign {in0 in1} low high
    if {[ini JOINT_$n HOME_SEARCH_VEL] < 0} { lassign {in1 in0} low high }
    hal net J$n:true-position J${n}_true.out J${n}_switch.$high
    hal setp J${n}_switch.$low [ini JOINT_$n HOME_OFFSET 0]
    hal net J$n:home-switch J${n}_switch.out joint.$n.home-sw-in
}

proc pkmkins_sim::main {} {
    load_motion
    close_loops
    load_drives
    for {set n 0} {$n < [ini KINS JOINTS]} {incr n} { wire_drive $n }
    load_switches
    sim_spindle
}

pkmkins_sim::main
