# SPDX-License-Identifier: GPL-2.0-or-later
# A model of the parts of LinuxCNC's HAL that hal/*.tcl use, with a clock that only waits advance. Needs no LinuxCNC.
#
# `asked` runs the HAL files of an INI file in the interpreter of `pkm check` and returns their requests. As in HAL, a
# step fails if a pin does not exist, has another type or direction, or has a writer already. `components.txt` lists the
# pins.

set root [file normalize [file join [file dirname [info script]] ../..]]
source $root/workbench/machine/src/read/ini.tcl
source $root/workbench/check/src/hal_files.tcl

namespace eval model {
    # Lines of components.txt: component, kind, type or {}, names.
    variable rows {}
    variable state {pins {} patterns {} functions {} threads {} loaded {} signals {} values {} now 0 events {} asked {} on_setp list
                    components {} on_exec error}
    # Folder of the HAL files.
    variable hal $::root/hal
}

proc model::read_rows {file} {
    variable rows
    set channel [open $file]
    foreach line [split [read $channel] \n] {
        if {![regexp {^[^#]} $line]} { continue }
        set names [lassign $line component what]
        set type ""
        if {$what in {in out io parameter}} { set names [lassign $names type] }
        lappend rows [list $component $what $type $names]
    }
    close $channel
}
model::read_rows [file join [file dirname [info script]] components.txt]

# Resets HAL to its state before the first HAL file.
proc model::reset {} {
    variable state
    foreach {name value} $state { variable $name $value }
    foreach {name value} {signals {} values {} printed {} place {}} { set ::drives::$name $value }
    array unset ::ini
    add_component iocontrol {}
}

# Creates a pin or a parameter, `way` in, out, io or parameter; its name may be a pattern.
proc model::exists {name way type {value ""}} {
    variable pins
    variable patterns
    variable values
    if {[regexp {[*?\[]} $name]} { lappend patterns $name [list $way $type] } else { dict set pins $name [list $way $type] }
    if {$value ne ""} { dict set values $name $value }
}

# Creates pins, parameters and functions of a component from its load parameters.
proc model::add_component {component words} {
    variable rows
    variable functions
    variable components
    set names {}
    set count 1
    set arguments {}
    foreach word $words {
        if {[regexp {^(\w+)=(.*)$} $word -> key value]} { lappend arguments $key }
        switch -regexp -matchvar found -- $word {
            {^names=(.*)$} { set names [split [lindex $found 1] ,]; set count [llength $names] }
            {^step_type=(.*)$} { set count [llength [split [lindex $found 1] ,]] }
            {^(count|num_joints)=([0-9]+)$} { set count [lindex $found 2] }
        }
    }
    set kind [regsub {^hm2_.*} $component hm2]
    set found [lsearch -all -inline -exact -index 0 $rows $kind]
    if {![llength $found]} { drives::mistake "there is no component $component" }
    foreach row $found {
        lassign $row - what type list
        set all {}
        foreach name $list {
            if {[string match *%* $name]} {
                lappend all {*}[lmap own $names { string map [list % $own] $name }]
            } elseif {[string match *#* $name]} {
                for {set n 0} {$n < $count} {incr n} { lappend all [string map [list # $n] $name] }
            } else { lappend all $name }
        }
        switch $what {
            argument {
                foreach key $arguments {
                    if {$key ni $list} { drives::mistake "$component has no load parameter $key" }
                }
            }
            function { lappend functions {*}$all }
            default { foreach name $all { exists $name $what $type } }
        }
    }
    dict set components $component ready
}

proc model::known {name} {
    variable pins
    variable patterns
    if {[dict exists $pins $name]} { return [dict get $pins $name] }
    foreach {pattern kind} $patterns {
        if {[string match $pattern $name] && ![regexp {\s} $name]} { return $kind }
    }
    drives::mistake "pin or parameter $name does not exist"
}

proc model::ask {args} {
    variable asked
    lappend asked $args
}

proc model::loadrt {name args} {
    variable loaded
    variable threads
    if {$name in $loaded} { drives::mistake "$name is loaded already" }
    lappend loaded $name
    add_component $name $args
    if {$name eq "motmod"} {
        lappend threads servo-thread
        if {[string match *base_period_nsec=* $args]} { lappend threads base-thread }
    }
    ask load $name {*}$args
}

# Starts a component, which is ready at once.
proc model::loadusr {args} {
    set name [lindex $args end]
    for {set k 0} {$k < [llength $args]} {incr k} {
        set word [lindex $args $k]
        if {[string match -W*n $word]} { set name [lindex $args [incr k]]; break }
        if {![string match -* $word]} { set name $word; break }
    }
    add_component $name {}
    ask start {*}$args
}

proc model::addf {function thread args} {
    variable functions
    variable threads
    if {[lsearch -exact [lmap pattern $functions { string match $pattern $function }] 1] < 0} { drives::mistake "function $function does not exist" }
    if {$thread ni $threads} { drives::mistake "thread $thread does not exist" }
    ask run $thread $function {*}$args
}

# Connects pins to a signal as halcmd does: it checks all of them before it connects one.
proc model::net {signal args} {
    variable signals
    set before $signals
    try { put $signal $args } on error {text options} { set signals $before; return -options $options $text }
}

proc model::put {signal pins} {
    variable signals
    foreach pin $pins {
        if {[regexp {^<?=>?>?$} $pin]} { continue }
        lassign [known $pin] way type
        if {$way eq "parameter"} { drives::mistake "$pin is a parameter" }
        if {[dict exists $signals $pin]} {
            if {[dict get $signals $pin] eq $signal} { continue }
            drives::mistake "$pin is on signal [dict get $signals $pin] already, and cannot be on $signal"
        }
        dict for {other own} $signals {
            if {$own ne $signal} { continue }
            lassign [known $other] other_way other_type
            if {$other_type ne $type} { drives::mistake "$pin is of type $type, and $signal of $other_type" }
            if {$way ne "in" && $other_way ne "in" && "out" in [list $way $other_way]} {
                drives::mistake "$signal has the writer $other already, and cannot have $pin"
            }
        }
        dict set signals $pin $signal
    }
}

proc model::setp {pin value} {
    variable signals
    variable values
    variable on_setp
    lassign [known $pin] way type
    if {$way eq "out"} { drives::mistake "$pin is an output" }
    if {[dict exists $signals $pin]} { drives::mistake "$pin is on signal [dict get $signals $pin]" }
    set form [dict get {
        float {^([+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|nan)$} bit {^([01]|TRUE|FALSE)$} s32 {^-?\d+$} u32 {^\d+$}
    } $type]
    if {![regexp $form $value]} { drives::mistake "$pin cannot be $value, for it is of type $type" }
    dict set values $pin $value
    ask set $pin $value
    {*}$on_setp $pin $value
}

proc model::getp {pin} {
    variable values
    known $pin
    return [expr {[dict exists $values $pin] ? [dict get $values $pin] : 0}]
}

# Returns the names that begin with a text or match a pattern, as halcmd does.
proc model::matching {pattern} {
    variable pins
    variable signals
    set names {}
    foreach name [lsort -unique [concat [dict keys $pins] [dict keys $signals]]] {
        if {[string first $pattern $name] == 0 || [string match $pattern $name]} { lappend names $name }
    }
    return $names
}

proc model::show {what pattern} {
    variable signals
    variable components
    if {$what eq "comp"} {
        set lines [list "Loaded HAL Components:" "ID      Type  Name                    PID   State"]
        dict for {name how} $components {
            if {[string first $pattern $name] == 0} { lappend lines "     7  User  $name                    123   $how" }
        }
        return [join $lines \n]\n
    }
    set lines [list "Component Pins:" "Owner   Type  Dir         Value  Name"]
    foreach pin [matching $pattern] {
        lassign [known $pin] way type
        set signal ""
        if {[dict exists $signals $pin]} {
            set signal " [dict get {in <== out ==> io <=>} $way] [dict get $signals $pin]"
        }
        lappend lines "    12  $type  [string toupper $way]            [getp $pin]  $pin$signal"
    }
    return [join $lines \n]\n
}

rename drives::hal drives::listed
proc drives::hal {frames verb args} {
    listed $frames $verb {*}$args
    switch -- $verb {
        loadrt - loadusr - addf - net - setp { model::$verb {*}$args }
        show { return [model::show {*}$args] }
        list { return [model::matching [lindex $args 1]] }
        getp { return [model::getp {*}$args] }
        default { mistake "hal $verb: no HAL file of pkmkins does this" }
    }
    return ""
}

# Drops the recorder's steps, which the model records itself; keeps how a file ends.
proc drives::say {args} {
    set text [lassign $args file line what]
    if {$what in {refused failed} && $text ne "exit"} { model::ask stops {*}$text }
    if {$what eq "ends"} { model::ask ends }
}

# The simulated spindle comes from LinuxCNC.
rename drives::source_file drives::source_own
proc drives::source_file {name} {
    variable box
    if {[file tail $name] eq "sim_lib.tcl"} {
        $box eval { proc sim_spindle {} { hal net sim:spindle spindle.0.speed-out } }
    } else { source_own $name }
}

proc drives::print {args} {
    variable printed
    lappend printed [string trim [lindex $args end]]
}

# Runs a script after the given milliseconds.
proc model::later {ms script} {
    variable events
    lappend events [list $ms $script]
}

proc model::pass {ms} {
    variable now
    variable events
    incr now $ms
    foreach event $events {
        lassign $event at script
        if {$at > $now} { continue }
        set events [lsearch -all -inline -not -exact $events $event]
        namespace eval ::model $script
    }
}

proc model::clock_of {what} { variable now; return $now }
proc model::exec_of {args} { variable on_exec; return [{*}$on_exec {*}$args] }

rename drives::make_box drives::make_plain_box
proc drives::make_box {} {
    variable box
    make_plain_box
    interp alias $box clock {} model::clock_of
    interp alias $box after {} model::pass
    interp alias $box exec {} model::exec_of
    namespace eval ::model $::model::prelude
}

# Returns loads, programs, functions and the end in the order of the files; then values and signals, sorted; then the
# printed text.
proc model::lines {} {
    variable asked
    variable signals
    set by_signal {}
    dict for {pin signal} $signals { dict lappend by_signal $signal $pin }
    set nets {}
    dict for {signal pins} $by_signal {
        set writers [lsort [lmap pin $pins { if {[lindex [known $pin] 0] eq "in"} continue; set pin }]]
        set others [lsort [lmap pin $pins { if {$pin in $writers} continue; set pin }]]
        lappend nets [join [concat net $signal $writers => $others]]
    }
    set sets [lsearch -all -inline $asked "set *"]
    return [concat [lsearch -all -inline -not $asked "set *"] [lsort $sets] [lsort $nets] \
        [lmap text $drives::printed { string cat "says " $text }]]
}

# Returns the requests of the HAL files that an INI file (its text) names; the prelude may add to HAL first.
proc asked {text {prelude ""}} {
    set model::prelude $prelude
    model::reset
    set ini [file join $::folder machine.ini]
    set channel [open $ini w]
    puts $channel $text
    close $channel
    set drives::runs_own 1
    set files [lmap {- name} [regexp -all -inline -line {^HALFILE = (.*)$} $text] { string cat "file " $name }]
    drives::main $ini $::here/cases [list $model::hal] {*}$files
    interp delete $drives::box
    return [model::lines]
}

# Returns the lines of each list that the other lacks; {} if both are equal.
proc difference {found expected} {
    set lines {}
    foreach {one other sign} [list $expected $found - $found $expected +] {
        foreach line $one {
            if {$line ni $other} { lappend lines "$sign $line" }
        }
    }
    if {![llength $lines] && $found ne $expected} { set lines "+ in another order: $found" }
    return [join $lines \n]
}
