# SPDX-License-Identifier: GPL-2.0-or-later
# Procedures common to the HAL files for real drives, which source this file. See `pkm help guide/drives`.
#
# Loads the kinematics and the motion controller; wires the emergency stop chain, enables, faults, limit
# and home switches; reports keys missing in the INI file before LinuxCNC starts.
#
# Inputs and outputs are named in the INI file by the pin that the driver has for them:
#
#     [IO]
#     ESTOP_PIN    input, true while the emergency stop chain is closed; NONE without a chain
#     ENABLE_PIN   outputs, true while the machine is on: contactors, a common enable of all drives
#     TOOL_CHANGE  MANUAL (default: LinuxCNC's window asks for the tool) or NONE (answers at once)
#     [JOINT_N]
#     ENABLE_PIN   outputs, true while this joint is on
#     FAULT_PIN    input, true while its drive reports a fault
#     HOME_SWITCH_PIN, MIN_LIMIT_PIN, MAX_LIMIT_PIN   inputs, true at the switch

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

# Returns a required key; "" with a complaint if it is missing.
proc pkmkins_drives::need {section key what} {
    set text [ini $section $key]
    if {$text eq ""} { complain $section $key "is missing: expected $what" }
    return $text
}

# Returns a decimal number; if it is missing the default, or {} with a complaint. Leading zeros would make it
# octal in Tcl and in an integer pin.
proc pkmkins_drives::number {section key what {default ""}} {
    if {$default eq ""} { need $section $key $what }
    set text [regsub {^([+-]?)0+(?=[0-9])} [ini $section $key $default] {\1}]
    if {$text ne "" && ![regexp {^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$} $text]} {
        complain $section $key "= \"$text\": expected $what, one decimal number"
        return ""
    }
    return $text
}

# Returns a decimal number other than 0, by which positions are multiplied.
proc pkmkins_drives::scale {section key what} {
    set text [number $section $key $what]
    if {$text ne "" && $text == 0} { complain $section $key "= \"$text\": expected $what, not 0" }
    return $text
}

# Prints all complaints and ends LinuxCNC's start, which a HAL file does by an exit code other than 0.
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

# Returns a name for each joint, separated by commas as loadrt requires.
proc pkmkins_drives::names {suffix} {
    return [join [lmap n [joints] { string cat J${n}_$suffix }] ,]
}

# Returns 1.25 times a limit of a joint: a step generator with no reserve beyond LinuxCNC's commands never
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
        # This pin is an integer.
        if {[regexp {[^0-9]} $text]} { complain $section $key "= \"$text\": expected $what, a whole number" }
        lappend settings $pin.[string tolower $key] $text
    }
    foreach {key parameter limit} {STEPGEN_MAXVEL maxvel MAX_VELOCITY STEPGEN_MAXACCEL maxaccel MAX_ACCELERATION} {
        lappend settings $pin.$parameter [number $section $key "units and seconds" [above $n $limit]]
    }
    return $settings
}

# Returns the settings of all joints, from `of_joint` for each: pins and values, alternating. Ends the start
# before anything is loaded if a key is missing or wrong.
proc pkmkins_drives::settings {of_joint} {
    need KINS JOINTS "the number of joints"
    need IO ESTOP_PIN "the input that is true while the emergency stop chain is closed, or NONE"
    set settings {}
    foreach n [joints] { lappend settings {*}[$of_joint $n] }
    stop_on_errors
    return $settings
}

# Sets pins by `hal setp`: haltcl's own setp would evaluate the text (010 would become 8).
proc pkmkins_drives::set_pins {settings} {
    foreach {pin text} $settings { hal setp $pin $text }
}

proc pkmkins_drives::load_motion {} {
    hal loadrt {*}[lindex $::KINS(KINEMATICS) end]
    set periods servo_period_nsec=[ini EMCMOT SERVO_PERIOD]
    if {[ini EMCMOT BASE_PERIOD 0] != 0} { lappend periods base_period_nsec=[ini EMCMOT BASE_PERIOD] }
    hal loadrt {*}[ini EMCMOT EMCMOT motmod] {*}$periods num_joints=[ini KINS JOINTS]
}

# Adds the functions of one servo cycle. Feedback of the drives is read before motion and commands are
# written after it, so that a command is not delayed by a cycle.
proc pkmkins_drives::add_functions {read write} {
    set safety {pkmkins-closed pkmkins-fault estop-latch.0}
    foreach name [concat $read $safety {motion-command-handler motion-controller} $write] {
        hal addf $name servo-thread
    }
}

# Returns the signal of a pin, or `signal` if it has none. HAL also shows pins with longer names, such as the inverted
# twin of an input.
proc pkmkins_drives::signal_of {pin signal} {
    foreach line [split [hal show pin $pin] \n] {
        if {[regexp {\s(\S+)\s+(?:=[=>]>?|<=[=>]?)\s+(\S+)\s*$} $line -> name own] && $name eq $pin} { return $own }
    }
    return $signal
}

# Connects a writing pin to reading pins, all on one signal.
proc pkmkins_drives::connect {signal source args} {
    if {[llength $args]} { hal net [signal_of $source $signal] $source {*}$args }
}

# Returns the pins that a key names.
proc pkmkins_drives::pins {section key} {
    return [regexp -all -inline {\S+} [ini $section $key]]
}

# Returns every output that the INI file names, for drivers whose pins can be inputs or outputs.
proc pkmkins_drives::outputs {} {
    set outputs [concat [pins IO ENABLE_PIN] [pins IO PUMP_PIN]]
    foreach key {ENABLE_PIN FORWARD_PIN REVERSE_PIN} { lappend outputs {*}[pins SPINDLE_0 $key] }
    foreach n [joints] { lappend outputs {*}[pins JOINT_$n ENABLE_PIN] }
    return $outputs
}

# Wires the emergency stop chain in software: a latch that stays open until the operator resets it. `faults`
# are pins that open it while they are true. The hardware chain cuts the power; this one only follows it.
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

# Wires enable, fault and switches of a joint; `enables` are pins of its drive that also need the enable.
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

# Wires everything except the drives. `functions` are two lists, the drives' read and write functions;
# `enables` returns the enable pins of a joint's drive; `faults` open the emergency stop chain.
proc pkmkins_drives::wire_machine {functions enables {faults {}}} {
    load_estop $faults
    load_tool_change
    add_functions {*}$functions
    foreach n [joints] { wire_joint $n [$enables $n] }
    connect drives:machine-on motion.motion-enabled {*}[pins IO ENABLE_PIN]
}
