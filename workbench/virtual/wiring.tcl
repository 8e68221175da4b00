# SPDX-License-Identifier: GPL-2.0-or-later
# The HAL files of a simulated machine, for LinuxCNC in virtual time:
#
#     tclsh wiring.tcl MACHINE.ini MODULES
#
# Runs LIB:pkmkins_sim.tcl and LIB:pkmkins.tcl as LinuxCNC would, with a command `hal` that asks for one
# step a line on standard output and reads the answer from standard input: "ok" and what was asked for,
# or "error" and why. MODULES is the folder of LinuxCNC's modules.

namespace eval wiring {
    # Signal of each pin that is on one.
    variable signals [dict create]
    variable modules ""
}

# As LinuxCNC's haltcl does it, whose own package would attach to the HAL of this computer: every section
# is a global array, every key a list of its values.
proc wiring::parse {ini} {
    set file [open $ini]
    while {[gets $file line] >= 0} {
        set line [string trim $line]
        if {[regexp {^\[(.*)\]$} $line -> section]} { continue }
        if {![regexp {^([^#]+?)\s*=\s*(.*)$} $line -> key value]} { continue }
        lappend ::${section}($key) $value
    }
    close $file
}

proc wiring::ask {args} {
    puts [join $args]
    flush stdout
    if {[gets stdin answer] < 0} { error "LinuxCNC has gone away" }
    if {![regexp {^ok ?(.*)$} $answer -> found]} { error $answer }
    return $found
}

proc wiring::net {signal args} {
    variable signals
    foreach word $args {
        if {[regexp {^<?=>?>?$} $word]} { continue }
        dict set signals $word $signal
        ask net $signal $word
    }
}

# As halcmd prints a pin that is on a signal.
proc wiring::show {pin} {
    variable signals
    if {![dict exists $signals $pin]} { return "" }
    return "  $pin ==> [dict get $signals $pin]"
}

proc hal {verb args} {
    switch -glob "$verb [lindex $args 0]" {
        "loadrt *" { return [wiring::ask load [file join $wiring::modules [lindex $args 0].so] {*}[lrange $args 1 end]] }
        "net *" { return [wiring::net {*}$args] }
        "show pin" { return [wiring::show [lindex $args 1]] }
        "setp *" - "list pin" { return [wiring::ask $verb {*}$args] }
        "addf *" { return [wiring::ask addf [lindex $args 0]] }
    }
    error "the HAL files do more than is known here: hal $verb $args"
}

# As haltcl has them: the commands of HAL by themselves, and `setp` with an expression.
foreach verb {loadrt net addf} { proc $verb args "hal $verb {*}\$args" }
proc setp {pin value} { hal setp $pin [uplevel [list expr $value]] }

# A key of the INI file, or what LinuxCNC takes without it.
proc wiring::value {section key default} {
    if {![info exists ::${section}($key)]} { return $default }
    return [lindex [set ::${section}($key)] 0]
}

proc wiring::main {ini folder} {
    variable modules $folder
    parse $ini
    hal loadrt {*}[value TRAJ TPMOD tpmod]
    hal loadrt {*}[value EMCMOT HOMEMOD homemod]
    set ::env(HALLIB_DIR) [exec linuxcnc_var HALLIB_DIR]
    foreach name {pkmkins_sim.tcl pkmkins.tcl} {
        uplevel #0 [list source [file join $::env(HALLIB_DIR) $name]]
    }
    ask done
}

wiring::main {*}$argv
