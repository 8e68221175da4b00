#!/usr/bin/tclsh
# SPDX-License-Identifier: GPL-2.0-or-later
# The HAL files in hal/, without LinuxCNC: what each asks of HAL, for the INI files in cases, is what stands beside.
#
#     tests/hal/hal_test.tcl [--first] [FOLDER]     FOLDER: HAL files in place of hal/; --first: ends at the first failure
#
# A case is an INI file and a table: `load`, `start` and `run` (a function in a thread) in their order, then every
# value and every signal with its writer before the arrow. The tables were written from docs/guide/drives.md and from the manual
# pages of the components, not by the files that they check.

package require tcltest
set here [file dirname [file normalize [info script]]]
source $here/linuxcnc.tcl
set ends_at_first [expr {[lindex $argv 0] eq "--first"}]
if {$argc > $ends_at_first} { set model::hal [file normalize [lindex $argv end]] }
set folder [exec mktemp -d]

proc test args {
    uplevel 1 [list tcltest::test {*}$args]
    if {$::ends_at_first && $tcltest::numTests(Failed)} { finish }
}

proc finish {} {
    file delete -force $::folder
    puts "$tcltest::numTests(Passed) passed, $tcltest::numTests(Failed) failed"
    exit [expr {$tcltest::numTests(Failed) > 0}]
}

# The lines of a file.
proc content {file} {
    set channel [open $file]
    set text [read $channel]
    close $channel
    return $text
}

# A table as `asked` has it.
proc table {text} {
    set lines [lsearch -all -inline -regexp [split $text \n] {^[^#]}]
    set ordered [lsearch -all -inline -regexp $lines {^(load|start|run|ends|stops) }]
    return [concat $ordered [lsort [lsearch -all -inline $lines "set *"]] [lsort [lsearch -all -inline $lines "net *"]] \
        [lsearch -all -inline $lines "says *"]]
}

foreach case [lsort [glob $here/cases/*.ini]] {
    set name [file rootname [file tail $case]]
    test $name "asks for what $name.hal lists" {
        difference [asked [content $case]] [table [content [file rootname $case].hal]]
    } {}
}
foreach file [lsort [glob $here/*_test.tcl]] { if {[file tail $file] ne "hal_test.tcl"} { source $file } }
finish
