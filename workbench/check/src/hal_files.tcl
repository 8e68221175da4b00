# SPDX-License-Identifier: GPL-2.0-or-later
# Lists the commands of a machine's HAL files, as far as possible without the hardware:
#
#     tclsh hal_files.tcl MACHINE.ini FOLDER HALLIB ENTRY...
#
# pkm writes `ini.tcl`, this and a line that calls `drives::main` into one file; `start.tcl` replaces the last
# if LinuxCNC in virtual time runs the commands. An ENTRY is "file VALUE" or "command VALUE" with the VALUE of a
# key HALFILE or HALCMD. Every file runs in an interpreter without any access: it writes no file
# and starts no process. Each command is a line on standard output, its words separated by
# tabs: the location (file, line), the command (net, unlinkp, setp, addf, loadrt, loadusr), its words; "own" instead of
# pkmkins.tcl, "refused" with the reason if LinuxCNC refuses a command as well, "ends" with the output of a file that
# ends LinuxCNC's start, and "failed" with a reason.

namespace eval drives {
    variable box
    variable folder
    # Folders of LinuxCNC's HAL files: the first one with a file counts.
    variable hallibs {}
    # Whether pkmkins.tcl is run, too: its pins exist only if the module is loaded.
    variable runs_own 0
    # Signal of each linked pin, and values of pins.
    variable signals [dict create]
    variable values [dict create]
    # Output of a file, for the reason if it then ends LinuxCNC's start.
    variable printed {}
    # Current location in a file of halcmd.
    variable place {}
    # Least numbers of words of commands.
    variable counts {setp 2 sets 2 newsig 2 addf 2 linkps 2 linksp 2 net 1 getp 1 unlinkp 1 loadrt 1 loadusr 1}
    # LinuxCNC's commands whose effect is unknown here.
    variable verbs {
        unload unloadrt unloadusr stype gets linkpp unlink ptype delf source save stop quit exit help
        waitusr log
    }
    # Time limit for a file, seconds.
    variable longest 5
    # Files that are running, each sourced by the one before it.
    variable open_files {}
    # Whether commands that cannot be run are listed, and the others run.
    variable goes_on 0
}

# Sets the INI file's values as haltcl does: every section is a global array, every key a list of its values.
proc drives::parse {ini} {
    variable box
    foreach {section key value} [ini_values $ini] {
        $box eval [list lappend ::${section}($key) $value]
        lappend ::ini($section,$key) $value
    }
}

# Ends with a reason for which LinuxCNC ends as well.
proc drives::mistake {reason} { return -code error -errorcode {DRIVES MISTAKE} $reason }

proc drives::say {args} { puts [join [lmap word $args { string map {"\t" " " "\n" " "} $word }] \t] }

# Returns the innermost location in a file among the frames of the interpreter.
proc drives::place {frames} {
    variable place
    foreach frame $frames {
        if {[dict exists $frame file] && [dict get $frame type] eq "source"} {
            return [list [dict get $frame file] [dict get $frame line]]
        }
    }
    return [expr {[llength $place] ? $place : {{} 0}}]
}

proc drives::net {where signal args} {
    variable signals
    set pins [lsearch -all -inline -not -regexp $args {^<?=>?>?$}]
    foreach pin $pins {
        if {[dict exists $signals $pin] && [dict get $signals $pin] ne $signal} {
            mistake "$pin is on signal [dict get $signals $pin] already, and cannot be on $signal"
        }
        dict set signals $pin $signal
    }
    say {*}$where net $signal {*}$pins
}

proc drives::pins_on {signal} {
    variable signals
    return [dict keys [dict filter $signals value $signal]]
}

# Formats a linked pin as halcmd does.
proc drives::show {pin} {
    variable signals
    if {![dict exists $signals $pin]} { return "" }
    return "  $pin ==> [dict get $signals $pin]"
}

proc drives::hal {frames verb args} {
    variable signals
    variable values
    set where [place $frames]
    variable counts
    if {[dict exists $counts $verb] && [llength $args] < [dict get $counts $verb]} {
        mistake "hal $verb $args: LinuxCNC expects more words"
    }
    switch -- $verb {
        net { net $where {*}$args }
        linkps { net $where [lindex $args end] [lindex $args 0] }
        linksp { net $where [lindex $args 0] [lindex $args end] }
        setp { dict set values {*}$args; say {*}$where setp {*}$args }
        addf - loadrt - loadusr { say {*}$where $verb {*}$args }
        unlinkp { dict unset signals [lindex $args 0]; say {*}$where unlinkp {*}$args }
        delsig { foreach pin [pins_on [lindex $args 0]] { hal $frames unlinkp $pin } }
        getp { return [expr {[dict exists $values [lindex $args 0]] ? [dict get $values [lindex $args 0]] : 0}] }
        show { return [show [lindex $args 1]] }
        list { return [dict keys $signals [lindex $args 1]] }
        sets { say {*}$where sets {*}$args }
        alias { say {*}$where alias {*}$args }
        newsig - start - waitusr - lock - unlock - debug - echo - unecho - print - status {}
        default {
            variable verbs
            if {$verb ni $verbs} { mistake "hal $verb $args: LinuxCNC has no such command" }
            error "hal $verb $args: it is not known here what this does"
        }
    }
    return ""
}

# Resolves a file name in an INI file or another file.
proc drives::find {name} {
    variable folder
    if {[regexp {^LIB:(.*)$} $name -> name]} { return [in_library $name] }
    set file [file join $folder $name]
    return [expr {[file exists $file] ? $file : [in_library $name]}]
}

# Resolves one of LinuxCNC's files; in the last folder if none has it.
proc drives::in_library {name} {
    variable hallibs
    foreach library $hallibs {
        set file [file join $library $name]
        if {[file exists $file]} { break }
    }
    return $file
}

# Substitutes [SECTION]KEY, [SECTION](KEY), $NAME and $(NAME) in a line of halcmd.
proc drives::substituted {line} {
    while {[regexp -indices {\[([A-Za-z0-9_]+)\](?:\(([A-Za-z0-9_]+)\)|([A-Za-z0-9_]+))} $line all section one two]} {
        set name [string range $line {*}$section]
        set key [string range $line {*}[expr {[lindex $one 0] >= 0 ? $one : $two}]]
        if {![info exists ::ini($name,$key)]} { mistake "\[$name\]$key is not in the INI file" }
        set line [string replace $line {*}$all [lindex $::ini($name,$key) 0]]
    }
    return $line
}

# Runs a file of halcmd: one command per line, which a backslash at its end continues.
proc drives::run_hal {file} {
    variable place
    set channel [open $file]
    set text [split [read $channel] \n]
    close $channel
    set before ""
    set number 0
    foreach line $text {
        incr number
        if {[regexp {^(.*)\\$} $line -> part]} { append before $part " "; continue }
        set place [list $file $number]
        set command [regsub {(^|\s)#.*$} $before$line ""]
        set before ""
        run_alone $command { run_line [substituted $command] }
    }
    set place {}
}

# Runs a line; with `goes_on`, lists it as skipped if that fails.
proc drives::run_alone {command script} {
    variable goes_on
    if {!$goes_on} { return [uplevel $script] }
    if {[catch { uplevel $script } message options]} { say {*}[where $options] skipped $message $command }
}

proc drives::run_line {line} {
    set words [lmap word [regexp -all -inline {"[^"]*"|\S+} $line] { string trim $word \" }]
    if {![llength $words]} { return }
    if {[lindex $words 1] eq "="} { set words [list setp [lindex $words 0] [lindex $words 2]] }
    if {[lindex $words 0] eq "source"} { return [run_file [lindex $words 1]] }
    hal {} {*}$words
}

proc drives::run_file {name args} {
    variable box
    variable runs_own
    set file [find $name]
    if {[file tail $file] eq "pkmkins.tcl" && !$runs_own} { say $file 1 own; return }
    if {![file exists $file]} {
        variable hallibs
        error "$name is neither beside the INI file nor in [lindex $hallibs end]"
    }
    if {[file extension $file] ne ".tcl"} { return [run_once $file] }
    $box eval [list set ::argv $args]
    $box eval [list set ::argc [llength $args]]
    try { interp invokehidden $box source $file } trap {DRIVES DONE} {} {}
}

# Runs a file of halcmd; refuses one that is running already.
proc drives::run_once {file} {
    variable open_files
    if {$file in $open_files} { error "$file sources itself" }
    lappend open_files $file
    try { run_hal $file } finally { set open_files [lrange $open_files 0 end-1] }
}

proc drives::source_file {name} {
    variable box
    interp invokehidden $box source $name
}

proc drives::print {args} {
    variable printed
    set text [string trim [lindex $args end]]
    if {$text ne ""} { lappend printed $text }
}

# A file that exits with 0 is complete, and LinuxCNC continues with the next one.
proc drives::leave {{code 0}} {
    variable printed
    if {$code eq "0"} { error "exit" "" {DRIVES DONE} }
    say {} 0 ends {*}$printed
    error "exit"
}

# Provides the parts of `file` that only compute with names or test for existence.
proc drives::file_part {part args} {
    if {$part ni {join dirname tail extension rootname normalize exists isfile isdirectory}} {
        error "file $part: it is not carried out here"
    }
    return [file $part {*}$args]
}

proc drives::make_box {} {
    variable box [interp create -safe]
    variable longest
    foreach {name target} {source source_file puts print exit leave file file_part} {
        interp alias $box $name {} drives::$target
    }
    interp alias $box hal_from {} drives::hal
    $box eval {
        # LinuxCNC's own package, which is already loaded.
        proc package args {}
        proc hal args {
            set frames {}
            for {set k [expr {[info frame] - 1}]} {$k > 0} {incr k -1} { lappend frames [info frame $k] }
            hal_from $frames {*}$args
        }
        foreach verb {loadrt loadusr net addf newsig sets linkps linksp} { proc $verb args "hal $verb {*}\$args" }
        # As in haltcl, the value may be an expression.
        proc setp {pin value} { hal setp $pin [uplevel [list expr $value]] }
        proc getp pin { hal getp $pin }
    }
    interp limit $box time -seconds [expr {[clock seconds] + $longest}]
}

proc drives::run_entry {entry} {
    variable place
    lassign [split $entry " "] kind
    set value [string range $entry [string length "$kind "] end]
    if {$kind eq "file"} { return [run_file {*}[regexp -all -inline {\S+} $value]] }
    set place {}
    run_line [substituted $value]
}

# Returns the location of an error: the innermost line of a file in its stack.
proc drives::where {options} {
    variable place
    if {[regexp {\(file "([^"]+)" line (\d+)\)} [dict get $options -errorinfo] -> file line]} {
        return [list $file $line]
    }
    return [expr {[llength $place] ? $place : {{} 0}}]
}

# Returns whether LinuxCNC ends its start due to a file's result.
proc drives::is_mistake {message options} {
    variable verbs
    if {[dict get $options -errorcode] eq {DRIVES MISTAKE}} { return 1 }
    # A key missing in the INI file.
    if {[regexp {^can't read "(?:::)?([A-Z][A-Z0-9_]*)\(} $message]} { return 1 }
    # A command that does not exist in Tcl; commands hidden from these files have other names than HAL's.
    return [expr {[regexp {^invalid command name "(.*)"$} $message -> name]
                  && $name ni $verbs && ![llength [info commands ::$name]]}]
}

proc drives::failed {number message options} {
    say {*}[where $options] [expr {[is_mistake $message $options] ? "refused" : "failed"}] $message
}

proc drives::main {ini in libs args} {
    variable box
    variable folder $in
    variable hallibs $libs
    make_box
    parse $ini
    foreach {name value} [list HALLIB_DIR [lindex $libs end] INI_FILE_NAME $ini HOME / CONFIG_DIR $in] {
        $box eval [list set ::env($name) $value]
    }
    set number 0
    variable goes_on
    foreach entry $args {
        if {[catch { run_entry $entry } message options]} {
            failed $number $message $options
            if {!$goes_on} { return 0 }
        }
        incr number
    }
    return 1
}

# Runs as much as possible, for callers that need the values of pins and signals.
proc drives::all {args} {
    variable goes_on 1
    main {*}$args
}
