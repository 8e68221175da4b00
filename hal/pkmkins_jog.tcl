# SPDX-License-Identifier: GPL-2.0-or-later
# Lets pkmkins slow jogs in world mode: the largest speed of every axis is the one that it allows.
#
# LinuxCNC makes the pins ini.L.max_velocity with its task, after all files of [HAL]HALFILE. The panel of
# `pkm panel` carries this file out; without it:
#
#     [HAL]
#     POSTGUI_HALFILE = /usr/share/linuxcnc/hallib/pkmkins_jog.tcl
#
# Without either, pkmkins still stops jogs before limits, but does not slow them.

namespace eval pkmkins_jog {}

proc pkmkins_jog::tell {text} { puts stderr "pkmkins: $text" }

proc pkmkins_jog::exists {pin} { return [expr {$pin in [hal list pin $pin]}] }

# LinuxCNC's task starts beside the user interface.
proc pkmkins_jog::wait_for_task {} {
    for {set tries 0} {$tries < 1000} {incr tries} {
        if {[exists ini.traj_max_velocity]} { return 1 }
        after 10
    }
    tell "jogs are not slowed: LinuxCNC's task has no pin ini.traj_max_velocity after 10 s"
    return 0
}

# The speed in force becomes the largest. pkmkins becomes its writer once it allows that much.
proc pkmkins_jog::take {axis} {
    set fastest [hal getp ini.$axis.max_velocity]
    hal setp pkmkins.axis-max-velocity.$axis $fastest
    for {set tries 0} {[hal getp pkmkins.jog-velocity.$axis] != $fastest} {incr tries} {
        if {$tries == 100} {
            tell "jogs of [string toupper $axis] are not slowed: pkmkins.jog-velocity.$axis is [hal getp pkmkins.jog-velocity.$axis] and not $fastest: does pkmkins.monitor run in a thread?"
            return
        }
        after 10
    }
    if {[catch {
        hal net pkmkins:jog-velocity-$axis pkmkins.jog-velocity.$axis ini.$axis.max_velocity
    } error]} {
        tell "jogs of [string toupper $axis] are not slowed: $error"
    }
}

if {[pkmkins_jog::wait_for_task]} {
    foreach axis {x y z a b c u v w} {
        if {[pkmkins_jog::exists pkmkins.jog-velocity.$axis] && [pkmkins_jog::exists ini.$axis.max_velocity]} {
            pkmkins_jog::take $axis
        }
    }
}
