# SPDX-License-Identifier: GPL-2.0-or-later
# Lets pkmkins slow jogs in world mode: the largest speed of every axis is the one that it allows.
#
# LinuxCNC makes the pins ini.L.max_velocity with its task, after all files of [HAL]HALFILE. A line starts this
# file beside every user interface:
#
#     [APPLICATIONS]
#     APP = haltcl $HALLIB_DIR/pkmkins_jog.tcl
#
# The panel of `pkm panel` sources it too; whoever comes second finds the work done. Without it, pkmkins still
# stops jogs before limits, but does not slow them.
#
# A user interface ends LinuxCNC where a file of [HAL]POSTGUI_HALFILE fails: no error leaves this one, and no wait is
# without an end.

namespace eval pkmkins_jog {
    # LinuxCNC's task starts beside this, in some seconds on a computer that has other work.
    variable task_seconds 20
    # The monitor answers in the next servo cycle, of some ms.
    variable answer_seconds 1
}

# Where the standard error is closed, nobody reads this.
proc pkmkins_jog::tell {text} { catch { puts stderr "pkmkins: $text" } }

proc pkmkins_jog::exists {pin} { return [expr {$pin in [hal list pin $pin]}] }

# Returns the signal that a pin is on, or {}.
proc pkmkins_jog::signal_of {pin} {
    foreach line [split [hal show pin $pin] \n] {
        if {[regexp {\s(\S+)\s+(?:=[=>]>?|<=[=>]?)\s+(\S+)\s*$} $line -> name signal] && $name eq $pin} {
            return $signal
        }
    }
    return {}
}

# Waits until the script `is_true` returns true; returns whether that was within so many seconds.
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
        # LinuxCNC gives no speed to a letter that [TRAJ]COORDINATES has not.
        set is_used [expr {![info exists ::env(TRAJ_COORDINATES)]
            || [string match -nocase *$axis* $::env(TRAJ_COORDINATES)]}]
        if {$is_used && [exists pkmkins.jog-velocity.$axis]} { lappend found $axis }
    }
    return $found
}

# Returns those whose speed LinuxCNC's task has not set yet: it makes all pins first, and sets them then.
proc pkmkins_jog::unset_of {axes} {
    set found {}
    foreach axis $axes {
        if {![exists ini.$axis.max_velocity] || !([hal getp ini.$axis.max_velocity] > 0)} { lappend found $axis }
    }
    return $found
}

# Connects the axes that can be; returns why the others are not, a reason for each.
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
            # The speed in force becomes the largest.
            set fastest [hal getp ini.$axis.max_velocity]
            hal setp pkmkins.axis-max-velocity.$axis $fastest
        } error]} {
            lappend reasons $error
        } else {
            lappend asked $axis $fastest
        }
    }
    # pkmkins becomes the writer of a speed once it allows that much.
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
    pkmkins_jog::tell "jogs do not slow down near limits: [join $pkmkins_jog::reasons {; }]"
}
