# SPDX-License-Identifier: GPL-2.0-or-later
# Lets pkmkins slow jogs in world mode: the module sets the maximum speed of every axis.
#
# LinuxCNC's task creates the pins ini.L.max_velocity after all files of [HAL]HALFILE. This line starts the file
# beside any user interface:
#
#     [APPLICATIONS]
#     APP = haltcl $HALLIB_DIR/pkmkins_jog.tcl
#
# The panel of `pkm panel` sources it too; the second run changes nothing. Without it, pkmkins still stops
# jogs before limits, but does not slow them.
#
# A user interface ends LinuxCNC if a file of [HAL]POSTGUI_HALFILE fails: this file catches all errors, and every wait
# is limited.

namespace eval pkmkins_jog {
    # LinuxCNC's task starts at the same time, which takes some seconds on a loaded computer.
    variable task_seconds 20
    # The monitor answers in the next servo cycle, within some ms.
    variable answer_seconds 1
}

# Standard error may be closed.
proc pkmkins_jog::report {text} { catch { puts stderr "pkmkins: $text" } }

proc pkmkins_jog::exists {pin} { return [expr {$pin in [hal list pin $pin]}] }

# Returns the signal of a pin, or {}.
proc pkmkins_jog::signal_of {pin} {
    foreach line [split [hal show pin $pin] \n] {
        if {[regexp {\s(\S+)\s+(?:=[=>]>?|<=[=>]?)\s+(\S+)\s*$} $line -> name signal] && $name eq $pin} {
            return $signal
        }
    }
    return {}
}

# Waits until the script `is_true` returns true; returns whether it did within the given seconds.
proc pkmkins_jog::wait {seconds is_true} {
    set end [expr {[clock milliseconds] + 1000 * $seconds}]
    while {![uplevel 1 $is_true]} {
        if {[clock milliseconds] > $end} { return 0 }
        after 10
    }
    return 1
}

# Returns the axes of LinuxCNC whose jogs the module slows.
proc pkmkins_jog::axes {} {
    set found {}
    foreach axis {x y z a b c u v w} {
        # LinuxCNC sets no speed for a letter that is not in [TRAJ]COORDINATES.
        set is_used [expr {![info exists ::env(TRAJ_COORDINATES)]
            || [string match -nocase *$axis* $::env(TRAJ_COORDINATES)]}]
        if {$is_used && [exists pkmkins.jog-velocity.$axis]} { lappend found $axis }
    }
    return $found
}

# Returns the axes whose speed LinuxCNC's task has not set yet: it creates all pins before it sets them.
proc pkmkins_jog::unset_of {axes} {
    set found {}
    foreach axis $axes {
        if {![exists ini.$axis.max_velocity] || !([hal getp ini.$axis.max_velocity] > 0)} { lappend found $axis }
    }
    return $found
}

# Connects the axes if possible; returns a reason for each axis that is not connected.
proc pkmkins_jog::attach {} {
    variable task_seconds
    variable answer_seconds
    if {![exists pkmkins.jog-scale]} { return [list "the pin pkmkins.jog-scale is missing: load pkmkins"] }
    set axes [axes]
    wait $task_seconds { expr {[set late [unset_of $axes]] eq ""} }
    set reasons {}
    set asked {}
    foreach axis $axes {
        if {$axis in $late} {
            lappend reasons "LinuxCNC's task did not set ini.$axis.max_velocity within $task_seconds s"
            continue
        }
        set signal [signal_of ini.$axis.max_velocity]
        if {$signal eq "pkmkins:jog-velocity-$axis"} { continue }
        if {$signal ne ""} {
            lappend reasons "ini.$axis.max_velocity already has signal $signal: remove it"
        } elseif {[catch {
            # The current maximum speed becomes the upper bound.
            set fastest [hal getp ini.$axis.max_velocity]
            hal setp pkmkins.axis-max-velocity.$axis $fastest
        } error]} {
            lappend reasons $error
        } else {
            lappend asked $axis $fastest
        }
    }
    # pkmkins becomes the writer of a maximum speed once its value equals the current one.
    wait $answer_seconds {
        set waiting {}
        foreach {axis fastest} $asked {
            if {[hal getp pkmkins.jog-velocity.$axis] != $fastest} { lappend waiting $axis }
        }
        expr {$waiting eq ""}
    }
    foreach {axis fastest} $asked {
        if {$axis in $waiting} {
            lappend reasons "pkmkins.jog-velocity.$axis is [hal getp pkmkins.jog-velocity.$axis], not\
                $fastest: check that pkmkins.monitor runs in a thread"
        } elseif {[catch {
            hal net pkmkins:jog-velocity-$axis pkmkins.jog-velocity.$axis ini.$axis.max_velocity
        } error]} {
            lappend reasons $error
        }
    }
    return $reasons
}

if {[catch { pkmkins_jog::attach } pkmkins_jog::reasons]} {
    set pkmkins_jog::reasons [list $pkmkins_jog::reasons]
}
if {$pkmkins_jog::reasons ne ""} {
    pkmkins_jog::report "jogs do not slow down near limits: [join $pkmkins_jog::reasons {; }]"
}
