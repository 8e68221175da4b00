# SPDX-License-Identifier: GPL-2.0-or-later
# Connects the panels that `pkm panel` writes; their own files source it, after the panel is there.
#
# Nothing that exists is changed: a pin that is on a signal already stays on it, one that is missing is
# left out with a word, and without the component for travel left the rest is shown. A user interface
# without PyVCP has no panel, which is reported once.
#
# A user interface ends LinuxCNC where a file of [HAL]POSTGUI_HALFILE fails: no error leaves this one, nor the files
# that source it, and no wait is without an end.

# Lets pkmkins slow jogs, and has what this needs.
if {[catch { source [file join $::env(HALLIB_DIR) pkmkins_jog.tcl] } error]} {
    catch { puts stderr "pkmkins: panel: not connected: $error" }
}

namespace eval pkmkins_jog {}
namespace eval pkmkins_panel {
    # Where motion takes the kinematics to be used from.
    variable selector motion.switchkins-type
    # Python starts in a second, on a computer that has other work in some.
    variable start_seconds 10
    # Whether the absence of the panel has been reported.
    variable is_reported 0
    namespace path ::pkmkins_jog
}

proc pkmkins_panel::tell {text} { catch { puts stderr "pkmkins: panel: $text" } }

proc pkmkins_panel::is_ready {component} {
    return [regexp "\\s$component\\s+\\S+\\s+ready" [hal show comp $component]]
}

# Returns whether PyVCP is there; reports once that it is not.
proc pkmkins_panel::is_there {} {
    variable is_reported
    variable start_seconds
    # In a window of its own it starts beside the user interface.
    if {!$is_reported && [info exists ::APPLICATIONS(APP)] && [regexp {\mpyvcp\M} $::APPLICATIONS(APP)]} {
        wait $start_seconds { is_ready pyvcp }
    }
    if {[is_ready pyvcp]} { return 1 }
    if {!$is_reported} {
        set is_reported 1
        tell "not shown: this user interface has not loaded \[DISPLAY\]PYVCP, as AXIS does;\
            the machine runs without it"
    }
    return 0
}

# Carries out a script in the caller's place; an error becomes a message.
proc pkmkins_panel::safely {script} {
    # 1: of an error; others are of a return.
    if {[catch { uplevel 1 $script } error] == 1} { tell "not everything is shown: $error" }
}

# Puts pins and what shows them on signals, two by two.
proc pkmkins_panel::show {nets} {
    safely {
        if {![is_there]} { return }
        set missing {}
        set reasons {}
        foreach {pin widget} $nets {
            if {![exists $pin]} {
                lappend missing $pin
                continue
            }
            if {[catch {
                set signal [signal_of $pin]
                if {$signal eq ""} { set signal panel:$widget }
                hal net $signal $pin pyvcp.$widget
            } error]} { lappend reasons "$pin: $error" }
        }
        if {$missing ne ""} { lappend reasons "missing pin [join $missing {, }]" }
        if {$reasons ne ""} { tell "not shown: [join $reasons {; }]" }
    }
}

# Starts the component that knows how far the machine can go along these letters.
proc pkmkins_panel::start {ini letters} {
    safely {
        if {![is_there] || [is_ready pkmkins-panel]} { return }
        set error [started [list pkmkins-panel $ini {*}$letters]]
        if {$error eq ""} { return }
        tell "pkmkins-panel does not start, so the travel left is not shown: $error"
        foreach letter $letters {
            foreach way {minus plus} { hal setp pyvcp.$letter-$way nan }
        }
    }
}

# Starts a component, and waits until it is ready; returns the reason where it is not, else {}. `hal loadusr -W`
# waits for ever for one that hangs, and the user interface with it.
proc pkmkins_panel::started {command} {
    variable start_seconds
    set name [lindex $command 0]
    if {[catch { exec {*}$command & } process]} { return $process }
    set is_ready [wait $start_seconds {
        expr {[is_ready $name] || ![is_running $process]}
    }]
    if {![is_running $process]} { return "it has exited" }
    if {$is_ready} { return "" }
    catch { exec kill -KILL $process }
    return "it was not ready within $start_seconds s"
}

# Returns whether a process is, and is no dead one that waits for its parent.
proc pkmkins_panel::is_running {process} {
    if {[catch {
        set file [open /proc/$process/stat]
        set text [read $file]
        close $file
    }]} { return 0 }
    return [expr {[lindex [string range $text [string last ) $text]+1 end] 0] ne "Z"}]
}

# Connects the buttons for kinematics, where nothing else decides on them.
proc pkmkins_panel::switch {} {
    variable selector
    safely {
        if {![is_there]} { return }
        foreach pin [list $selector pkmkins-panel.kinematics pkmkins-panel.ask-machine pkmkins-panel.ask-joints \
            pyvcp.kinematics.machine pyvcp.kinematics.joints] {
            # That pkmkins-panel does not run has been reported.
            if {![exists $pin]} { return }
        }
        set taken [signal_of $selector]
        if {$taken ne ""} {
            tell "$selector already has signal $taken, so the kinematics buttons have no effect"
            return
        }
        hal net panel:kinematics pkmkins-panel.kinematics $selector
        foreach choice {machine joints} {
            hal net panel:ask-$choice pyvcp.kinematics.$choice pkmkins-panel.ask-$choice
        }
    }
}
