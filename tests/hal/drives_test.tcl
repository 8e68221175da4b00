# SPDX-License-Identifier: GPL-2.0-or-later
# The HAL files for drives, spindle and coolant: the loads, pins and signals of each, and its complaints about missing and
# wrong keys, all in one list before anything is loaded.

foreach case [lsort [glob $here/cases/*.ini]] {
    set name [file rootname [file tail $case]]
    test $name "asks for what $name.hal lists" {
        difference [asked [content $case]] [table [content [file rootname $case].hal]]
    } {}
}

# Returns the INI file of a case with changed keys: `section key value`, with {} for a removed key.
proc changed {case changes} {
    set lines {}
    set section ""
    foreach line [split [content $::here/cases/$case.ini] \n] {
        regexp {^\[(.*)\]$} $line -> section
        foreach {own key value} $changes {
            if {$own ne $section || ![string match "$key = *" $line]} { continue }
            set line [expr {$value eq "" ? "" : "$key = $value"}]
        }
        lappend lines $line
    }
    return [join $lines \n]
}

# Returns the complaints about a case with changed keys. Fails if there is no heading or if a line that matches `absent` was
# asked for.
proc refusal {case changes absent} {
    set lines [asked [changed $case $changes]]
    if {"ends" ni $lines} { error "it is not refused" }
    foreach line [lsearch -all -inline -not $lines "says *"] {
        if {[regexp $absent $line]} { error "asked for: $line" }
    }
    set complaints [lmap line [lsearch -all -inline $lines "says ?*"] { string range $line 5 end }]
    if {[lindex $complaints 0] ne "pkmkins: LinuxCNC does not start, because the drives are not configured correctly:"} { error "no heading: $complaints" }
    return [lmap text [lrange $complaints 1 end] { regsub {^pkmkins: } $text "" }]
}

# Required keys: case, section, key, expected text.
set steps "steps per unit of the joint"
set times "nanoseconds, from the data sheet of the drive"
set estop "the input that is true while the emergency stop chain is closed, or NONE"
set driver "the driver of the card with its parameters, such as hm2_eth board_ip=10.10.10.10"
set board "the HAL name of the card, such as 7i92"
set output "an output of a port, such as parport.0.pin-02-out"
set needed {}
foreach {case drive section keys} [subst {
    mesa_step {load|run|net|set} HOSTMOT2 {DRIVER "$driver" BOARD "$board"}
    mesa_step {load|run|net|set} IO {ESTOP_PIN "$estop"}
    mesa_step {load|run|net|set} JOINT_1 {SCALE "$steps" STEPLEN "$times" STEPSPACE "$times" DIRSETUP "$times" DIRHOLD "$times" MAX_VELOCITY "the limit of the joint" MAX_ACCELERATION "the limit of the joint"}
    mesa_step {(net|set) \[^ ]*spindle} SPINDLE_0 {OUTPUT_PIN "the analog output, such as hm2_7i76e.0.7i76.0.0.spinout" OUTPUT_SCALE "turns per minute at full output"}
    mesa_step {pump-} IO {PUMP_PIN "the output that enables the pump" PUMP_OK_PIN "the input that is true while the thermal contact of the pump is closed"}
    mesa_step_least {vfd} SPINDLE_0 {VFD "the component with its arguments, such as hy_vfd -n vfd -d /dev/ttyUSB0"}
    mesa_servo {load|run|net|set} HOSTMOT2 {DRIVER "$driver"}
    mesa_servo {load|run|net|set} IO {ESTOP_PIN "$estop"}
    mesa_servo {load|run|net|set} JOINT_0 {P "a gain of the PID loop" OUTPUT_SCALE "speed of the joint at full output" ENCODER_SCALE "counts per unit of the joint"}
    mesa_servo {load|run|net|set} JOINT_1 {P "a gain of the PID loop" OUTPUT_SCALE "speed of the joint at full output"}
    parport {load|run|net|set} EMCMOT {BASE_PERIOD "the base period in nanoseconds, see latency-test"}
    parport {load|run|net|set} PARPORT {PORTS "addresses of the ports, such as 0x378 out"}
    parport {load|run|net|set} IO {ESTOP_PIN "$estop"}
    parport {load|run|net|set} JOINT_0 {SCALE "$steps" STEPLEN "$times" STEPSPACE "$times" DIRSETUP "$times" DIRHOLD "$times" MAX_VELOCITY "the limit of the joint" MAX_ACCELERATION "the limit of the joint" STEP_PIN "$output" DIR_PIN "$output"}
    parport {(net|set) \[^ ]*spindle} SPINDLE_0 {RAMP_TIME "the spin-up time of the spindle in seconds, or AT_SPEED_PIN, or SPEED_PIN"}
    ethercat {load|run|net|set} ETHERCAT {CONFIG "the file with the drives and their process data"}
    ethercat {load|run|net|set} JOINT_0 {SCALE "increments per unit of the joint"}
    ethercat {load|run|net|set} IO {ESTOP_PIN "$estop"}
}] {
    foreach {key expected} $keys { lappend needed $case $drive $section $key $expected }
}

foreach {case absent section key expected} $needed {
    test missing-$case-$section-$key "a missing key is named" {
        refusal $case [list $section $key {}] $absent
    } [list "\[$section\]$key is missing: expected $expected"]
}

# Values that are not one decimal number.
set numbers {}
foreach {case absent section key expected} $needed {
    if {[regexp {SCALE|STEP[LS]|DIR[SH]|MAX_|^P$|RAMP|BASE_P} $key]} { lappend numbers $case $absent $section $key $expected }
}
lappend numbers mesa_step {load|run|net|set} JOINT_1 STEPGEN_MAXVEL "units and seconds"
lappend numbers mesa_step {load|run|net|set} JOINT_1 STEPGEN_MAXACCEL "units and seconds"
lappend numbers parport {load|run|net|set} JOINT_1 STEPGEN_MAXVEL "units and seconds"
lappend numbers parport {load|run|net|set} JOINT_1 STEPGEN_MAXACCEL "units and seconds"
lappend numbers mesa_servo {load|run|net|set} JOINT_2 OUTPUT_MIN_LIMIT "a speed"
lappend numbers mesa_servo {load|run|net|set} JOINT_2 OUTPUT_MAX_LIMIT "a speed"
foreach key {I D FF0 FF1 FF2 BIAS DEADBAND MAX_OUTPUT MAX_ERROR} {
    lappend numbers mesa_servo {load|run|net|set} JOINT_1 $key "a gain of the PID loop"
}
foreach {case absent section key expected} $numbers {
    test number-$case-$section-$key "what is no number is refused with its value" {
        refusal $case [list $section $key "4 mm"] $absent
    } [list "\[$section\]$key = \"4 mm\": expected $expected, one decimal number"]
    if {[string match *SCALE $key]} {
        test zero-$case-$section-$key "a scale of 0 is refused" {
            refusal $case [list $section $key -0.0] $absent
        } [list "\[$section\]$key = \"-0.0\": expected $expected, not 0"]
    }
}
foreach key {STEPLEN STEPSPACE DIRSETUP DIRHOLD} {
    foreach text {5000.5 5e3 -5000} {
        test whole-$key-$text "a time is a whole number of nanoseconds" {
            refusal mesa_step [list JOINT_1 $key $text] {load|run|net|set}
        } [list "\[JOINT_1\]$key = \"$text\": expected $times, a whole number"]
    }
}
foreach text {abc 1,5 0x10 nan 1e 1e1.5 . -} {
    test form-$text "a text that is no decimal number is refused" {
        refusal ethercat [list JOINT_1 SCALE $text] {load}
    } [list "\[JOINT_1\]SCALE = \"$text\": expected increments per unit of the joint, one decimal number"]
}
foreach {text value} {+1.5 +1.5  1. 1.  .5 .5  1e3 1e3  -2.5E-1 -2.5E-1  007 7  -007.5 -7.5  0.25 0.25  .05 .05  10.06 10.06  1e10 1e10  2E05 2E05} {
    test form-$text "a decimal number is taken as it is" {
        lsearch -inline [asked [changed ethercat [list JOINT_1 SCALE $text]]] "set cia402.1.pos-scale *"
    } "set cia402.1.pos-scale $value"
}

test missing-all "everything that is missing is in one list" {
    refusal mesa_step {HOSTMOT2 BOARD {} IO ESTOP_PIN {} JOINT_0 SCALE {} JOINT_1 DIRHOLD x} {load|run|net|set}
} [list \
    "\[HOSTMOT2\]BOARD is missing: expected $board" \
    "\[IO\]ESTOP_PIN is missing: expected $estop" \
    "\[JOINT_0\]SCALE is missing: expected $steps" \
    "\[JOINT_1\]DIRHOLD = \"x\": expected $times, one decimal number"]

test missing-joints "the number of joints is needed" {
    refusal ethercat {KINS JOINTS {}} {load}
} {{[KINS]JOINTS is missing: expected the number of joints}}

# Without encoders the card has no pin for their timer.
test absolute-timer "the timer of encoders is set only if there are some" {
    set text [content $here/cases/mesa_servo.ini]
    foreach {scale n} {4000 00 -4002 02} { regsub "ENCODER_SCALE = $scale" $text "FEEDBACK_PIN = hm2_5i25.0.biss.$n.position" text }
    lsearch -all -inline [asked $text] "set *timer*"
} {{set hm2_5i25.0.dpll.01.timer-us -50}}

# One of the three keys for a spindle at speed is enough.
foreach {key value} {AT_SPEED_PIN parport.1.pin-15-in SPEED_PIN parport.1.pin-15-in} {
    test enough-$key "one way to know that the spindle is up is enough" {
        expr {"ends" in [asked [regsub {RAMP_TIME = 4} [content $here/cases/parport.ini] "$key = $value"]]}
    } 0
}

# A spindle or a pump with custom drives.
foreach {file case} {vfd_modbus mesa_step_least vfd_analog mesa_servo coolant mesa_step} {
    test alone-$file "the file needs no file for drives" {
        set text [regsub -all {HALFILE = [^\n]*\n} [content $here/cases/$case.ini] ""]
        set card {add_component hm2_7i92 {}}
        set lines [asked [regsub {\[HAL\]\n} $text "\[HAL\]\nHALFILE = board.tcl\nHALFILE = LIB:pkmkins_$file.tcl\n"] $card]
        set of_case [table [content $here/cases/$case.hal]]
        # Everything requested is in the table of the case, whose signals may have more pins.
        set strange [lmap line [lrange $lines 2 end] { if {$line in $of_case} continue; set line }]
        list [llength $lines] $strange
    } [dict get {vfd_modbus {9 {}} vfd_analog {10 {}} coolant {20 {}}} $file]
}
