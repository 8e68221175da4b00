# SPDX-License-Identifier: GPL-2.0-or-later
# A coolant pump for pkmkins, switched off if it is too hot. See `pkm help guide/drives`.
#
# In the INI file, after the file with the drives and before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_coolant.tcl
#     [IO]
#     PUMP_PIN                    outputs: the pump runs; M8 and M9
#     PUMP_OK_PIN                 input, true while the thermal contact of the pump is closed
#
# After the contact opens, the pump is off and feed is held until M9: a cooled pump does not restart
# automatically, and a program does not continue without coolant. The operator gets a message.

source [file join $::env(HALLIB_DIR) pkmkins_drives.tcl]

namespace eval pkmkins_coolant {}

# LinuxCNC loads each of these components only once: if a custom HAL file needs one, add its names here.
proc pkmkins_coolant::load_parts {} {
    hal loadrt not names=pump-hot,pump-off
    hal loadrt flipflop names=pump-latch
    hal loadrt and2 names=pump-run,pump-hold
    hal loadrt message names=pump-message {messages="The coolant pump is too hot: run M9 and let it cool down"}
    foreach name {pump-hot pump-off pump-latch pump-run pump-hold pump-message} {
        hal addf $name servo-thread
    }
}

# The contact sets the latch, M9 resets it; M8 with a hot pump sets it again.
proc pkmkins_coolant::wire {} {
    hal net pump:on iocontrol.0.coolant-flood pump-off.in pump-run.in0 pump-hold.in0
    pkmkins_drives::connect pump:ok [pkmkins_drives::ini IO PUMP_OK_PIN] pump-hot.in
    hal net pump:hot pump-hot.out pump-latch.set
    hal net pump:off pump-off.out pump-latch.reset
    hal net pump:stopped pump-latch.out pump-hold.in1 pump-message.trigger
    hal net pump:cool pump-latch.out-not pump-run.in1
    hal net pump:hold pump-hold.out motion.feed-hold
    pkmkins_drives::connect pump:runs pump-run.out {*}[pkmkins_drives::pins IO PUMP_PIN]
}

pkmkins_drives::need IO PUMP_PIN "the output that enables the pump"
pkmkins_drives::need IO PUMP_OK_PIN "the input that is true while the thermal contact of the pump is closed"
pkmkins_drives::stop_on_errors
pkmkins_coolant::load_parts
pkmkins_coolant::wire
