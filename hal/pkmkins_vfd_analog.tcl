# SPDX-License-Identifier: GPL-2.0-or-later
# A spindle on an inverter with an analog speed input, for pkmkins. See `pkm help guide/drives`.
#
# In the INI file, after the file with the drives and before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_vfd_analog.tcl
#     [SPINDLE_0]
#     OUTPUT_PIN = hm2_7i76e.0.7i76.0.0.spinout     gets the absolute speed in turns per minute
#     OUTPUT_SCALE = 24000        turns per minute at 10 V
#     ENABLE_PIN FORWARD_PIN REVERSE_PIN            outputs
#     AT_SPEED_PIN                input: the inverter reports that its speed is reached
#     SPEED_PIN                   input: speed measured, turns per minute; at speed within 2 percent
#     RAMP_TIME = 4               seconds until it counts as at speed, if both pins are missing
#
# If all three are missing, LinuxCNC's start ends: a program must not cut before the spindle is at
# speed.

source [file join $::env(HALLIB_DIR) pkmkins_drives.tcl]

namespace eval pkmkins_vfd_analog {
    # Share of the commanded speed that counts as at speed.
    variable tolerance 1.02
}

proc pkmkins_vfd_analog::key {name} { return [pkmkins_drives::ini SPINDLE_0 $name] }

proc pkmkins_vfd_analog::check {} {
    pkmkins_drives::need SPINDLE_0 OUTPUT_PIN "the analog output, such as hm2_7i76e.0.7i76.0.0.spinout"
    pkmkins_drives::scale SPINDLE_0 OUTPUT_SCALE "turns per minute at full output"
    if {[key AT_SPEED_PIN] eq "" && [key SPEED_PIN] eq ""} {
        pkmkins_drives::number SPINDLE_0 RAMP_TIME "the spin-up time of the spindle in seconds, or AT_SPEED_PIN, or SPEED_PIN"
    }
    pkmkins_drives::stop_on_errors
}

proc pkmkins_vfd_analog::wire_command {} {
    hal net spindle:speed spindle.0.speed-out-abs [key OUTPUT_PIN]
    foreach {name pin} {ENABLE_PIN on FORWARD_PIN forward REVERSE_PIN reverse} {
        pkmkins_drives::connect spindle:$pin spindle.0.$pin {*}[pkmkins_drives::pins SPINDLE_0 $name]
    }
    if {[regexp {(^|\.)pwmgen\.\d+\.value$} [key OUTPUT_PIN]]} {
        hal setp [regsub {value$} [key OUTPUT_PIN] scale] [key OUTPUT_SCALE]
        pkmkins_drives::connect spindle:on spindle.0.on [regsub {value$} [key OUTPUT_PIN] enable]
    } else {
        hal setp [key OUTPUT_PIN]-scalemax [key OUTPUT_SCALE]
        hal setp [key OUTPUT_PIN]-minlim 0
        hal setp [key OUTPUT_PIN]-maxlim [key OUTPUT_SCALE]
    }
}

proc pkmkins_vfd_analog::wire_at_speed {} {
    variable tolerance
    if {[key AT_SPEED_PIN] ne ""} {
        pkmkins_drives::connect spindle:at-speed [key AT_SPEED_PIN] spindle.0.at-speed
    } elseif {[key SPEED_PIN] ne ""} {
        hal loadrt near names=spindle-near
        hal addf spindle-near servo-thread
        hal setp spindle-near.scale $tolerance
        pkmkins_drives::connect spindle:speed spindle.0.speed-out-abs spindle-near.in1
        pkmkins_drives::connect spindle:measured [key SPEED_PIN] spindle-near.in2
        hal net spindle:at-speed spindle-near.out spindle.0.at-speed
    } else {
        hal loadrt timedelay names=spindle-ramp
        hal addf spindle-ramp servo-thread
        hal setp spindle-ramp.on-delay [key RAMP_TIME]
        hal setp spindle-ramp.off-delay 0
        pkmkins_drives::connect spindle:on spindle.0.on spindle-ramp.in
        hal net spindle:at-speed spindle-ramp.out spindle.0.at-speed
    }
}

pkmkins_vfd_analog::check
pkmkins_vfd_analog::wire_command
pkmkins_vfd_analog::wire_at_speed
