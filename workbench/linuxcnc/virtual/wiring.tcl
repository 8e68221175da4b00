# SPDX-License-Identifier: GPL-2.0-or-later
# The HAL files of a simulated machine, for LinuxCNC in virtual time:
#
#     tclsh wiring.tcl MACHINE.ini BESIDE MODULES [FILE...]
#
# pkm writes `ini.tcl`, this script and a line that calls `wiring::main` into one file. It runs LIB:pkmkins_sim.tcl,
# LIB:pkmkins.tcl and the files, of Tcl or of halcmd, as LinuxCNC would. The command `hal` prints one step per line on
# standard output and reads the answer from standard input: "ok" and the result, or "error" and the reason. The words
# of a step are separated by tabs, because file names may contain blanks. MODULES is the folder of LinuxCNC's modules,
# BESIDE that of the library for virtual time: files in BESIDE take precedence, so that a build can be tested before
# it is installed.

namespace eval wiring {
    # Signal of each connected pin.
    variable signals [dict create]
    # Folders of modules: those of the files, the library's, and LinuxCNC's.
    variable modules {}
}

# Reads the INI file as haltcl does: every section is a global array, every key a list of its values.
proc wiring::parse {ini} {
    foreach {section key value} [ini_values $ini] { lappend ::${section}($key) $value }
}

proc wiring::ask {args} {
    puts [join $args "\t"]
    flush stdout
    if {[gets stdin answer] < 0} { error "LinuxCNC has exited" }
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

# Returns a connected pin as halcmd prints it.
proc wiring::show {pin} {
    variable signals
    if {![dict exists $signals $pin]} { return "" }
    return "  $pin ==> [dict get $signals $pin]"
}

# Returns the file with a name in the first folder that has one.
proc wiring::first {folders name} {
    foreach folder $folders {
        set file [file join $folder $name]
        if {[file exists $file]} { return $file }
    }
    error "there is no $name in [join $folders {, }]"
}

proc wiring::loadrt {name args} {
    variable modules
    ask load [first $modules $name.so] {*}$args
}

# Runs a file of halcmd, with one command per line.
proc wiring::run_hal {file} {
    set lines [open $file]
    while {[gets $lines line] >= 0} {
        set words [regexp -all -inline {[^ \t]+} [regsub {#.*$} $line ""]]
        if {[llength $words]} { hal {*}$words }
    }
    close $lines
}

proc wiring::run_file {file} {
    if {[file extension $file] eq ".hal"} { run_hal $file } else { uplevel #0 [list source $file] }
}

proc hal {verb args} {
    switch -glob "$verb [lindex $args 0]" {
        "loadrt *" { return [wiring::loadrt {*}$args] }
        "net *" { return [wiring::net {*}$args] }
        "show pin" { return [wiring::show [lindex $args 1]] }
        "setp *" - "getp *" - "list pin" { return [wiring::ask $verb {*}$args] }
        "addf *" { return [wiring::ask addf [lindex $args 0]] }
    }
    error "the HAL files do more than is known here: hal $verb $args"
}

# Runs pkmkins-pins without the program that limits its time: the kernel lets a run start few programs, and the time of
# a run is limited anyway.
rename exec wiring::exec
proc exec args {
    if {[file tail [lindex $args end-2]] eq "pkmkins-pins"} { set args [lrange $args end-2 end] }
    return [wiring::exec {*}$args]
}

# As in haltcl: the HAL commands without `hal`, and `setp` with an expression.
foreach verb {loadrt net addf} { proc $verb args "hal $verb {*}\$args" }
proc setp {pin value} { hal setp $pin [uplevel [list expr $value]] }

# Returns a key of the INI file, or LinuxCNC's default.
proc wiring::value {section key default} {
    if {![info exists ::${section}($key)]} { return $default }
    return [lindex [set ::${section}($key)] 0]
}

proc wiring::main {ini beside folder args} {
    variable modules [concat [lsort -unique [lmap file $args {file dirname $file}]] [list $beside $folder]]
    set ::env(INI_FILE_NAME) $ini
    parse $ini
    hal loadrt {*}[value TRAJ TPMOD tpmod]
    hal loadrt {*}[value EMCMOT HOMEMOD homemod]
    foreach name {pkmkins_sim.tcl pkmkins.tcl} { run_file [first [list $beside $::env(HALLIB_DIR)] $name] }
    foreach file $args { run_file $file }
    ask done
}
