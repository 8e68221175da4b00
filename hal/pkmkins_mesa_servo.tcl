# SPDX-License-Identifier: GPL-2.0-or-later
# Servo drives with an analog input for speed (+-10 V) on a Mesa card (hostmot2), for pkmkins: a PID
# loop in LinuxCNC, encoders on the card. See `pkm help guide/drives`.
#
# In the INI file, before LIB:pkmkins.tcl:
#
#     [HAL]
#     HALFILE = LIB:pkmkins_mesa_servo.tcl
#     HALFILE = LIB:pkmkins.tcl
#     [HOSTMOT2]
#     DRIVER = hm2_pci
#     BOARD = 5i25
#     CONFIG = num_encoders=6 num_pwmgens=0 num_stepgens=0 sserial_port_0=0XXXXX
#     [JOINT_N]
#     ENCODER_SCALE = 4000        counts per unit of the joint; negative reverses the encoder
#     OUTPUT_PIN = hm2_5i25.0.7i77.0.1.analogout0      without it pwmgen N of the card
#     OUTPUT_SCALE = 600          speed of the joint at 10 V (full output); negative reverses the motor
#     OUTPUT_MIN_LIMIT OUTPUT_MAX_LIMIT     speeds; default: the scale in both directions
#     P I D FF0 FF1 FF2 BIAS DEADBAND       of the loop; P in 1/s, FF1 = 1 if the scale is right
#     MAX_OUTPUT MAX_ERROR                  default 0: no limit
#
# and the inputs and outputs of pkmkins_drives.tcl. Joint N uses encoder N, or the one in [JOINT_N]ENCODER;
# [JOINT_N]FEEDBACK_PIN names an absolute encoder, with its position in units of the joint. The PID loop of
# joint N is JN_pid. [HOSTMOT2]DPLL_TIMER_US: see pkmkins_mesa_step.tcl.

source [file join $::env(HALLIB_DIR) pkmkins_mesa.tcl]

namespace eval pkmkins_mesa_servo {
    # Settings of the PID loop: key, pin, default; P has no default.
    variable gains {
        P Pgain {}  I Igain 0  D Dgain 0  FF0 FF0 0  FF1 FF1 1  FF2 FF2 0
        BIAS bias 0  DEADBAND deadband 0  MAX_OUTPUT maxoutput 0  MAX_ERROR maxerror 0
    }
}

proc pkmkins_mesa_servo::encoder {n} { return [pkmkins_mesa::instance encoder $n ENCODER] }

proc pkmkins_mesa_servo::is_absolute {n} {
    return [expr {[pkmkins_drives::ini JOINT_$n FEEDBACK_PIN] ne ""}]
}

proc pkmkins_mesa_servo::feedback {n} {
    return [pkmkins_drives::ini JOINT_$n FEEDBACK_PIN [encoder $n].position]
}

proc pkmkins_mesa_servo::has_pwm {n} { return [expr {[pkmkins_drives::ini JOINT_$n OUTPUT_PIN] eq ""}] }

proc pkmkins_mesa_servo::pwm {n} { return [pkmkins_mesa::instance pwmgen $n PWMGEN] }

proc pkmkins_mesa_servo::output {n} {
    return [pkmkins_drives::ini JOINT_$n OUTPUT_PIN [pwm $n].value]
}

proc pkmkins_mesa_servo::loop_settings {n} {
    variable gains
    set settings {}
    foreach {key pin default} $gains {
        lappend settings J${n}_pid.$pin [pkmkins_drives::number JOINT_$n $key "a gain of the PID loop" $default]
    }
    # LinuxCNC, too, compares a position read in this cycle with the command of the last one.
    lappend settings J${n}_pid.error-previous-target 1
    return $settings
}

# Analog cards such as the 7i77 have limits besides the scale; a pwmgen has only the scale.
proc pkmkins_mesa_servo::output_settings {n} {
    set section JOINT_$n
    set scale [pkmkins_drives::scale $section OUTPUT_SCALE "speed of the joint at full output"]
    if {[has_pwm $n]} { return [list [pwm $n].scale $scale] }
    if {$scale eq ""} { return {} }
    set limit [expr {abs($scale)}]
    return [list [output $n]-scalemax $scale \
        [output $n]-minlim [pkmkins_drives::number $section OUTPUT_MIN_LIMIT "a speed" -$limit] \
        [output $n]-maxlim [pkmkins_drives::number $section OUTPUT_MAX_LIMIT "a speed" $limit]]
}

proc pkmkins_mesa_servo::of_joint {n} {
    set settings [concat [loop_settings $n] [output_settings $n]]
    if {![is_absolute $n]} {
        lappend settings [encoder $n].scale [pkmkins_drives::scale JOINT_$n ENCODER_SCALE "counts per unit of the joint"]
    }
    return $settings
}

proc pkmkins_mesa_servo::enables {n} {
    return [concat J${n}_pid.enable [expr {[has_pwm $n] ? "[pwm $n].enable" : {}}]]
}

# Wires command and feedback of motion and the loop between them. Motion, encoder and loop share the index pulse.
proc pkmkins_mesa_servo::wire_drive {n} {
    hal net J$n:motor-pos-cmd joint.$n.motor-pos-cmd J${n}_pid.command
    hal net J$n:motor-pos-fb [feedback $n] J${n}_pid.feedback joint.$n.motor-pos-fb
    hal net J$n:output J${n}_pid.output [output $n]
    if {[is_absolute $n]} { return }
    hal net J$n:velocity-fb [encoder $n].velocity J${n}_pid.feedback-deriv
    hal net J$n:index-enable joint.$n.index-enable [encoder $n].index-enable J${n}_pid.index-enable
}

proc pkmkins_mesa_servo::main {} {
    pkmkins_mesa::check
    set settings [pkmkins_drives::settings pkmkins_mesa_servo::of_joint]
    pkmkins_drives::load_motion
    hal loadrt pid names=[pkmkins_drives::names pid]
    pkmkins_mesa::load
    set loops [lmap n [pkmkins_drives::joints] { string cat J${n}_pid.do-pid-calcs }]
    pkmkins_drives::wire_machine [pkmkins_mesa::functions $loops] pkmkins_mesa_servo::enables [pkmkins_mesa::faults]
    foreach n [pkmkins_drives::joints] { wire_drive $n }
    # Absolute encoders use the first timer without a setting.
    set counting [lsearch -inline -regexp $settings {\.encoder\.\d+\.scale$}]
    pkmkins_drives::set_pins [concat $settings [pkmkins_mesa::settings [expr {$counting eq "" ? "" : "encoder"}]]]
}

pkmkins_mesa_servo::main
