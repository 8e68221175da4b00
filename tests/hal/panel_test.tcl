# SPDX-License-Identifier: GPL-2.0-or-later
# pkmkins_panel.tcl, as used by a panel's HAL file: connections, waits and messages.

# Requests of a complete panel.
set shown {
    {net panel:joint-0 joint.0.pos-fb => pyvcp.joint-0}
    {net panel:margin-0 pkmkins.margin.0 => pyvcp.margin-0}
    {net panel:x-minus pkmkins-panel.x-minus => pyvcp.x-minus}
    {net panel:travel-known pkmkins-panel.known => pyvcp.travel-known}
}
set switched {
    {net panel:kinematics pkmkins-panel.kinematics => motion.switchkins-type}
    {net panel:ask-machine pyvcp.kinematics.machine => pkmkins-panel.ask-machine}
    {net panel:ask-joints pyvcp.kinematics.joints => pkmkins-panel.ask-joints}
}

namespace eval model {
    proc pyvcp {} {
        variable components
        dict set components pyvcp ready
        exists pyvcp.joint-0 in float
        exists pyvcp.margin-0 in float
        foreach way {x-minus x-plus c-minus c-plus} { exists pyvcp.$way in float }
        exists pyvcp.travel-known in bit
        foreach choice {machine joints} { exists pyvcp.kinematics.$choice out bit }
    }
    # The component for travel, with its pins.
    proc travel {} {
        variable components
        dict set components pkmkins-panel ready
        exists pkmkins-panel.x-minus out float
        exists pkmkins-panel.known out bit
        exists pkmkins-panel.kinematics out float
        foreach choice {machine joints} { exists pkmkins-panel.ask-$choice in bit }
    }
    # A process: its command, whether it exists, and the text of /proc.
    variable process ""
    proc executed {args} {
        variable process
        ask exec {*}$args
        if {[lindex $args 0] eq "kill"} { set process ""; return "" }
        set process "4711 (a) Z (b) S 1 4711"
        return 4711
    }
    proc open_of {name} {
        variable process
        if {$name ne "/proc/4711/stat" || $process eq ""} { error "couldn't open $name" }
        return file
    }
    proc read_of {name} { variable process; return $process }
}

# Returns the requests of a panel's HAL file; `more` is added to the prelude, `text` to the INI file.
proc panel {{more ""} {text ""} {file panel.tcl}} {
    return [asked "\[HAL\]\nHALFILE = $file\n$text" [format {
        exists pkmkins.jog-scale out float
        exists joint.0.pos-fb out float
        exists pkmkins.margin.0 out float
        exists motion.switchkins-type in float
        variable on_exec model::executed
        variable process ""
        foreach {name target} {open model::open_of read model::read_of close list} { interp alias $::drives::box $name {} {*}$target }
        pyvcp
        later 100 travel
        %s
    } $more]]
}

set run "exec pkmkins-panel machine.ini x c &"
proc says {text} { return [list "says pkmkins: panel: $text"] }
set nans {{set pyvcp.c-minus nan} {set pyvcp.c-plus nan} {set pyvcp.x-minus nan} {set pyvcp.x-plus nan}}
set no_pyvcp "not shown: this user interface has not loaded \[DISPLAY\]PYVCP, as AXIS does; the machine runs without it"
# Messages if pkmkins-panel does not start, and if the selector has a signal.
proc not_started {reason} {
    return [concat [says "pkmkins-panel does not start, so the travel left is not shown: $reason"] \
        [says "not shown: missing pin pkmkins-panel.x-minus, pkmkins-panel.known"]]
}
proc taken {signal} {
    return [says "motion.switchkins-type already has signal $signal, so the kinematics buttons have no effect"]
}
set again "run pkm panel machine.ini to write the panel again"
set app "\[APPLICATIONS\]\nAPP = pyvcp -c pyvcp panel.xml"

# Name, part of the prelude, part of the INI file, requests, messages, duration in ms.
foreach {name more text lines says least most} [list \
    whole {} "" [concat [list $run] $shown $switched] {} 100 110 \
    running {travel} "" [concat $shown $switched] {} 0 0 \
    slow {variable events {}; later 9900 travel} "" [concat [list $run] $shown $switched] {} 9900 9910 \
    no-panel {dict unset components pyvcp} "" {} [says $no_pyvcp] 0 0 \
    not-ready {dict set components pyvcp initializing} "" {} [says $no_pyvcp] 0 0 \
    like-named {dict unset components pyvcp; dict set components pyvcp2 ready} "" {} [says $no_pyvcp] 0 0 \
    own-window {dict unset components pyvcp; variable events {}; later 9000 pyvcp; later 9100 travel} $app [concat [list $run] $shown $switched] {} 9100 9110 \
    no-window {dict unset components pyvcp} $app {} [says $no_pyvcp] 10000 10020 \
    another-app {dict unset components pyvcp} "\[APPLICATIONS\]\nAPP = mypyvcp" {} [says $no_pyvcp] 0 0 \
    no-program {variable on_exec {apply {args {error "couldn't execute"}}}} "" \
        [concat $nans [lrange $shown 0 1]] [not_started "couldn't execute"] 0 0 \
    ends {variable events {}; later 500 {variable process ""}} "" \
        [concat [list $run] $nans [lrange $shown 0 1]] [not_started "it has exited"] 500 510 \
    dead {variable events {}; later 500 {variable process "4711 (a) S (b) Z 1"}} "" \
        [concat [list $run] $nans [lrange $shown 0 1]] [not_started "it has exited"] 500 510 \
    dies {later 90 {variable process ""; dict set components pkmkins-panel ready}; variable events [lrange $events 1 end]} "" \
        [concat [list $run] $nans [lrange $shown 0 1]] [not_started "it has exited"] 90 100 \
    hangs {variable events {}} "" \
        [concat [list $run "exec kill -KILL 4711"] $nans [lrange $shown 0 1]] [not_started "it was not ready within 10 s"] 10000 10020 \
    on-signal {exists mine in float; net mine joint.0.pos-fb mine} "" \
        [concat [list $run] {{net mine joint.0.pos-fb => mine pyvcp.joint-0}} [lrange $shown 1 end] $switched] {} 100 110 \
    longer-name {exists mine in float; exists joint.0.pos-fb-more out float; net mine joint.0.pos-fb-more mine} "" \
        [concat [list $run] {{net mine joint.0.pos-fb-more => mine}} $shown $switched] {} 100 110 \
    pin-missing {dict unset pins joint.0.pos-fb} "" \
        [concat [list $run] [lrange $shown 1 end] $switched] [says "not shown: missing pin joint.0.pos-fb; $again"] 100 110 \
    widget-missing {dict unset pins pyvcp.joint-0; dict unset pins pkmkins.margin.0} "" \
        [concat [list $run] [lrange $shown 2 end] $switched] \
        [says "not shown: joint.0.pos-fb: pin or parameter pyvcp.joint-0 does not exist; missing pin pkmkins.margin.0; $again"] 100 110 \
    selector-taken {exists mine out float; net mine mine motion.switchkins-type} "" \
        [concat [list $run] $shown {{net mine mine => motion.switchkins-type}}] \
        [taken mine] 100 110 \
    no-selector {dict unset pins motion.switchkins-type} "" [concat [list $run] $shown] {} 100 110 \
    no-button-machine {dict unset pins pyvcp.kinematics.machine} "" [concat [list $run] $shown] {} 100 110 \
    no-button-joints {dict unset pins pyvcp.kinematics.joints} "" [concat [list $run] $shown] {} 100 110 \
    no-ask-machine {later 101 {dict unset pins pkmkins-panel.ask-machine}; later 100 {pass 1}} "" [concat [list $run] $shown] {} 101 111 \
    no-ask-joints {later 101 {dict unset pins pkmkins-panel.ask-joints}; later 100 {pass 1}} "" [concat [list $run] $shown] {} 101 111 \
    no-kinematics {later 101 {dict unset pins pkmkins-panel.kinematics}; later 100 {pass 1}} "" [concat [list $run] $shown] {} 101 111 \
    broken {interp alias $::drives::box hal {} apply {args {error "HAL has gone"}}} "" {} \
        [concat [list [reported "HAL has gone"]] {*}[lrepeat 3 [says "not everything is shown: HAL has gone"]]] 0 0 \
] {
    test panel-$name "what is there is shown, and what is missing is named" {
        set difference [difference [lsort [panel $more $text]] [lsort [concat $lines $says]]]
        if {$model::now < $least || $model::now > $most} { append difference "took $model::now ms" }
        set difference
    } {}
}

test panel-twice "a file that is carried out again changes nothing and says it once" {
    set twice [panel {} "" "panel.tcl\nHALFILE = panel.tcl"]
    list [difference [lsort $twice] [lsort [concat [list $run] $shown $switched \
        [taken panel:kinematics]]]]
} {{}}

test panel-closed "a closed standard error ends nothing" {
    panel {dict unset components pyvcp; interp alias $::drives::box puts {} error}
} {}

test panel-alone "without the file for jogs the panel names what is missing, and ends nothing" {
    set own [file join $folder alone]
    file mkdir $own
    file copy -force $model::hal/pkmkins_panel.tcl $own
    set before $model::hal
    set model::hal $own
    set lines [panel]
    set model::hal $before
    string map [list $own HALLIB] $lines
} [list $run {*}[says {not connected: couldn't read file "HALLIB/pkmkins_jog.tcl": no such file or directory}] \
    {*}[says {not everything is shown: invalid command name "wait"}] \
    {*}[lrepeat 2 {*}[says {not everything is shown: invalid command name "exists"}]]]
