#!/usr/bin/tclsh
# SPDX-License-Identifier: GPL-2.0-or-later
# The HAL files in hal/, without LinuxCNC: what each asks of HAL, for the INI files in cases, is what stands beside.
#
#     tests/hal/hal_test.tcl [FOLDER FILE]     FOLDER: HAL files in place of hal/; the tests of FILE, to the first failure
#
# A case is an INI file and a table: `load`, `start` and `run` (a function in a thread) in their order, then every
# value and every signal with its writer before the arrow. The tables were written from docs/guide/drives.md and from the manual
# pages of the components, not by the files that they check.

package require tcltest
set here [file dirname [file normalize [info script]]]
source $here/linuxcnc.tcl
if {$argc} { set model::hal [file normalize [lindex $argv 0]] }
set folder [exec mktemp -d]

proc test args {
    uplevel 1 [list tcltest::test {*}$args]
    if {$::argc && $tcltest::numTests(Failed)} { finish }
}

proc finish {} {
    file delete -force $::folder
    puts "$tcltest::numTests(Passed) passed, $tcltest::numTests(Failed) failed"
    exit [expr {$tcltest::numTests(Failed) > 0}]
}

# Returns the tests that use a HAL file.
proc tests_of {file} {
    switch $file {
        pkmkins.tcl { return pkmkins }
        pkmkins_panel.tcl { return panel }
        pkmkins_jog.tcl { return {jog panel} }
        default { return drives }
    }
}

# Returns the text of a file.
proc content {file} {
    set channel [open $file]
    set text [read $channel]
    close $channel
    return $text
}

# Returns the line that pkmkins_jog.tcl prints for a reason.
proc reported {text} { return "says pkmkins: jogs do not slow down near limits: $text" }

# Returns the lines of a table in the order of `asked`.
proc table {text} {
    set lines [lsearch -all -inline -regexp [split $text \n] {^[^#]}]
    set ordered [lsearch -all -inline -regexp $lines {^(load|start|run|ends|stops) }]
    return [concat $ordered [lsort [lsearch -all -inline $lines "set *"]] [lsort [lsearch -all -inline $lines "net *"]] \
        [lsearch -all -inline $lines "says *"]]
}

foreach file [expr {$argc ? [tests_of [lindex $argv 1]] : {drives jog panel pkmkins}}] { source $here/${file}_test.tcl }
finish
