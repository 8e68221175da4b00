# SPDX-License-Identifier: GPL-2.0-or-later
# The machine described in the INI file, given to the kinematics module pkmkins.
#
# In the INI file, after the HALFILE that loads the kinematics and motmod:
#
#     [HAL]
#     HALFILE = LIB:pkmkins.tcl
#
# Reads [PKM], [LEG_N], [BOX_K], the limits of [JOINT_N], HOME and COORDINATES of [TRAJ], and [KINS]; sets
# the pins of the module, connects it to the motion controller (tool offsets, and the feed that the
# module allows: motion.adaptive-feed, motion.feed-inhibit) and asks for the geometry to be
# frozen (.apply). Everything is checked before the first pin is set: a file with an error stops
# LinuxCNC's start and leaves the module as it was. All errors are listed, not only the first one.
# What the load parameters in [KINS]KINEMATICS may be is the module's affair: it has refused bad
# ones when it was loaded.

namespace eval pkmkins {
    variable errors {}

    # Decimal text that means the same to every reader: no hexadecimal, no "5." or ".5", no words.
    variable number {[+-]?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?}

    # Keys of [PKM] and of [LEG_N] by kind of leg: how many numbers, needed or not ("cardan" keys
    # where the leg has a screw lead), pin they are written to (three numbers: .x .y .z).
    variable machine_keys {
        SCREW_LEAD            {1 optional screw-lead}
        SPINDLE_OFFSET        {1 optional spindle-offset}
        CONVERGENCE_CRITERION {1 optional convergence-criterion}
        LIMIT_ITERATIONS      {1 optional limit-iterations}
        MAX_ERROR             {1 optional max-error}
        CENTRE                {3 optional centre}
        RESIDUAL_LIMIT        {1 optional residual-limit}
        CONDITIONING_LIMIT    {1 optional conditioning-limit}
        ROD_CLEARANCE         {1 optional rod-clearance}
        FEED_FLOOR            {1 optional feed-floor}
    }
    variable leg_keys {
        strut {
            BASE          {3 needed   base}
            PLATFORM      {3 needed   platform}
            BASE_N        {3 cardan   base-n}
            PLATFORM_N    {3 cardan   platform-n}
            LEAD          {1 optional lead}
            OFFSET        {1 optional offset}
            BASE_CONE     {1 optional base-cone}
            PLATFORM_CONE {1 optional platform-cone}
        }
        slider {
            BASE          {3 needed   base}
            PLATFORM      {3 needed   platform}
            GUIDE         {3 needed   guide}
            ROD           {1 needed   rod}
            SIDE          {1 needed   side}
            OFFSET        {1 optional offset}
            BASE_CONE     {1 optional base-cone}
            PLATFORM_CONE {1 optional platform-cone}
        }
        crank {
            BASE          {3 needed   base}
            PLATFORM      {3 needed   platform}
            AXIS          {3 needed   axis}
            ARM           {3 needed   arm}
            ROD           {1 needed   rod}
            SIDE          {1 needed   side}
            OFFSET        {1 optional offset}
            BASE_CONE     {1 optional base-cone}
            PLATFORM_CONE {1 optional platform-cone}
        }
    }
    variable joint_keys {
        MIN_LIMIT min-limit  MAX_LIMIT max-limit
        MAX_VELOCITY max-velocity  MAX_ACCELERATION max-acceleration
    }
    variable most_iterations 288
    # Keys of [BOX_K], in the same form, beside a row of numbers for each letter that the legs move.
    variable box_keys {
        LOW         {6 low}
        HIGH        {6 high}
        STEPS       {1 steps}
        GEOMETRY    {1 geometry}
        WEIGHT      {6 ""}
        CONTRACTION {1 ""}
    }
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

# Whether a key is given once; complains if it is not.
proc pkmkins::is_once {section key expectation} {
    set values [values $section $key]
    switch [llength $values] {
        0 { complain $section $key "is missing: $expectation" }
        1 { return 1 }
        default { complain $section $key "is given [llength $values] times (\"[join $values {", "}]\"): expected once" }
    }
    return 0
}

# The numbers of a key as the INI file writes them; {} (and a complaint) if they are no good.
proc pkmkins::numbers {section key least most} {
    if {![is_once $section $key [expected $least $most]]} { return {} }
    set text [lindex [values $section $key] 0]
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

# One load parameter of [KINS]KINEMATICS, or the module's own default.
proc pkmkins::parameter {name default} {
    regexp "(?:^|\\s)$name=(\\S*)" [lindex [values KINS KINEMATICS] 0] -> default
    return $default
}

# Whether every load parameter is given once, and with a value; complains if it is not. Of several
# LinuxCNC takes the last one, and an empty one for none: neither is what the file says.
proc pkmkins::check_parameters {} {
    set text [lindex [values KINS KINEMATICS] 0]
    set seen {}
    foreach word [words $text] {
        if {![regexp {^([^=]+)=(.*)$} $word -> name value]} { continue }
        if {$name in $seen} {
            complain KINS KINEMATICS "= \"$text\": expected $name= once"
            return 0
        }
        if {$value eq "" && $name ne "table"} {
            complain KINS KINEMATICS "= \"$text\": expected a value after $name="
            return 0
        }
        lappend seen $name
    }
    return 1
}

# The kind of every leg, from legs=KIND:COUNT[,KIND:COUNT].
proc pkmkins::leg_kinds {} {
    variable leg_keys
    if {![is_once KINS KINEMATICS "expected pkmkins and its load parameters"]} { return {} }
    if {![check_parameters]} { return {} }
    set kinds {}
    foreach group [split [parameter legs strut:6] ,] {
        if {![regexp {^([a-z]+):0?([1-9][0-9]?)$} $group -> kind count] || ![dict exists $leg_keys $kind]} {
            complain KINS KINEMATICS "= \"[lindex [values KINS KINEMATICS] 0]\": expected legs=KIND:COUNT with KIND one of [join [dict keys $leg_keys] {, }], found \"$group\""
            return {}
        }
        lappend kinds {*}[lrepeat $count $kind]
    }
    return $kinds
}

proc pkmkins::table_letters {} {
    return [split [string toupper [parameter table ""]] ""]
}

proc pkmkins::leg_letters {} {
    return [split [string toupper [parameter coordinates XYZABC]] ""]
}

# Pose letters that the machine moves: those of the platform and those of the table.
proc pkmkins::moved_letters {} {
    return [concat [leg_letters] [table_letters]]
}

proc pkmkins::check_joints {joints} {
    set words [numbers KINS JOINTS 1 1]
    if {[llength $words] && $joints && [value $words] != $joints} {
        complain KINS JOINTS "= \"$words\": expected $joints, one joint for each leg and each table letter of \[KINS\]KINEMATICS"
    }
}

# LinuxCNC takes no program word with a letter that is missing here, so that nothing could ever
# bring that coordinate back to 0. A letter too many is the integrator's choice: the kinematics
# refuse its moves with a reason, and a jog of it switches the machine off.
proc pkmkins::check_coordinates {} {
    set wanted [join [moved_letters] ""]
    if {![is_once TRAJ COORDINATES "expected the letters $wanted"]} { return }
    set text [lindex [values TRAJ COORDINATES] 0]
    foreach letter [moved_letters] {
        if {[string first $letter [string toupper $text]] >= 0} { continue }
        complain TRAJ COORDINATES "= \"$text\": expected the letters $wanted that \[KINS\]KINEMATICS moves, $letter is missing"
        return
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
        if {![llength $words]} { continue }
        if {$count == 1} {
            lappend pins $pin$index [lindex $words 0]
        } else {
            foreach letter {x y z} word $words { lappend pins $pin$index.$letter $word }
        }
    }
    return $pins
}

# A lead that is missing is not 0: a lost heading or a typing error would drop it silently.
proc pkmkins::require_lead {kinds} {
    foreach n [lsearch -all $kinds strut] {
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

# A sign that tells which of two places the carriage or crank takes, hence no decimal number.
proc pkmkins::check_side {section} {
    set words [words [lindex [values $section SIDE] 0]]
    if {[llength $words] != 1 || ![is_number [lindex $words 0]]} { return }
    if {$words ni {1 +1 -1}} { complain $section SIDE "= \"$words\": expected 1 or -1" }
}

# A machine whose legs need no key of it may do without the section.
proc pkmkins::machine_pins {kinds} {
    variable machine_keys
    variable most_iterations
    check_keys PKM [dict keys $machine_keys]
    require_lead $kinds
    foreach key {CONVERGENCE_CRITERION RESIDUAL_LIMIT ROD_CLEARANCE} { check_range PKM $key 0 Inf }
    foreach key {CONDITIONING_LIMIT FEED_FLOOR} { check_range PKM $key 0 1 }
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
    if {[dict exists $keys ROD]} { check_range $section ROD 0 Inf }
    if {[dict exists $keys SIDE]} { check_side $section }
    return [section_pins $section $keys .$n]
}

# A crank's angle jumps by a turn where its arm points opposite to ARM: no joint follows that.
proc pkmkins::check_turn {n} {
    set words [words [lindex [values LEG_$n OFFSET] 0]]
    set offset [expr {[llength $words] == 1 && [is_number [lindex $words 0]] ? [value [lindex $words 0]] : 0}]
    foreach key {MIN_LIMIT MAX_LIMIT} {
        set text [lindex [values JOINT_$n $key] 0]
        if {abs([value [lindex [words $text] 0]] + $offset) < 180} { continue }
        complain JOINT_$n $key "= \"$text\": expected more than [expr {-180 - $offset}] and less than [expr {180 - $offset}] degrees, where the arm of LEG_$n points opposite to ARM"
    }
}

proc pkmkins::joint_pins {n kind} {
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
    if {$kind eq "crank"} { check_turn $n }
    foreach {key pin} {MAX_VELOCITY max-velocity MAX_ACCELERATION max-acceleration} {
        if {[value [dict get $pins $pin.$n]] <= 0} {
            complain JOINT_$n $key "= \"[dict get $pins $pin.$n]\": expected more than 0"
        }
    }
    return $pins
}

# Number of boxes, from boxes=COUNT; the module has refused what is no such number.
proc pkmkins::boxes {} {
    scan [parameter boxes 0] %d count
    return [expr {[info exists count] ? $count : 0}]
}

proc pkmkins::check_boxes_present {} {
    foreach name [lsort [info globals BOX_*]] {
        if {![regexp {^BOX_(0|[1-9][0-9]*)$} $name -> k] || $k >= [boxes]} {
            complain $name "" "is one too many: \[KINS\]KINEMATICS has boxes=[boxes]"
        }
    }
}

# Pins of the box K, over which `pkm boxes` has proved the kinematics to be one-to-one.
proc pkmkins::box_pins {k legs} {
    variable box_keys
    set section BOX_$k
    set known [dict keys $box_keys]
    foreach letter [leg_letters] { lappend known ROW_$letter }
    check_keys $section $known
    set pins {}
    dict for {key form} $box_keys {
        lassign $form count pin
        set words [numbers $section $key $count $count]
        if {![llength $words] || $pin eq ""} { continue }
        if {$count == 6} {
            foreach letter {x y z a b c} word $words { lappend pins box.$k.$pin.$letter $word }
            continue
        }
        if {![regexp {^[0-9]+$} $words]} {
            complain $section $key "= \"$words\": expected a whole number without sign"
        }
        lappend pins box.$k.$pin $words
    }
    foreach letter [leg_letters] {
        set n 0
        foreach word [numbers $section ROW_$letter $legs $legs] {
            lappend pins box.$k.matrix.[string tolower $letter].$n $word
            incr n
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

# Smallest number that these keys give (a list of section and key, in turn), "" for none.
# LinuxCNC reads these keys and complains of them itself.
proc pkmkins::smallest {keys} {
    set smallest ""
    foreach {section key} $keys {
        set word [lindex [words [lindex [values $section $key] 0]] 0]
        if {![is_number $word] || [value $word] <= 0} { continue }
        if {$smallest eq "" || [value $word] < [value $smallest]} { set smallest $word }
    }
    return $smallest
}

# What the planner may do, for the watch over the motion.
proc pkmkins::planner_pins {} {
    set pins {}
    foreach {word letters} {linear {X Y Z} angular {A B C}} {
        set keys [list TRAJ MAX_[string toupper $word]_ACCELERATION]
        foreach letter [moved_letters] {
            if {$letter in $letters} { lappend keys AXIS_$letter MAX_ACCELERATION }
        }
        set most [smallest $keys]
        if {$most ne ""} { lappend pins $word-acceleration $most }
    }
    set override [smallest {DISPLAY MAX_FEED_OVERRIDE}]
    if {$override ne ""} { lappend pins max-override $override }
    return $pins
}

# A pin lead.N of 0 means "as screw-lead", a key LEAD = 0 means none: where any leg has a LEAD of its
# own, every strut is given the one that acts on it.
proc pkmkins::resolve_leads {pins kinds} {
    if {![llength [dict filter $pins key lead.*]]} { return $pins }
    foreach n [lsearch -all $kinds strut] {
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
    set joints [expr {[llength $kinds] ? [llength $kinds] + [llength [table_letters]] : 0}]
    check_joints $joints
    check_legs_present [llength $kinds]
    check_coordinates
    set pins [machine_pins $kinds]
    set n 0
    foreach kind $kinds {
        lappend pins {*}[leg_pins $n $kind]
        incr n
    }
    for {set n 0} {$n < $joints} {incr n} { lappend pins {*}[joint_pins $n [lindex $kinds $n]] }
    lappend pins {*}[home_pins] {*}[planner_pins]
    check_feed_inhibit
    check_boxes_present
    for {set k 0} {$k < [boxes]} {incr k} { lappend pins {*}[box_pins $k [llength $kinds]] }
    if {[llength $errors]} { stop }
    set pins [resolve_leads $pins $kinds]
    check_pins $pins
    return $pins
}

# A HAL file of one's own may have loaded the module with other parameters than the INI file says.
proc pkmkins::check_pins {pins} {
    set existing [hal list pin pkmkins.*]
    foreach {pin text} $pins {
        if {"pkmkins.$pin" in $existing} { continue }
        complain KINS KINEMATICS "= \"[lindex [values KINS KINEMATICS] 0]\": the module was loaded with other parameters, or is of another version: it has no pin pkmkins.$pin"
        stop
    }
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

# The signal a pin is on, or the one given.
proc pkmkins::signal_of {pin signal} {
    regexp {(?:=[=>]>?|<=[=>]?)\s+(\S+)\s*$} [string trim [hal show pin $pin]] -> signal
    return $signal
}

# A signal has one writer: where something else inhibits feed, the HAL file that knows it has to join
# both, because without its inhibition the module does not change a tool while tilted.
proc pkmkins::check_feed_inhibit {} {
    set taken [signal_of motion.feed-inhibit ""]
    if {$taken ne "" && [signal_of pkmkins.feed-inhibit ""] eq ""} {
        complain HAL HALFILE "= LIB:pkmkins.tcl: motion.feed-inhibit is on signal $taken already: expected an or2 of its writer and pkmkins.feed-inhibit, in a HALFILE before this one"
    }
}

# Adds a pin to the signal its writer is already on, or to a new one.
proc pkmkins::connect {signal source target} {
    hal net [signal_of $source $signal] $source $target
}

# Without the feed that the guard allows the machine still runs, so that an adaptive feed of somebody
# else's is left alone.
proc pkmkins::wire_guard {} {
    foreach name {requested-vel current-vel distance-to-go} {
        connect pkmkins:$name motion.$name pkmkins.$name
    }
    set taken [signal_of motion.adaptive-feed ""]
    if {$taken eq ""} {
        hal net pkmkins:feed-scale pkmkins.feed-scale motion.adaptive-feed
    } elseif {$taken ne [signal_of pkmkins.feed-scale ""]} {
        puts stderr "pkmkins: motion.adaptive-feed is on signal $taken: pkmkins.feed-scale does not act on it"
    }
}

proc pkmkins::wire {} {
    connect pkmkins:machine-on motion.motion-enabled pkmkins.machine-on
    foreach {axis pin} {x tool-offset-x y tool-offset-y z tool-offset} {
        connect pkmkins:tool-offset-$axis motion.tooloffset.$axis pkmkins.$pin
    }
    if {[signal_of pkmkins.feed-inhibit ""] eq ""} {
        hal net pkmkins:feed-inhibit pkmkins.feed-inhibit motion.feed-inhibit
    }
    wire_guard
    hal addf pkmkins.monitor servo-thread
}

pkmkins::set_pins [pkmkins::read_ini]
pkmkins::wire
# The threads are not running yet: the module sees this edge in its first cycle.
hal setp pkmkins.apply 1
