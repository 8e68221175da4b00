# SPDX-License-Identifier: GPL-2.0-or-later
# Runs the HAL files of a machine in LinuxCNC in virtual time:
#
#     tclsh start.tcl MACHINE.ini BESIDE MODULES FOLDER STRANGERS ENTRY...
#
# pkm writes `ini.tcl`, `wiring.tcl`, `hal_files.tcl` and this into one file. The files run as
# in `hal_files.tcl`, and each step is sent to LinuxCNC as in `wiring.tcl`. STRANGERS are components
# that other programs create: their pins do not exist here, and are omitted from every step. If a step fails,
# standard error gets a line of words separated by tabs: START, "mistake" if LinuxCNC refuses the step as well
# and "limit" if it is only unknown here, the file, the line, the number of the entry, the reason.

namespace eval drives {
    variable strangers {}
    # Loaded modules.
    variable loaded {}
}

proc drives::say args {}

proc drives::is_strange {pin} {
    variable strangers
    return [expr {[lindex [split $pin .] 0] in $strangers}]
}

# Sends LinuxCNC a step, by a command of wiring.tcl; a refusal is a mistake.
proc drives::ask {args} {
    if {[catch $args answer]} { mistake [regsub {^error: } $answer ""] }
    return $answer
}

rename drives::hal drives::listed

proc drives::hal {frames verb args} {
    variable loaded
    if {$verb in {show list}} { return [ask ::hal $verb {*}$args] }
    set answer [listed $frames $verb {*}$args]
    switch -- $verb {
        loadrt {
            set name [lindex $args 0]
            # LinuxCNC ignores a module that is already loaded.
            if {$name in $loaded} { return "" }
            lappend loaded $name
            ask ::hal loadrt {*}$args
        }
        net - linkps - linksp {
            if {$verb eq "linkps"} { set args [lreverse $args] }
            set pins [lsearch -all -inline -not -regexp [lrange $args 1 end] {^<?=>?>?$}]
            foreach pin $pins { if {![is_strange $pin]} { ask ::hal net [lindex $args 0] $pin } }
        }
        setp { if {![is_strange [lindex $args 0]]} { ask ::hal setp {*}$args } }
        addf { ask ::hal addf [lindex $args 0] }
        unlinkp { if {![is_strange [lindex $args 0]]} { ask wiring::ask unlinkp {*}$args } }
        getp { if {![is_strange [lindex $args 0]]} { return [ask ::hal getp [lindex $args 0]] } }
        newsig - sets { ask wiring::ask $verb {*}$args }
    }
    return $answer
}

# Starts pkmkins-pins for pkmkins.tcl, and no other program.
proc drives::exec {args} {
    if {[file tail [lindex $args end-2]] ne "pkmkins-pins"} { error "exec: no program is started in virtual time" }
    return [::exec {*}$args]
}

rename drives::make_box drives::make_plain_box
proc drives::make_box {} {
    variable box
    make_plain_box
    interp alias $box exec {} drives::exec
}

proc drives::failed {number message options} {
    variable printed
    set kind [expr {$message eq "exit" || [is_mistake $message $options] ? "mistake" : "limit"}]
    if {$message eq "exit"} { set message [join $printed "; "] }
    set words [list START $kind {*}[where $options] $number $message]
    puts stderr [join [lmap word $words { string map {"\t" " " "\n" "; "} $word }] \t]
}

proc drives::start {ini beside modules folder strange args} {
    variable runs_own 1
    variable strangers $strange
    set wiring::modules [list $beside $modules]
    if {[main $ini $folder [list $beside $::env(HALLIB_DIR)] {*}$args]} { wiring::ask done }
}

drives::start {*}$argv
