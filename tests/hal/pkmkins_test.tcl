# SPDX-License-Identifier: GPL-2.0-or-later
# pkmkins.tcl with a stand-in for pkmkins-pins: it sets every printed pin and makes every connection. An incomplete text,
# one of another module or of another INI file leaves HAL unchanged.

# Type and direction of the module's pins from docs/reference/names.txt; N stands for a number, a letter for any letter.
set promised {}
foreach {- name type way} [regexp -all -inline -line {^\S+ pin (\S+) (\S+) (\S+)$} [content $root/docs/reference/names.txt]] {
    dict set promised [join [lmap word [split $name .] { expr {$word eq "N" ? {[0-9]} : [string length $word] == 1 ? "?" : $word} }] .] \
        [list [string map {i/o io} $way] $type]
}

namespace eval model {
    # Creates pins of the module.
    proc module {names} {
        foreach name $names {
            if {![dict exists $::promised pkmkins.$name]} {
                dict for {pattern own} $::promised {
                    if {[string match $pattern pkmkins.$name]} { dict set ::promised pkmkins.$name $own; break }
                }
            }
            # Fails if names.txt has no such pin.
            exists pkmkins.$name {*}[dict get $::promised pkmkins.$name]
        }
    }
}

set wired {
    machine-on feed-inhibit feed-scale jog-stop jogging requested-vel current-vel distance-to-go
    tool-offset tool-offset-x tool-offset-y apply version
}
set wired_second {in-position second.tool-offset second.tool-offset-x second.tool-offset-y}

set machine {[HAL]
HALFILE = board.tcl
HALFILE = LIB:pkmkins.tcl
[KINS]
JOINTS = 3
KINEMATICS = pkmkins legs=strut:3 coordinates=XYZ
[TRAJ]
COORDINATES = XYZ
HOME = 0 0 100
[PKM]
CENTRE = 1 2 3
[JOINT_0]
MIN_LIMIT = -1.5
[JOINT_1]
MIN_LIMIT = 2
[LEG_0]
BASE = 1 2 3
BASE = 4 5 6
[EMCMOT]
SERVO_PERIOD = 1000000
}
# The output of pkmkins-pins for it: the values of the INI file in any order, and all values of a repeated key.
set printed {version 1.2.3
compared KINS * TRAJ * PKM * JOINT_* * DISPLAY MAX_FEED_OVERRIDE LEG_* BASE
ini TRAJ HOME=0 0 100
ini KINS JOINTS=3
ini KINS KINEMATICS=pkmkins legs=strut:3 coordinates=XYZ
ini TRAJ COORDINATES=XYZ
ini PKM CENTRE=1 2 3
ini JOINT_0 MIN_LIMIT=-1.5
ini JOINT_1 MIN_LIMIT=2
ini LEG_0 BASE=1 2 3
ini LEG_0 BASE=4 5 6
pin centre.x 1
pin box.0.geometry 4123456789
pin base.0.x -1.25e-7
pin base.2.z 1e99
pin max-override 1.2
pin linear-acceleration 500
pin angular-acceleration 30
pin min-limit.1 -0.5
pin axis.2.x 0
end}
set pins_printed {centre.x box.0.geometry base.0.x base.2.z max-override linear-acceleration angular-acceleration min-limit.1 axis.2.x}

set program_call {-- /usr/bin/timeout --verbose --kill-after=1 10 /usr/bin/pkmkins-pins FILE 2>@1}

# Stands in for pkmkins-pins.
proc model::program {args} {
    variable text
    variable how
    if {$args ne [string map [list FILE $::folder/machine.ini] $::program_call]} { error "exec $args" }
    if {$how eq ""} { return $text }
    return -code error -errorcode $how $text
}

# Runs pkmkins.tcl with a pkmkins-pins that prints a text, or ends as in `how`, and a module with the given pins; `more` is
# added to the prelude.
proc set_up {text {more ""} {pins ""} {how ""}} {
    set ::model::text $text
    set ::model::how $how
    if {$pins eq ""} { set pins [concat $::wired $::pins_printed] }
    set prelude [format {
        variable on_exec model::program
        module {%s}
        exists pkmkins.version out u32 1002003
        %s
    } $pins $more]
    return [asked $::machine $prelude]
}

set plain {
    {load motmod num_joints=3} {load pkmkins}
    {set pkmkins.centre.x 1} {set pkmkins.box.0.geometry 4123456789} {set pkmkins.base.0.x -1.25e-7} {set pkmkins.base.2.z 1e99}
    {set pkmkins.max-override 1.2} {set pkmkins.linear-acceleration 500} {set pkmkins.angular-acceleration 30}
    {set pkmkins.min-limit.1 -0.5} {set pkmkins.axis.2.x 0} {set pkmkins.apply 1}
    {run servo-thread pkmkins.monitor}
    {net pkmkins:machine-on motion.motion-enabled => pkmkins.machine-on}
    {net pkmkins:tool-offset-x motion.tooloffset.x => pkmkins.tool-offset-x}
    {net pkmkins:tool-offset-y motion.tooloffset.y => pkmkins.tool-offset-y}
    {net pkmkins:tool-offset-z motion.tooloffset.z => pkmkins.tool-offset}
    {net pkmkins:feed-inhibit pkmkins.feed-inhibit => motion.feed-inhibit}
    {net pkmkins:feed-scale pkmkins.feed-scale => motion.adaptive-feed}
    {net pkmkins:requested-vel motion.requested-vel => pkmkins.requested-vel}
    {net pkmkins:current-vel motion.current-vel => pkmkins.current-vel}
    {net pkmkins:distance-to-go motion.distance-to-go => pkmkins.distance-to-go}
    {net pkmkins:jogging motion.jog-is-active => pkmkins.jogging}
    {net pkmkins:jog-stop pkmkins.jog-stop => motion.jog-stop}
}
# Connections of a second mechanism.
set of_second {
    {net pkmkins:in-position motion.in-position => pkmkins.in-position}
    {net pkmkins:tool-offset-u motion.tooloffset.u => pkmkins.second.tool-offset-x}
    {net pkmkins:tool-offset-v motion.tooloffset.v => pkmkins.second.tool-offset-y}
    {net pkmkins:tool-offset-w motion.tooloffset.w => pkmkins.second.tool-offset}
}

test wired-plain "every pin has its value and every connection is made" {
    difference [set_up $printed] [table [join $plain \n]]
} {}

test wired-second "a second mechanism has its own tool offset, on U, V and W" {
    difference [set_up $printed "" [concat $wired $wired_second $pins_printed]] [table [join [concat $plain $of_second] \n]]
} {}

test wired-order "the geometry is asked for last" {
    set_up $printed
    lindex $model::asked end
} {set pkmkins.apply 1}

# Returns the plain result without some lines and with others.
proc but_for {patterns others} {
    set lines $::plain
    foreach pattern $patterns { set lines [lsearch -all -inline -not $lines $pattern] }
    return [table [join [concat $lines $others] \n]]
}

# Signals of earlier HAL files: name, commands of that file, missing lines, added lines.
foreach {name before without with} {
    machine-on-signal {net drives:machine-on motion.motion-enabled}
    {{net pkmkins:machine-on *}} {{net drives:machine-on motion.motion-enabled => pkmkins.machine-on}}

    tool-on-signal {net tool motion.tooloffset.z}
    {{net pkmkins:tool-offset-z *}} {{net tool motion.tooloffset.z => pkmkins.tool-offset}}

    adaptive-feed-taken {exists mine.out out float; net mine mine.out motion.adaptive-feed}
    {{net pkmkins:feed-scale *}} {
        {net mine mine.out => motion.adaptive-feed}
        {says pkmkins: motion.adaptive-feed already has signal mine: pkmkins.feed-scale has no effect unless a mult2 multiplies both}
    }

    adaptive-feed-joined {net both pkmkins.feed-scale motion.adaptive-feed}
    {{net pkmkins:feed-scale *}} {{net both pkmkins.feed-scale => motion.adaptive-feed}}

    jog-stop-taken {exists mine.out out bit; net mine mine.out motion.jog-stop}
    {{net pkmkins:jog-stop *}} {
        {net mine mine.out => motion.jog-stop}
        {says pkmkins: motion.jog-stop already has signal mine: pkmkins.jog-stop has no effect unless an or2 joins both}
    }

    jog-stop-joined {net both pkmkins.jog-stop motion.jog-stop}
    {{net pkmkins:jog-stop *}} {{net both pkmkins.jog-stop => motion.jog-stop}}

    another-jog-stop {exists mine.out out bit; net mine mine.out motion.jog-stop-immediate}
    {} {{net mine mine.out => motion.jog-stop-immediate}}

    both-jog-stops {exists mine.out out bit; net mine mine.out motion.jog-stop-immediate motion.jog-stop}
    {{net pkmkins:jog-stop *}} {
        {net mine mine.out => motion.jog-stop motion.jog-stop-immediate}
        {says pkmkins: motion.jog-stop already has signal mine: pkmkins.jog-stop has no effect unless an or2 joins both}
    }

    feed-inhibit-joined {exists or.in in bit; exists or.out out bit; net inhibit or.out motion.feed-inhibit; net own pkmkins.feed-inhibit or.in}
    {{net pkmkins:feed-inhibit *}} {{net inhibit or.out => motion.feed-inhibit} {net own pkmkins.feed-inhibit => or.in}}
} {
    test signal-$name "what is on a signal stays there" {
        set model::before $before
        difference [set_up $printed {later 1 $before}] [but_for $without $with]
    } {}
}

set without_panel $machine
set machine "\[DISPLAY\]\nPYVCP = machine-panel.xml\n$machine"
test panel-missing "a missing panel is reported with the command that writes it" {
    difference [set_up $printed] [but_for {} [list \
        "says pkmkins: there is no machine-panel.xml, and AXIS does not start without it: run pkm panel $folder/machine.ini to write it"]]
} {}
set machine $without_panel

# The beginning of every message that ends LinuxCNC's start.
set heading "says pkmkins: LinuxCNC does not start, because the machine could not be set up:\n"

test signal-feed-inhibit-taken "nothing is set where the module could not inhibit feed" {
    set model::before {exists mine.out out bit; net mine mine.out motion.feed-inhibit}
    set_up $printed {later 1 $before}
} [list "load motmod num_joints=3" "load pkmkins" ends "net mine mine.out => motion.feed-inhibit" \
    "${heading}pkmkins: \[HAL\]HALFILE = LIB:pkmkins.tcl: motion.feed-inhibit already has signal mine: in a HALFILE before this one, join its writer and pkmkins.feed-inhibit with an or2"]

# Failures of pkmkins-pins and wrong output: name, change of its text, its end, and message. No pin is set.
proc refused {lines} {
    if {[lsearch -regexp $lines {^(set|net|run) }] >= 0} { error "HAL has changed: $lines" }
    if {"ends" ni $lines} { error "it is not refused: $lines" }
    set said [lsearch -all -inline $lines "says *"]
    if {[llength $said] != 1 || [string first $::heading [lindex $said 0]] != 0} { error "said: $said" }
    return [string range [lindex $said 0] [string length $::heading] end]
}
set again "; reinstall pkmkins"
set restart "; start LinuxCNC again"
set program /usr/bin/pkmkins-pins
set whole "pkmkins: the output of $program for FILE is incomplete$again"
set changed "pkmkins: FILE changed while LinuxCNC was starting, at"
set version "pkmkins: $program has version 1.2.3, but the loaded module has version"
foreach {name change how said} [list \
    refusal {return "\[LEG_0\]BASE is wrong\nin two lines"} {CHILDSTATUS 7 1} "\[LEG_0\]BASE is wrong\nin two lines" \
    refusal-end {return "wrong\nchild process exited abnormally"} {CHILDSTATUS 7 1} "wrong" \
    no-word {return "child process exited abnormally"} {CHILDSTATUS 7 1} "pkmkins: $program could not read FILE: child process exited abnormally$again" \
    other-code {return "panicked\nhere"} {CHILDSTATUS 7 101} "pkmkins: $program could not read FILE: panicked; here$again" \
    killed {return "killed"} {CHILDKILLED 7 SIGKILL 1} "pkmkins: $program could not read FILE: killed$again" \
    missing {return "couldn't execute"} {POSIX ENOENT {no such file}} "pkmkins: $program could not read FILE: couldn't execute$again" \
    empty {return ""} "" $whole \
    no-end {regsub {\nend$} $text ""} "" $whole \
    no-version {regsub {version 1.2.3\n} $text ""} "" $whole \
    no-compared {regsub -line {^compared.*\n} $text ""} "" $whole \
    behind-end {return $text\nmore} "" "pkmkins: unexpected output of $program, \"more\"$again" \
    pin-behind-end {return "$text\npin centre.y 2"} "" $whole \
    bad-line {regsub {pin centre.x 1} $text {pin centre.x [exit 0]}} "" "pkmkins: unexpected output of $program, \"pin centre.x \[exit 0\]\"$again" \
    bad-name {regsub {pin centre.x 1} $text {pin Centre.x 1}} "" "pkmkins: unexpected output of $program, \"pin Centre.x 1\"$again" \
    bad-version {regsub {version 1.2.3} $text {version 1.2}} "" "pkmkins: unexpected output of $program, \"version 1.2\"$again" \
    bad-compared {regsub {compared KINS} $text {compared kins}} "" "pkmkins: unexpected output of $program, \"compared kins * TRAJ * PKM * JOINT_* * DISPLAY MAX_FEED_OVERRIDE LEG_* BASE\"$again" \
    other-value {regsub {MIN_LIMIT=2} $text {MIN_LIMIT=3}} "" "$changed \[JOINT_1\]MIN_LIMIT = 2$restart" \
    key-more {regsub {ini PKM CENTRE=1 2 3} $text "ini PKM CENTRE=1 2 3\nini PKM MAX_ERROR=1"} "" "$changed \[PKM\]MAX_ERROR = 1$restart" \
    key-less {regsub {ini PKM CENTRE=1 2 3\n} $text ""} "" "$changed \[PKM\]CENTRE = 1 2 3$restart" \
    section-more {regsub {ini PKM CENTRE=1 2 3} $text "ini PKM CENTRE=1 2 3\nini DISPLAY MAX_FEED_OVERRIDE=2"} "" "$changed \[DISPLAY\]MAX_FEED_OVERRIDE = 2$restart" \
    second-value {regsub {BASE=4 5 6} $text {BASE=4 5 7}} "" "$changed \[LEG_0\]BASE = 4 5 6$restart" \
    pin-more {regsub {pin centre.x 1} $text "pin centre.x 1\npin centre.y 1"} "" "pkmkins: \[KINS\]KINEMATICS = \"pkmkins legs=strut:3 coordinates=XYZ\": the module was loaded with other parameters and has no pin pkmkins.centre.y; load it with these" \
] {
    test refused-$name "nothing is set" {
        string map [list $folder/machine.ini FILE] [refused [set_up [apply [list text $change] $printed] "" "" $how]]
    } $said
}

# The module's version as a number, at least 0.0.0; {} without the pin.
foreach {number text} {1002004 1.2.4 1003003 1.3.3 2002003 2.2.3 1999999 1.999.999 3 0.0.3 12000345 12.0.345} {
    test version-$text "a module of another version is refused" {
        refused [set_up $printed "exists pkmkins.version out u32 $number"]
    } "$version $text$again"
    test version-same-$text "and its own is not" {
        expr {"ends" in [set_up [regsub {version 1.2.3} $printed "version $text"] "exists pkmkins.version out u32 $number"]}
    } 0
}
test version-none "a module that is not loaded is named" {
    refused [set_up $printed {dict unset pins pkmkins.version}]
} "pkmkins: HAL has no pin pkmkins.version: load pkmkins in a HALFILE before LIB:pkmkins.tcl; if it is loaded, it is older than $program 1.2.3: reinstall pkmkins"

test nameless "without the name of the INI file nothing is asked for" {
    set machine_before $machine
    set machine [regsub {board.tcl} $machine nameless.tcl]
    set lines [set_up $printed]
    set machine $machine_before
    set lines
} [list ends "${heading}pkmkins: the variable INI_FILE_NAME is missing; LinuxCNC sets it, so run this file from LinuxCNC"]

# A pkmkins-pins beside the file takes precedence.
test beside "a program beside the file is run in place of the installed one" {
    set own [file join $folder hal]
    file mkdir $own
    file copy -force {*}[glob $model::hal/*.tcl] $own
    close [open $own/pkmkins-pins w]
    set before [list $model::hal $program_call]
    set model::hal $own
    set program_call [string map [list /usr/bin/pkmkins-pins $own/pkmkins-pins] $program_call]
    set same [difference [set_up $printed] [table [join $plain \n]]]
    lassign $before model::hal program_call
    set same
} {}
