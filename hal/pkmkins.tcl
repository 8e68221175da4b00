# SPDX-License-Identifier: GPL-2.0-or-later
# Passes the machine described in the INI file to the kinematics module pkmkins.
#
# In the INI file, after the HALFILE that loads the kinematics and motmod:
#
#     [HAL]
#     HALFILE = LIB:pkmkins.tcl
#
# pkmkins-pins reads the file, checks it as `pkm check` does, and prints the value of every pin that the file decides.
# This file sets them, connects the module to the motion controller (tool offsets, and the feed that the module allows:
# motion.adaptive-feed, motion.feed-inhibit) and asks for the geometry to be frozen (.apply). Everything is checked
# before the first pin is set: an error ends LinuxCNC's start and leaves the module unchanged.
#
# pkmkins-pins prints these lines, or nothing if the file is wrong:
#
#     version NUMBER                    its version, which must equal the module's
#     compared SECTIONS KEYS ...        patterns of the keys that describe the machine
#     ini SECTION KEY=VALUE             the values of these keys, as haltcl reads them
#     pin NAME VALUE                    without "pkmkins."
#     end

namespace eval pkmkins {
    # Beside this file for tests before installation; never searched in PATH.
    variable program [file join [file dirname [info script]] pkmkins-pins]
    if {![file exists $program]} { set program /usr/bin/pkmkins-pins }
    # Seconds that pkmkins-pins may run. It usually takes some milliseconds.
    variable longest 10
}

# LinuxCNC ends its start if a HAL file exits with a code other than 0.
proc pkmkins::stop {text} {
    puts stderr "\npkmkins: LinuxCNC does not start, because the machine could not be set up:\n$text\n"
    exit 1
}

# Returns the output of pkmkins-pins for this INI file. If it refuses the file, it exits with code 1 and prints the
# messages of `pkm check`.
proc pkmkins::printed {ini} {
    variable program
    variable longest
    # No shell, and no file for errors, which a run in virtual time could not write.
    if {![catch { exec -- /usr/bin/timeout --verbose --kill-after=1 $longest $program $ini 2>@1 } text options]} { return $text }
    lassign [dict get $options -errorcode] kind id code
    set refusal [regsub {\n?child process exited abnormally$} $text ""]
    if {$kind eq "CHILDSTATUS" && $code == 1 && $refusal ne ""} { stop $refusal }
    stop "pkmkins: $program could not read $ini: [join [split $text \n] {; }]; reinstall pkmkins"
}

# Checks the whole output of pkmkins-pins, and returns its pins and values.
proc pkmkins::pins_of {ini text} {
    variable program
    set pins {}
    set read {}
    set lines [split $text \n]
    foreach line $lines {
        switch -regexp -matchvar found -- $line {
            {^version (\d+\.\d+\.\d+)$} { set version [lindex $found 1] }
            {^compared ([A-Z_* ]+)$} { set compared [lindex $found 1] }
            {^ini (\S+) ([^=]+)=(.*)$} { lappend read [lrange $found 1 end] }
            {^pin ([a-z0-9.-]+) ([0-9e.-]+)$} { lappend pins pkmkins.[lindex $found 1] [lindex $found 2] }
            {^end$} {}
            default { stop "pkmkins: unexpected output of $program, \"$line\"; reinstall pkmkins" }
        }
    }
    if {[lindex $lines end] ne "end" || ![info exists version] || ![info exists compared]} {
        stop "pkmkins: the output of $program for $ini is incomplete; reinstall pkmkins"
    }
    check_version $version
    check_unchanged $ini $compared $read
    check_exist $pins
    return $pins
}

# Rejects a module of another version than pkmkins-pins. The pin is major * 1000000 + minor * 1000 + patch.
proc pkmkins::check_version {own} {
    variable program
    if {![llength [hal list pin pkmkins.version]]} {
        stop "pkmkins: HAL has no pin pkmkins.version: load pkmkins in a HALFILE before LIB:pkmkins.tcl; if it is loaded, it is older than $program $own: reinstall pkmkins"
    }
    set number [string trim [hal getp pkmkins.version]]
    set module [expr {$number / 1000000}].[expr {$number / 1000 % 1000}].[expr {$number % 1000}]
    if {$module ne $own} {
        stop "pkmkins: $program has version $own, but the loaded module has version $module; reinstall pkmkins"
    }
}

# Rejects an INI file that has changed since haltcl read it.
proc pkmkins::check_unchanged {ini compared read} {
    set known {}
    foreach {sections keys} $compared {
        foreach section [info globals $sections] {
            if {![array exists ::$section]} { continue }
            foreach {key values} [array get ::$section $keys] {
                foreach value $values { lappend known [list $section $key $value] }
            }
        }
    }
    foreach {one other} [list $known $read $read $known] {
        foreach entry $one {
            if {$entry in $other} { continue }
            lassign $entry section key value
            stop "pkmkins: $ini changed while LinuxCNC was starting, at \[$section\]$key = $value; start LinuxCNC again"
        }
    }
}

# Rejects missing pins: a custom HAL file may have loaded the module with parameters other than those of the INI file.
proc pkmkins::check_exist {pins} {
    set existing [hal list pin pkmkins.*]
    foreach {pin text} $pins {
        if {$pin in $existing} { continue }
        stop "pkmkins: \[KINS\]KINEMATICS = \"[lindex $::KINS(KINEMATICS) 0]\": the module was loaded with other parameters and has no pin $pin; load it with these"
    }
}

# Returns the signal of a pin, or `signal` if it has none. HAL also shows pins with longer names, such as
# motion.jog-stop-immediate.
proc pkmkins::signal_of {pin signal} {
    foreach line [split [hal show pin $pin] \n] {
        if {[regexp {\s(\S+)\s+(?:=[=>]>?|<=[=>]?)\s+(\S+)\s*$} $line -> name own] && $name eq $pin} { return $own }
    }
    return $signal
}

# A signal has one writer: if another component inhibits feed, the custom HAL file must combine both,
# because without feed inhibition the module does not change a tool at a tilt.
proc pkmkins::check_feed_inhibit {} {
    set taken [signal_of motion.feed-inhibit ""]
    if {$taken ne "" && [signal_of pkmkins.feed-inhibit ""] eq ""} {
        stop "pkmkins: \[HAL\]HALFILE = LIB:pkmkins.tcl: motion.feed-inhibit already has signal $taken: in a HALFILE before this one, join its writer and pkmkins.feed-inhibit with an or2"
    }
}

# Connects `target` to the existing signal of `source`, or to a new one. Some machines do not have all pins.
proc pkmkins::connect {signal source target} {
    if {![llength [hal list pin $target]]} { return }
    hal net [signal_of $source $signal] $source $target
}

# The machine also runs without the guard's feed, so an existing adaptive feed of another component
# stays connected.
proc pkmkins::wire_guard {} {
    foreach name {requested-vel current-vel distance-to-go in-position} {
        connect pkmkins:$name motion.$name pkmkins.$name
    }
    set taken [signal_of motion.adaptive-feed ""]
    if {$taken eq ""} {
        hal net pkmkins:feed-scale pkmkins.feed-scale motion.adaptive-feed
    } elseif {$taken ne [signal_of pkmkins.feed-scale ""]} {
        puts stderr "pkmkins: motion.adaptive-feed already has signal $taken: pkmkins.feed-scale has no effect unless a mult2 multiplies both"
    }
    connect pkmkins:jogging motion.jog-is-active pkmkins.jogging
    set taken [signal_of motion.jog-stop ""]
    if {$taken eq ""} {
        hal net pkmkins:jog-stop pkmkins.jog-stop motion.jog-stop
    } elseif {$taken ne [signal_of pkmkins.jog-stop ""]} {
        puts stderr "pkmkins: motion.jog-stop already has signal $taken: pkmkins.jog-stop has no effect unless an or2 joins both"
    }
}

proc pkmkins::wire {} {
    connect pkmkins:machine-on motion.motion-enabled pkmkins.machine-on
    foreach {axis pin} {
        x tool-offset-x y tool-offset-y z tool-offset
        u second.tool-offset-x v second.tool-offset-y w second.tool-offset
    } {
        connect pkmkins:tool-offset-$axis motion.tooloffset.$axis pkmkins.$pin
    }
    if {[signal_of pkmkins.feed-inhibit ""] eq ""} {
        hal net pkmkins:feed-inhibit pkmkins.feed-inhibit motion.feed-inhibit
    }
    wire_guard
    hal addf pkmkins.monitor servo-thread
}

# Reports a missing panel of `pkm panel`, because AXIS then fails with a message that does not name the command.
proc pkmkins::report_panel {ini} {
    set stem [file rootname [file tail $ini]]
    foreach {key ending} {::DISPLAY(PYVCP) xml ::HAL(POSTGUI_HALFILE) tcl} {
        set name $stem-panel.$ending
        if {![info exists $key] || $name ni [set $key] || [file exists [file join [file dirname $ini] $name]]} { continue }
        puts stderr "pkmkins: there is no $name, and AXIS does not start without it: run pkm panel $ini to write it"
    }
}

proc pkmkins::main {ini} {
    report_panel $ini
    set pins [pins_of $ini [printed $ini]]
    check_feed_inhibit
    # `hal setp`: haltcl's own setp would evaluate the text.
    foreach {pin text} $pins { hal setp $pin $text }
    wire
    # The threads do not run yet: the module detects this edge in its first cycle.
    hal setp pkmkins.apply 1
}

if {![info exists ::env(INI_FILE_NAME)]} { pkmkins::stop "pkmkins: the variable INI_FILE_NAME is missing; LinuxCNC sets it, so run this file from LinuxCNC" }
pkmkins::main $::env(INI_FILE_NAME)
