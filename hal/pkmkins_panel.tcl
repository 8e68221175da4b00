# SPDX-License-Identifier: GPL-2.0-or-later
# Connects the panels that `pkm panel` writes. Their HAL files source this one after the panel has started.
#
# Existing connections stay: a pin on a signal is left there, a missing pin is skipped with a message, and
# without the component for travel left the rest of the panel works. A user interface without PyVCP has no
# panel, which is reported once.
#
# A user interface ends LinuxCNC if a file of [HAL]POSTGUI_HALFILE fails: this file and those that source it catch all
# errors, and every wait is limited.

# Lets pkmkins slow jogs, and defines procedures used here.
if {[catch { source [file join $::env(HALLIB_DIR) pkmkins_jog.tcl] } error]} {
    catch { puts stderr "pkmkins: panel: not connected: $error" }
}

namespace eval pkmkins_jog {}
namespace eval pkmkins_panel {
    # Motion's input for the kinematics to use.
    variable selector motion.switchkins-type
    # Python starts within a second, or some seconds on a loaded computer.
    variable start_seconds 10
    # Whether the missing panel has been reported.
    variable is_reported 0
    # The machine's file, as the panel names it.
    variable machine MACHINE.ini
    namespace path ::pkmkins_jog
}

proc pkmkins_panel::report {text} { catch { puts stderr "pkmkins: panel: $text" } }

proc pkmkins_panel::is_ready {component} {
    return [regexp "\\s$component\\s+\\S+\\s+ready" [hal show comp $component]]
}

# Returns whether PyVCP is running; reports once if it is not.
proc pkmkins_panel::is_there {} {
    variable is_reported
    variable start_seconds
    # In a separate window, PyVCP starts at the same time as the user interface.
    if {!$is_reported && [info exists ::APPLICATIONS(APP)] && [regexp {\mpyvcp\M} $::APPLICATIONS(APP)]} {
        wait $start_seconds { is_ready pyvcp }
    }
    if {[is_ready pyvcp]} { return 1 }
    if {!$is_reported} {
        set is_reported 1
        report "not shown: this user interface has not loaded \[DISPLAY\]PYVCP, as AXIS does;\
            the machine runs without it"
    }
    return 0
}

# Runs a script in the caller's scope; prints an error as a message.
proc pkmkins_panel::safely {script} {
    # Code 1 is an error; others come from return.
    if {[catch { uplevel 1 $script } error] == 1} { report "not everything is shown: $error" }
}

# Connects pairs of a pin and the panel's pin that shows it.
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
        # Pins of the machine itself are missing if the panel is another machine's.
        if {[lsearch -not $missing pkmkins-panel.*] >= 0} {
            variable machine
            lappend reasons "run pkm panel $machine to write the panel again"
        }
        if {$reasons ne ""} { report "not shown: [join $reasons {; }]" }
    }
}

# Starts the component that computes the travel left along these letters.
proc pkmkins_panel::start {ini letters} {
    variable machine $ini
    safely {
        if {![is_there] || [is_ready pkmkins-panel]} { return }
        set error [started [list pkmkins-panel $ini {*}$letters]]
        if {$error eq ""} { return }
        report "pkmkins-panel does not start, so the travel left is not shown: $error"
        foreach letter $letters {
            foreach way {minus plus} { hal setp pyvcp.$letter-$way nan }
        }
    }
}

# Starts a component and waits until it is ready; returns {}, or why it is not ready. `hal loadusr -W` would wait
# forever for a component that hangs, and the user interface with it.
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

# Returns whether a process exists and is not a zombie.
proc pkmkins_panel::is_running {process} {
    if {[catch {
        set file [open /proc/$process/stat]
        set text [read $file]
        close $file
    }]} { return 0 }
    return [expr {[lindex [string range $text [string last ) $text]+1 end] 0] ne "Z"}]
}

# Connects the buttons for switching kinematics, unless motion's input is already connected.
proc pkmkins_panel::switch {} {
    variable selector
    safely {
        if {![is_there]} { return }
        foreach pin [list $selector pkmkins-panel.kinematics pkmkins-panel.ask-machine pkmkins-panel.ask-joints \
            pyvcp.kinematics.machine pyvcp.kinematics.joints] {
            # The missing pkmkins-panel has been reported already.
            if {![exists $pin]} { return }
        }
        set taken [signal_of $selector]
        if {$taken ne ""} {
            report "$selector already has signal $taken, so the kinematics buttons have no effect"
            return
        }
        hal net panel:kinematics pkmkins-panel.kinematics $selector
        foreach choice {machine joints} {
            hal net panel:ask-$choice pyvcp.kinematics.$choice pkmkins-panel.ask-$choice
        }
    }
}
