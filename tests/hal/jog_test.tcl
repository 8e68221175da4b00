# SPDX-License-Identifier: GPL-2.0-or-later
# pkmkins_jog.tcl: the axes that it connects, its waits and their limits, and its messages.

# Runs the file with the module and LinuxCNC's task for these letters. The maximum speeds are set, and the module answers at
# once; `more` is added to the prelude. Returns the requests without the loads.
proc jog {letters more {file LIB:pkmkins_jog.tcl}} {
    return [asked "\[HAL\]\nHALFILE = $file" [format {
        exists pkmkins.jog-scale out float
        foreach letter {%s} {
            exists pkmkins.jog-velocity.$letter out float 1e+99
            exists pkmkins.axis-max-velocity.$letter in float
            exists ini.$letter.max_velocity in float 2$letter
            dict set values ini.$letter.max_velocity [expr {200 + [scan $letter %%c]}]
        }
        variable on_setp model::answered
        %s
    } $letters $more]]
}

proc model::answered {pin value} {
    variable values
    if {[regexp {^pkmkins\.axis-max-velocity\.(.)$} $pin -> letter]} { dict set values pkmkins.jog-velocity.$letter $value }
}

# Returns the lines of axes that are slowed.
proc slowed {letters} {
    return [concat [lsort [lmap letter $letters {
        string cat "set pkmkins.axis-max-velocity.$letter " [expr {200 + [scan $letter %c]}]
    }]] [lsort [lmap letter $letters {
        string cat "net pkmkins:jog-velocity-$letter pkmkins.jog-velocity.$letter => ini.$letter.max_velocity"
    }]]]
}

# Name, letters of the machine, part of the prelude, letters that are slowed, messages, and duration in ms.
foreach {name letters more expected says least most} {
    all {x y z a b c} {} {x y z a b c} {} 0 0
    nine {x y z a b c u v w} {} {x y z a b c u v w} {} 0 0
    some {z b w} {} {z b w} {} 0 0
    no-module {x} {dict unset pins pkmkins.jog-scale} {} {the pin pkmkins.jog-scale is missing: load pkmkins} 0 0
    late {x y} {dict set values ini.y.max_velocity 0; later 19000 {dict set values ini.y.max_velocity 321}} {x y} {} 19000 19010
    late-pin {x y} {dict unset pins ini.x.max_velocity; later 3000 {exists ini.x.max_velocity in float 320}} {x y} {} 3000 3010
    never {x y} {dict set values ini.y.max_velocity 0} {x} {LinuxCNC's task did not set ini.y.max_velocity within 20 s} 20000 20010
    no-pin {x y} {dict unset pins ini.x.max_velocity} {y} {LinuxCNC's task did not set ini.x.max_velocity within 20 s} 20000 20010
    two {x y} {dict unset pins ini.x.max_velocity; dict unset pins ini.y.max_velocity} {}
    {LinuxCNC's task did not set ini.x.max_velocity within 20 s; LinuxCNC's task did not set ini.y.max_velocity within 20 s} 20000 20010
    letters {x y z u} {$::drives::box eval {set ::env(TRAJ_COORDINATES) XyU}} {x y u} {} 0 0
} {
    test jog-$name "the axes that can be slowed are, and the others are named" {
        set lines [jog $letters $more]
        set said [expr {$says eq "" ? {} : [list [reported $says]]}]
        set difference [difference $lines [table [join [concat [slowed $expected] $said] \n]]]
        if {$model::now < $least || $model::now > $most} { append difference "took $model::now ms" }
        set difference
    } {}
}

test jog-inch "speeds of less than 1, as a machine in inches has them, are speeds" {
    jog x {dict set values ini.x.max_velocity 0.4}
} {{set pkmkins.axis-max-velocity.x 0.4} {net pkmkins:jog-velocity-x pkmkins.jog-velocity.x => ini.x.max_velocity}}

test jog-answer "the module becomes the writer of a speed once it allows as much" {
    set lines [jog {x y} {
        variable on_setp list
        later 500 { dict set values pkmkins.jog-velocity.x 320; dict set values pkmkins.jog-velocity.y 321 }
    }]
    list [difference $lines [table [join [slowed {x y}] \n]]] [expr {$model::now in {500 510}}]
} {{} 1}

test jog-no-answer "a speed is left as it is where the module does not allow as much within a second" {
    set lines [jog {x y} {
        variable on_setp list
        later 500 { dict set values pkmkins.jog-velocity.y 321 }
        later 1500 { dict set values pkmkins.jog-velocity.x 320 }
    }]
    list $lines [expr {$model::now >= 1000 && $model::now <= 1020}]
} [list [list {set pkmkins.axis-max-velocity.x 320} {set pkmkins.axis-max-velocity.y 321} \
    {net pkmkins:jog-velocity-y pkmkins.jog-velocity.y => ini.y.max_velocity} \
    [reported "pkmkins.jog-velocity.x is 1e+99, not 320: check that pkmkins.monitor runs in a thread"]] 1]

test jog-twice "whoever comes second finds the work done" {
    set lines [jog x {} "LIB:pkmkins_jog.tcl\nHALFILE = LIB:pkmkins_jog.tcl"]
    difference $lines [table [join [slowed x] \n]]
} {}

test jog-taken "a speed that another signal has stays there" {
    set lines [jog {x y} {exists mine out float; net mine mine ini.x.max_velocity}]
    difference $lines [table [join [concat [slowed y] {{net mine mine => ini.x.max_velocity}} \
        [list [reported "ini.x.max_velocity already has signal mine: remove it"]]] \n]]
} {}

test jog-longer-name "a pin with a longer name is another pin" {
    set lines [jog x {exists ini.x.max_velocity_more in float 5; exists mine out float; net mine mine ini.x.max_velocity_more}]
    difference $lines [table [join [concat [slowed x] {{net mine mine => ini.x.max_velocity_more}}] \n]]
} {}

test jog-own-limit "a module whose limit another signal sets is named" {
    jog {x y} {exists mine out float; net mine mine pkmkins.axis-max-velocity.x}
} [linsert [concat [slowed y] [list [reported "pkmkins.axis-max-velocity.x is on signal mine"]]] 1 \
    "net mine mine => pkmkins.axis-max-velocity.x"]

test jog-writer "a signal of the same name with another writer is named" {
    lindex [jog x {exists mine out float; net pkmkins:jog-velocity-x mine}] end
} [reported "pkmkins:jog-velocity-x has the writer mine already, and cannot have pkmkins.jog-velocity.x"]

test jog-broken "an error ends nothing, and is reported" {
    jog x {interp alias $::drives::box hal {} apply {args {error "HAL has gone"}}}
} [list [reported "HAL has gone"]]

test jog-closed "a closed standard error ends nothing" {
    set lines [jog x {dict unset pins pkmkins.jog-scale; interp alias $::drives::box puts {} error}]
} {}
