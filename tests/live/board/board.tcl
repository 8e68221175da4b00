# SPDX-License-Identifier: GPL-2.0-or-later
# Replaces the hardware that a drive file of pkmkins loads:
#
#     HALFILE = board/board.tcl LIB:pkmkins_mesa_step.tcl
#
# hostmot2 runs on the card of its test driver, hm2_test: the file's own lines load both, make the thread read and
# write the card, and use its gpio. Of the patterns of that card, 0 to 14, hostmot2 registers only number 12,
# which has 24 gpio without inputs and nothing else. So LinuxCNC's own step generators and encoders replace the card's
# parts under their names, motors with a lag turn the encoders, and the watchdog never bites; LinuxCNC's
# simulated port replaces hal_parport. Every name of the card that is used is written to the file `names`,
# for the test to compare with the manual of hostmot2.

namespace eval board {
    # Kind of the card's parts, from CONFIG; and names without effect here.
    variable kind {}
    variable left_out {timeout_ns step_type control-type}
    # Counts of a motor's encoder per turn.
    variable counts 400
    variable names [open names w]
}

rename hal board::hal_of_linuxcnc

proc board::ini {section key {default ""}} {
    if {![info exists ::${section}($key)]} { return $default }
    return [lindex [set ::${section}($key)] 0]
}

proc board::joints {} { return [ini KINS JOINTS] }

# Returns the name here of a pin or parameter of the card.
proc board::here {name} {
    variable names
    if {[regexp {^hm2_test\.0\.(.*)$} $name -> part]} { puts $names $part; flush $names }
    if {[regexp {^hm2_test\.0\.stepgen\.(\d\d)\.(.*)$} $name -> n pin]} { return stepgen.[scan $n %d].$pin }
    if {[regexp {^hm2_test\.0\.encoder\.(\d\d)\.scale$} $name -> n]} { return encoder.[scan $n %d].position-scale }
    if {[regexp {^hm2_test\.0\.encoder\.(\d\d)\.(.*)$} $name -> n pin]} { return encoder.[scan $n %d].$pin }
    if {[regexp {^hm2_test\.0\.pwmgen\.(\d\d)\.value$} $name -> n]} { return motor-[scan $n %d].in }
    if {[regexp {^hm2_test\.0\.pwmgen\.(\d\d)\.enable$} $name -> n]} { return powered-[scan $n %d].in0 }
    if {$name eq "hm2_test.0.watchdog.has_bit"} { return watchdog.in0 }
    return $name
}

proc board::names_of {prefix} {
    set names {}
    for {set n 0} {$n < [joints]} {incr n} { lappend names $prefix-$n }
    return [join $names ,]
}

proc board::load_steps {} {
    hal_of_linuxcnc loadrt stepgen step_type=[join [lrepeat [joints] 0] ,]
    hal_of_linuxcnc addf stepgen.make-pulses base-thread
}

# Creates the motors. A motor reaches 1 - 1/e of a commanded speed in 4.5 cycles. Its encoder has one index pulse per
# turn, and a switch closes three quarters of a turn after its initial position.
proc board::load_motors {} {
    variable counts
    hal_of_linuxcnc loadrt sim_encoder num_chan=[joints]
    hal_of_linuxcnc loadrt encoder num_chan=[joints]
    hal_of_linuxcnc loadrt lowpass names=[names_of motor]
    hal_of_linuxcnc loadrt conv_s32_float names=[names_of turned]
    hal_of_linuxcnc loadrt comp names=[names_of switch]
    hal_of_linuxcnc addf sim-encoder.make-pulses base-thread
    hal_of_linuxcnc addf encoder.update-counters base-thread
    for {set n 0} {$n < [joints]} {incr n} {
        set scale [ini JOINT_$n ENCODER_SCALE]
        hal_of_linuxcnc setp motor-$n.gain 0.2
        hal_of_linuxcnc setp sim-encoder.$n.ppr [expr {$counts / 4}]
        hal_of_linuxcnc setp sim-encoder.$n.scale [expr {$counts / $scale}]
        hal_of_linuxcnc setp switch-$n.in0 [expr {0.75 * $counts}]
        hal_of_linuxcnc net motor:$n motor-$n.out sim-encoder.$n.speed
        foreach phase {A B Z} { hal_of_linuxcnc net phase-$phase:$n sim-encoder.$n.phase-$phase encoder.$n.phase-$phase }
        hal_of_linuxcnc net raw:$n encoder.$n.rawcounts turned-$n.in
        hal_of_linuxcnc net turned:$n turned-$n.out switch-$n.in1
    }
}

proc board::load_card {config} {
    variable kind
    # A module is loaded once: the files that follow load `not`.
    hal_of_linuxcnc loadrt or2 names=watchdog,[names_of powered]
    if {[regexp {num_stepgens=[1-9]} $config]} {
        set kind steps
        load_steps
    } else {
        set kind motors
        load_motors
    }
}

# Functions that run where the file reads or writes the card.
proc board::functions {way} {
    variable kind
    switch $kind-$way {
        steps-read { return {hm2_test.0.read stepgen.capture-position} }
        steps-write { return {stepgen.update-freq hm2_test.0.write} }
        motors-read { return {hm2_test.0.read encoder.capture-position} }
        motors-write {
            set functions {}
            for {set n 0} {$n < [joints]} {incr n} { lappend functions motor-$n turned-$n switch-$n }
            return [concat $functions sim-encoder.update-speed hm2_test.0.write]
        }
    }
}

proc hal {verb args} {
    switch -glob "$verb [lindex $args 0]" {
        "loadrt hm2_*" {
            board::hal_of_linuxcnc $verb {*}$args
            return [board::load_card [lindex $args end]]
        }
        "loadrt hal_parport" { return [board::hal_of_linuxcnc loadrt sim_parport names=parport.0,parport.1] }
        "addf hm2_test.0.*" {
            board::here [lindex $args 0]
            set way [lindex [split [lindex $args 0] .] end]
            foreach name [board::functions $way] { board::hal_of_linuxcnc addf $name [lindex $args 1] }
            return
        }
        "setp *pwmgen*" { board::here [lindex $args 0]; return }
    }
    if {$verb eq "setp" && [lindex [split [lindex $args 0] .] end] in $board::left_out} {
        board::here [lindex $args 0]
        return
    }
    return [board::hal_of_linuxcnc $verb {*}[lmap name $args { board::here $name }]]
}

source [file join $::env(HALLIB_DIR) [regsub {^LIB:} [lindex $::argv 0] {}]]
