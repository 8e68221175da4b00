# SPDX-License-Identifier: GPL-2.0-or-later
# What connects the panels that `pkm panel` writes; their own files source it, after the panel is there. It
# lets pkmkins slow jogs as well.
#
# Nothing that exists is changed: a pin that is on a signal already stays on it, one that is missing is
# left out with a word, and without the component for travel left the rest is shown.

namespace eval pkmkins_panel {
    # Where motion takes the kinematics to be used from.
    variable selector motion.switchkins-type
}

proc pkmkins_panel::tell {text} { puts stderr "pkmkins: panel: $text" }

proc pkmkins_panel::exists {pin} { return [expr {$pin in [hal list pin $pin]}] }

# The signal that a pin is on, or {}.
proc pkmkins_panel::signal_of {pin} {
    foreach line [split [hal show pin $pin] \n] {
        if {[regexp {\s(\S+)\s+(?:=[=>]>?|<=[=>]?)\s+(\S+)\s*$} $line -> name signal] && $name eq $pin} {
            return $signal
        }
    }
    return {}
}

# Puts a pin and what shows it on one signal.
proc pkmkins_panel::show {nets} {
    foreach {pin widget} $nets {
        if {![exists $pin]} {
            tell "there is no pin $pin: not shown"
            continue
        }
        set signal [signal_of $pin]
        if {$signal eq ""} { set signal panel:$widget }
        hal net $signal $pin pyvcp.$widget
    }
}

# The component that knows how far the machine can go along these letters.
proc pkmkins_panel::start {ini letters} {
    if {![catch { hal loadusr -Wn pkmkins-panel pkmkins-panel $ini {*}$letters } error]} { return }
    tell "pkmkins-panel does not start: no travel left is shown: $error"
    foreach letter $letters {
        foreach way {minus plus} { hal setp pyvcp.$letter-$way nan }
    }
}

# The buttons for kinematics, where nothing else decides on them.
proc pkmkins_panel::switch {} {
    variable selector
    if {![exists pkmkins-panel.kinematics] || ![exists $selector]} { return }
    set taken [signal_of $selector]
    if {$taken ne ""} {
        tell "$selector is on signal $taken: the buttons for kinematics do nothing"
        return
    }
    hal net panel:kinematics pkmkins-panel.kinematics $selector
    foreach choice {machine joints} {
        hal net panel:ask-$choice pyvcp.kinematics.$choice pkmkins-panel.ask-$choice
    }
}

source [file join $::env(HALLIB_DIR) pkmkins_jog.tcl]
