# SPDX-License-Identifier: GPL-2.0-or-later
# The machine described in the INI file, given to the kinematics module pkmkins.
#
# In the INI file, after the HALFILE that loads the kinematics and motmod:
#
#     [HAL]
#     HALFILE = LIB:pkmkins.tcl
#
# Reads [PKM], [LEG_N], the limits of [JOINT_N], [TRAJ]HOME and [KINS]; sets the pins of the
# module, connects it to the motion controller and asks for the geometry to be frozen (.apply).
# Everything is checked before the first pin is set: a file with an error stops LinuxCNC's start
# and leaves the module as it was. All errors are listed, not only the first one.

namespace eval pkmkins {
    variable errors {}

    # Decimal text that means the same to every reader: no hexadecimal, no "5." or ".5", no words.
    variable number {[+-]?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?}

    # Keys of [PKM] and of [LEG_N] by kind of leg: how many numbers, needed or not ("cardan" keys
    # where the leg has a screw lead), pin they are written to (three numbers: .x .y .z; "" = only
    # host tools use them).
    variable machine_keys {
        SCREW_LEAD            {1 optional screw-lead}
        SPINDLE_OFFSET        {1 optional spindle-offset}
        CONVERGENCE_CRITERION {1 optional convergence-criterion}
        LIMIT_ITERATIONS      {1 optional limit-iterations}
        MAX_ERROR             {1 optional max-error}
    }
    variable leg_keys {
        strut {
            BASE          {3 needed   base}
            PLATFORM      {3 needed   platform}
            BASE_N        {3 cardan   base-n}
            PLATFORM_N    {3 cardan   platform-n}
            LEAD          {1 optional lead}
            OFFSET        {1 optional offset}
            BASE_CONE     {1 optional ""}
            PLATFORM_CONE {1 optional ""}
        }
    }
    variable joint_keys {
        MIN_LIMIT min-limit  MAX_LIMIT max-limit
        MAX_VELOCITY max-velocity  MAX_ACCELERATION max-acceleration
    }
    variable most_iterations 288
}

proc pkmkins::complain {section key text} {
    variable errors
    lappend errors "\[$section\]$key $text"
}

# Every value the INI file gives to a key, as text; haltcl's arrays hold one element a line.
proc pkmkins::values {section key} {
    if {![info exists ::${section}($key)]} { return {} }
    return [set ::${section}($key)]
}

proc pkmkins::is_number {word} {
    variable number
    if {![regexp "^$number\$" $word]} { return 0 }
    scan $word %f value
    # A number too small for a double would silently be none at all.
    regexp {^[^eE]*} $word mantissa
    return [expr {abs($value) < Inf && ($value != 0 || ![regexp {[1-9]} $mantissa])}]
}

proc pkmkins::words {text} {
    return [regexp -all -inline {[^ \t]+} $text]
}

proc pkmkins::expected {least most} {
    if {$least != $most} { return "expected $least to $most decimal numbers separated by blanks" }
    if {$least == 1} { return "expected one decimal number and nothing else on the line" }
    return "expected $least decimal numbers separated by blanks and nothing else on the line"
}

# The numbers of a key as the INI file writes them; {} (and a complaint) if they are no good.
proc pkmkins::numbers {section key least most} {
    set values [values $section $key]
    if {[llength $values] == 0} {
        complain $section $key "is missing: [expected $least $most]"
        return {}
    }
    if {[llength $values] > 1} {
        complain $section $key "is given [llength $values] times (\"[join $values {", "}]\"): expected once"
        return {}
    }
    set text [lindex $values 0]
    set words [words $text]
    foreach word $words {
        if {![is_number $word]} {
            complain $section $key "= \"$text\": [expected $least $most], \"$word\" is none"
            return {}
        }
    }
    if {[llength $words] < $least || [llength $words] > $most} {
        complain $section $key "= \"$text\": [expected $least $most], found [llength $words]"
        return {}
    }
    return $words
}

proc pkmkins::value {word} {
    scan $word %f value
    return $value
}

# Sections whose name begins with LEG_, as the INI file spells them.
proc pkmkins::leg_sections {} {
    set sections {}
    foreach name [info globals LEG_*] {
        if {[array exists ::$name]} { lappend sections $name }
    }
    return [lsort -dictionary $sections]
}

proc pkmkins::check_keys {section known} {
    foreach key [lsort [array names ::$section]] {
        if {[string index $key 0] eq ";" || $key in $known} { continue }
        complain $section $key "= \"[lindex [values $section $key] 0]\": unknown key, expected one of [join $known {, }]"
    }
}

# The kind of every leg, from legs=KIND:COUNT[,KIND:COUNT] of [KINS]KINEMATICS.
proc pkmkins::leg_kinds {} {
    variable leg_keys
    set lines [values KINS KINEMATICS]
    if {[llength $lines] > 1} {
        complain KINS KINEMATICS "is given [llength $lines] times (\"[join $lines {", "}]\"): expected once"
        return {}
    }
    set text [lindex $lines 0]
    set legs strut:6
    regexp {(?:^|\s)legs=(\S*)} $text -> legs
    set kinds {}
    foreach group [split $legs ,] {
        if {![regexp {^([a-z]+):([1-9][0-9]?)$} $group -> kind count] || ![dict exists $leg_keys $kind]} {
            complain KINS KINEMATICS "= \"$text\": expected legs=KIND:COUNT with KIND one of [dict keys $leg_keys], found \"$group\""
            return {}
        }
        lappend kinds {*}[lrepeat $count $kind]
    }
    return $kinds
}

proc pkmkins::check_joints {legs} {
    set words [numbers KINS JOINTS 1 1]
    if {[llength $words] && $legs && [value $words] != $legs} {
        complain KINS JOINTS "= \"$words\": expected $legs, one joint for each leg of \[KINS\]KINEMATICS"
    }
}

proc pkmkins::check_legs_present {legs} {
    if {$legs == 0} { return }
    set wanted {}
    for {set n 0} {$n < $legs} {incr n} { lappend wanted LEG_$n }
    foreach section $wanted {
        if {![array exists ::$section]} { complain $section "" "is missing: \[KINS\]KINEMATICS has $legs legs" }
    }
    foreach section [leg_sections] {
        if {$section ni $wanted} {
            complain $section "" "is one too many: expected LEG_0 to LEG_[expr {$legs - 1}] from \[KINS\]KINEMATICS"
        }
    }
}

# Screw lead that acts on a leg: its own, else that of the machine, else none.
proc pkmkins::effective_lead {section} {
    foreach where [list [list $section LEAD] {PKM SCREW_LEAD}] {
        set words [words [lindex [values {*}$where] 0]]
        if {[llength $words] == 1 && [is_number [lindex $words 0]]} { return [value [lindex $words 0]] }
    }
    return 0
}

proc pkmkins::is_wanted {section key need} {
    if {[llength [values $section $key]]} { return 1 }
    switch $need {
        needed { return 1 }
        cardan { return [expr {[effective_lead $section] != 0}] }
    }
    return 0
}

# Pins of one section, as a list of name and text; `index` is "" or ".N".
proc pkmkins::section_pins {section keys index} {
    set pins {}
    dict for {key form} $keys {
        lassign $form count need pin
        if {![is_wanted $section $key $need]} { continue }
        set words [numbers $section $key $count $count]
        if {![llength $words] || $pin eq ""} { continue }
        if {$count == 1} {
            lappend pins $pin$index [lindex $words 0]
        } else {
            foreach letter {x y z} word $words { lappend pins $pin$index.$letter $word }
        }
    }
    return $pins
}

# A lead that is missing is not 0: a lost heading or a typing error would drop it silently.
proc pkmkins::require_lead {legs} {
    for {set n 0} {$n < $legs} {incr n} {
        if {[llength [values LEG_$n LEAD]]} { continue }
        if {![llength [values PKM SCREW_LEAD]]} { numbers PKM SCREW_LEAD 1 1 }
        return
    }
}

# More than `least`, at most `most`; text that is no number is complained of elsewhere.
proc pkmkins::check_range {section key least most} {
    set words [words [lindex [values $section $key] 0]]
    if {[llength $words] != 1 || ![is_number [lindex $words 0]]} { return }
    set value [value [lindex $words 0]]
    if {$value <= $least || $value > $most} {
        complain $section $key "= \"$words\": expected more than $least[expr {$most < Inf ? " and at most $most" : ""}]"
    }
}

proc pkmkins::machine_pins {legs} {
    variable machine_keys
    variable most_iterations
    check_keys PKM [dict keys $machine_keys]
    require_lead $legs
    check_range PKM CONVERGENCE_CRITERION 0 Inf
    set pins [section_pins PKM $machine_keys ""]
    if {![dict exists $pins limit-iterations]} { return [dict set pins limit-iterations $most_iterations] }
    set text [dict get $pins limit-iterations]
    if {![regexp {^[0-9]+$} $text] || [value $text] < 1 || [value $text] > $most_iterations} {
        complain PKM LIMIT_ITERATIONS "= \"$text\": expected a whole number from 1 to $most_iterations"
    }
    return $pins
}

proc pkmkins::leg_pins {n kind} {
    variable leg_keys
    set section LEG_$n
    if {![array exists ::$section]} { return {} }
    set keys [dict get $leg_keys $kind]
    check_keys $section [dict keys $keys]
    foreach key {BASE_CONE PLATFORM_CONE} { check_range $section $key 0 180 }
    return [section_pins $section $keys .$n]
}

proc pkmkins::joint_pins {n} {
    variable joint_keys
    set pins {}
    foreach {key pin} $joint_keys {
        set words [numbers JOINT_$n $key 1 1]
        if {![llength $words]} { return {} }
        lappend pins $pin.$n $words
    }
    if {[value [dict get $pins min-limit.$n]] >= [value [dict get $pins max-limit.$n]]} {
        complain JOINT_$n MIN_LIMIT "= \"[dict get $pins min-limit.$n]\": expected less than MAX_LIMIT = [dict get $pins max-limit.$n]"
    }
    foreach {key pin} {MAX_VELOCITY max-velocity MAX_ACCELERATION max-acceleration} {
        if {[value [dict get $pins $pin.$n]] <= 0} {
            complain JOINT_$n $key "= \"[dict get $pins $pin.$n]\": expected more than 0"
        }
    }
    return $pins
}

# Reference pose. LinuxCNC 2.9 takes the angles of HOME as 0 whatever the file says, so that
# a tilted HOME would be another pose there than the one the geometry was measured at.
proc pkmkins::home_pins {} {
    set words [numbers TRAJ HOME 3 9]
    if {![llength $words]} { return {} }
    set pins {}
    foreach letter {x y z a b c} word [lrange $words 0 5] {
        if {$word eq ""} { set word 0 }
        lappend pins home.$letter $word
        if {$letter in {a b c} && [value $word] != 0} {
            complain TRAJ HOME "= \"[join $words]\": expected a level pose, A = B = C = 0"
            return {}
        }
    }
    return $pins
}

# A pin lead.N of 0 means "as screw-lead", a key LEAD = 0 means none: where any leg has a LEAD of its
# own, every leg is given the one that acts on it.
proc pkmkins::resolve_leads {pins legs} {
    if {![llength [dict filter $pins key lead.*]]} { return $pins }
    for {set n 0} {$n < $legs} {incr n} {
        if {[dict exists $pins lead.$n] || ![dict exists $pins screw-lead]} { continue }
        dict set pins lead.$n [dict get $pins screw-lead]
    }
    dict set pins screw-lead 0
    return $pins
}

# All pins the INI file gives a value to; stops the start if anything is wrong with it.
proc pkmkins::read_ini {} {
    variable errors
    set kinds [leg_kinds]
    check_joints [llength $kinds]
    check_legs_present [llength $kinds]
    set pins [machine_pins [llength $kinds]]
    set n 0
    foreach kind $kinds {
        lappend pins {*}[leg_pins $n $kind] {*}[joint_pins $n]
        incr n
    }
    lappend pins {*}[home_pins]
    if {[llength $errors]} { stop }
    return [resolve_leads $pins [llength $kinds]]
}

# LinuxCNC ends its start when a HAL file ends with a code that is not 0.
proc pkmkins::stop {} {
    variable errors
    puts stderr "\npkmkins: the machine is not set up, LinuxCNC does not start:"
    foreach text $errors { puts stderr "pkmkins: $text" }
    puts stderr ""
    exit 1
}

# `hal setp`, not haltcl's own setp, which would evaluate the text (010 would become 8).
proc pkmkins::set_pins {pins} {
    foreach {pin text} $pins { hal setp pkmkins.$pin $text }
}

# Adds a pin to the signal its writer is already on, or to a new one.
proc pkmkins::connect {signal source target} {
    regexp {=[=>]>?\s+(\S+)\s*$} [string trim [hal show pin $source]] -> signal
    hal net $signal $source $target
}

proc pkmkins::wire {} {
    connect pkmkins:machine-on motion.motion-enabled pkmkins.machine-on
    foreach {axis pin} {x tool-offset-x y tool-offset-y z tool-offset} {
        connect pkmkins:tool-offset-$axis motion.tooloffset.$axis pkmkins.$pin
    }
    hal addf pkmkins.monitor servo-thread
}

pkmkins::set_pins [pkmkins::read_ini]
pkmkins::wire
# The threads are not running yet: the module sees this edge in its first cycle.
hal setp pkmkins.apply 1
