# SPDX-License-Identifier: GPL-2.0-or-later
# Picks a machine in LinuxCNC's own configuration picker, which a hand would click through.
#
#     wish pick.tcl PICKER INI     prints what the picker prints: the INI file of the copy
#
# On standard error: what the picker shows of the machine.
lassign $argv picker wanted
set argv {}
# Yes to the question whether to copy, OK to where it was copied to.
proc tk_dialog {args} { return 0 }
proc pick {} {
    if {![info exists ::button_ok] || ![$::tree exists $::wanted]} {
        if {[incr ::looks] > 300} {
            puts stderr "pick.tcl: the picker does not offer $::wanted"
            exit 1
        }
        after 100 pick
        return
    }
    $::tree selection set $::wanted
    node_clicked
    puts stderr [$::detail_box get 1.0 end]
    press
}
# Again and again: the picker may not wait for the button yet.
proc press {} {
    $::button_ok invoke
    after 500 press
}
after 100 pick
source $picker
