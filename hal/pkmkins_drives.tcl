# SPDX-License-Identifier: GPL-2.0-or-later
# What the HAL files for real drives have in common, for pkmkins; they source it. See docs/guide/drives.md.
#
# Loads the kinematics and the motion controller, wires the chain of the emergency stop, enables, faults,
# limit and home switches, and what is missing in the INI file is said before LinuxCNC starts.
#
# Inputs and outputs are named in the INI file by the pin that the driver has for them:
#
#     [IO]
#     ESTOP_PIN    input, true while the chain of the emergency stop is closed; NONE where there is no chain
#     ENABLE_PIN   outputs, true while the machine is on: contactors, drives with one enable for all
#     TOOL_CHANGE  MANUAL (default: LinuxCNC's window asks for the tool) or NONE (answers at once)
#     [JOINT_N]
#     ENABLE_PIN   outputs, true while this joint is on
#     FAULT_PIN    input, true where its drive reports a fault
#     HOME_SWITCH_PIN, MIN_LIMIT_PIN, MAX_LIMIT_PIN   inputs, true where the switch is met

namespace eval pkmkins_drives {
    variable errors {}
}

proc pkmkins_drives::ini {section key {default ""}} {
    if {![info exists ::${section}($key)]} { return $default }
    return [lindex [set ::${section}($key)] 0]
}

proc pkmkins_drives::complain {section key text} {
    variable errors
    lappend errors "\[$section\]$key $text"
}

# A key that has to be there; "" and a complaint where it is not.
proc pkmkins_drives::need {section key what} {
    set text [ini $section $key]
    if {$text eq ""} { complain $section $key "is missing: expected $what" }
    return $text
}

# Returns a decimal number; without it the default, or {} with a complaint. Zeros in front would make it octal
# for Tcl and for a pin that takes integers.
proc pkmkins_drives::number {section key what {default ""}} {
    if {$default eq ""} { need $section $key $what }
    set text [regsub {^([+-]?)0+(?=[0-9])} [ini $section $key $default] {\1}]
    if {$text ne "" && ![regexp {^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$} $text]} {
        complain $section $key "= \"$text\": expected $what, one decimal number"
        return ""
    }
    return $text
}

# The same, and not 0: what a position is multiplied by.
proc pkmkins_drives::scale {section key what} {
    set text [number $section $key $what]
    if {$text ne "" && $text == 0} { complain $section $key "= \"$text\": expected $what, not 0" }
    return $text
}

# LinuxCNC ends its start when a HAL file ends with a code that is not 0.
proc pkmkins_drives::stop_on_errors {} {
    variable errors
    if {![llength $errors]} { return }
    puts stderr "\npkmkins: LinuxCNC does not start, because the drives are not configured correctly:"
    foreach text $errors { puts stderr "pkmkins: $text" }
    puts stderr ""
    exit 1
}

proc pkmkins_drives::joints {} {
    set joints {}
    for {set n 0} {$n < [ini KINS JOINTS]} {incr n} { lappend joints $n }
    return $joints
}

# One name for each joint, separated by commas, as loadrt takes them.
proc pkmkins_drives::names {suffix} {
    return [join [lmap n [joints] { string cat J${n}_$suffix }] ,]
}

# A limit of a joint and a quarter: a generator of steps that can do no more than LinuxCNC asks for never
# catches up.
proc pkmkins_drives::above {n key} {
    set limit [number JOINT_$n $key "the limit of the joint"]
    return [expr {$limit eq "" ? 0 : 1.25 * $limit}]
}

# Returns the settings of a joint's step generator, whose pins begin with `pin`.
proc pkmkins_drives::step_settings {n pin} {
    set section JOINT_$n
    lappend settings $pin.position-scale [scale $section SCALE "steps per unit of the joint"]
    foreach key {STEPLEN STEPSPACE DIRSETUP DIRHOLD} {
        set what "nanoseconds, from the data sheet of the drive"
        set text [number $section $key $what]
        # The pin takes integers only.
        if {[regexp {[^0-9]} $text]} { complain $section $key "= \"$text\": expected $what, a whole number" }
        lappend settings $pin.[string tolower $key] $text
    }
    foreach {key parameter limit} {STEPGEN_MAXVEL maxvel MAX_VELOCITY STEPGEN_MAXACCEL maxaccel MAX_ACCELERATION} {
        lappend settings $pin.$parameter [number $section $key "units and seconds" [above $n $limit]]
    }
    return $settings
}

# The settings of all joints, as `of_joint` has them of one: pins and values, in turn. Stops the start
# before anything is loaded where a key is missing or no good.
proc pkmkins_drives::settings {of_joint} {
    need KINS JOINTS "the number of joints"
    need IO ESTOP_PIN "the input that is true while the emergency stop chain is closed, or NONE"
    set settings {}
    foreach n [joints] { lappend settings {*}[$of_joint $n] }
    stop_on_errors
    return $settings
}

# `hal setp`, not haltcl's own setp, which would evaluate the text (010 would become 8).
proc pkmkins_drives::set_pins {settings} {
    foreach {pin text} $settings { hal setp $pin $text }
}

proc pkmkins_drives::load_motion {} {
    hal loadrt {*}[lindex $::KINS(KINEMATICS) end]
    set periods servo_period_nsec=[ini EMCMOT SERVO_PERIOD]
    if {[ini EMCMOT BASE_PERIOD 0] != 0} { lappend periods base_period_nsec=[ini EMCMOT BASE_PERIOD] }
    hal loadrt {*}[ini EMCMOT EMCMOT motmod] {*}$periods num_joints=[ini KINS JOINTS]
}

# One cycle of the servo thread. What the drives show is read before motion, and what they are to do is
# written after it, so that a command is no cycle older than it has to be.
proc pkmkins_drives::add_functions {read write} {
    set safety {pkmkins-closed pkmkins-fault estop-latch.0}
    foreach name [concat $read $safety {motion-command-handler motion-controller} $write] {
        hal addf $name servo-thread
    }
}

# Returns the signal of a pin, or the one given. HAL shows pins with longer names as well, such as the inverted twin of an input.
proc pkmkins_drives::signal_of {pin signal} {
    foreach line [split [hal show pin $pin] \n] {
        if {[regexp {\s(\S+)\s+(?:=[=>]>?|<=[=>]?)\s+(\S+)\s*$} $line -> name own] && $name eq $pin} { return $own }
    }
    return $signal
}

# Brings a pin that writes to those that read; it is on one signal, however many read it.
proc pkmkins_drives::connect {signal source args} {
    if {[llength $args]} { hal net [signal_of $source $signal] $source {*}$args }
}

# The pins that a key names.
proc pkmkins_drives::pins {section key} {
    return [regexp -all -inline {\S+} [ini $section $key]]
}

# Every output that the INI file names, for drivers whose pins can be either.
proc pkmkins_drives::outputs {} {
    set outputs [concat [pins IO ENABLE_PIN] [pins IO PUMP_PIN]]
    foreach key {ENABLE_PIN FORWARD_PIN REVERSE_PIN} { lappend outputs {*}[pins SPINDLE_0 $key] }
    foreach n [joints] { lappend outputs {*}[pins JOINT_$n ENABLE_PIN] }
    return $outputs
}

# The chain, in software: a latch that stays open until the operator resets it. `faults` are pins that open
# it while they are true. The chain of hardware takes the power away by itself; this one only knows of it.
proc pkmkins_drives::load_estop {faults} {
    hal loadrt estop_latch count=1
    hal loadrt logic names=pkmkins-closed,pkmkins-fault personality=0x102,[format 0x%x [expr {0x200 + max(2, [llength $faults])}]]
    hal net drives:user-enable iocontrol.0.user-enable-out pkmkins-closed.in-00
    set input [ini IO ESTOP_PIN]
    connect drives:estop-input [expr {$input eq "NONE" ? "iocontrol.0.user-enable-out" : $input}] pkmkins-closed.in-01
    set k 0
    foreach pin $faults {
        connect drives:fault-$k $pin pkmkins-fault.in-[format %02d $k]
        incr k
    }
    hal net drives:closed pkmkins-closed.and estop-latch.0.ok-in
    hal net drives:fault pkmkins-fault.or estop-latch.0.fault-in
    hal net drives:estop-reset iocontrol.0.user-request-enable estop-latch.0.reset
    hal net drives:estop-ok estop-latch.0.ok-out iocontrol.0.emc-enable-in
}

proc pkmkins_drives::load_tool_change {} {
    if {[ini IO TOOL_CHANGE MANUAL] eq "NONE"} {
        hal net drives:prepare iocontrol.0.tool-prepare iocontrol.0.tool-prepared
        hal net drives:change iocontrol.0.tool-change iocontrol.0.tool-changed
        return
    }
    hal loadusr -W hal_manualtoolchange
    hal net drives:prepare iocontrol.0.tool-prepare iocontrol.0.tool-prepared
    hal net drives:change iocontrol.0.tool-change hal_manualtoolchange.change
    hal net drives:changed hal_manualtoolchange.changed iocontrol.0.tool-changed
    hal net drives:tool-number iocontrol.0.tool-prep-number hal_manualtoolchange.number
}

# Enable, fault and switches of a joint; `enables` are pins of its drive that need the enable as well.
proc pkmkins_drives::wire_joint {n enables} {
    connect J$n:enable joint.$n.amp-enable-out {*}$enables {*}[pins JOINT_$n ENABLE_PIN]
    foreach {key target} {
        FAULT_PIN       amp-fault-in
        HOME_SWITCH_PIN home-sw-in
        MIN_LIMIT_PIN   neg-lim-sw-in
        MAX_LIMIT_PIN   pos-lim-sw-in
    } {
        foreach pin [pins JOINT_$n $key] { connect input:$pin $pin joint.$n.$target }
    }
}

# Everything but the drives themselves. `functions` are what they read and what they write, in two lists;
# `enables` gives the enables of a joint's drive; `faults` open the chain of the emergency stop.
proc pkmkins_drives::wire_machine {functions enables {faults {}}} {
    load_estop $faults
    load_tool_change
    add_functions {*}$functions
    foreach n [joints] { wire_joint $n [$enables $n] }
    connect drives:machine-on motion.motion-enabled {*}[pins IO ENABLE_PIN]
}
