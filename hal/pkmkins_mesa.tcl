# SPDX-License-Identifier: GPL-2.0-or-later
# Procedures common to Mesa cards (hostmot2), sourced by pkmkins_mesa_step.tcl and pkmkins_mesa_servo.tcl.

source [file join $::env(HALLIB_DIR) pkmkins_drives.tcl]

namespace eval pkmkins_mesa {
    # Servo cycles without communication after which the card's watchdog stops all outputs.
    variable watchdog_cycles 5
}

proc pkmkins_mesa::check {} {
    pkmkins_drives::need HOSTMOT2 DRIVER "the driver of the card with its parameters, such as hm2_eth board_ip=10.10.10.10"
    pkmkins_drives::need HOSTMOT2 BOARD "the HAL name of the card, such as 7i92"
}

# Returns the card's name in HAL.
proc pkmkins_mesa::card {} { return hm2_[pkmkins_drives::ini HOSTMOT2 BOARD].0 }

# Returns a joint's function on the card, with the joint's number or the number that a key gives.
proc pkmkins_mesa::instance {kind n key} {
    return [card].$kind.[format %02d [scan [pkmkins_drives::ini JOINT_$n $key $n] %d]]
}

proc pkmkins_mesa::load {} {
    hal loadrt hostmot2
    set config [pkmkins_drives::ini HOSTMOT2 CONFIG]
    hal loadrt {*}[pkmkins_drives::ini HOSTMOT2 DRIVER] {*}[expr {$config eq "" ? {} : [list config=$config]}]
}

# Returns the functions that read and that write in a cycle, with `loops` between motion and the card.
proc pkmkins_mesa::functions {loops} {
    return [list [card].read [concat $loops [card].write]]
}

# Opens the emergency stop chain: the card has stopped because LinuxCNC was late.
proc pkmkins_mesa::faults {} { return [card].watchdog.has_bit }

# Returns the settings of the card. `latched` is its kind of function that measures positions, if one does: all
# functions of a kind share one timer.
proc pkmkins_mesa::settings {latched} {
    variable watchdog_cycles
    lappend settings [card].watchdog.timeout_ns [expr {$watchdog_cycles * [scan [pkmkins_drives::ini EMCMOT SERVO_PERIOD] %d]}]
    set timer [pkmkins_drives::ini HOSTMOT2 DPLL_TIMER_US]
    if {$timer ne ""} {
        lappend settings [card].dpll.01.timer-us $timer
        if {$latched ne ""} { lappend settings [card].$latched.timer-number 1 }
    }
    # Configures GPIO pins as outputs.
    foreach pin [pkmkins_drives::outputs] {
        if {[regexp {^(.*\.gpio\.\d+)\.out$} $pin -> gpio]} { lappend settings $gpio.is_output 1 }
    }
    return $settings
}
